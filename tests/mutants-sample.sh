#!/bin/sh
# Tests the tests with a random sample of the mutants of cargo-mutants in audit, laws, sim and plant. Applies one mutant
# at a time to a copy of the tree and lists the mutants that no test catches.
#
# From anywhere: sh tests/mutants-sample.sh [COUNT [SEED [FROM TO]]], by default 150 and 1. The same sources, count and
# seed give the same sample. FROM and TO select a part of it: 61 150 skips the first 60.
#
# Mutants run first against the unit tests of audit, laws and sim; those that survive run against the slow tests.
# TAUTLINE_MUTANT_TIMEOUT is the time limit of the tests of a mutant [s], by default 100; a busy machine needs more.
#
# Writes out/mutants/ (for a part out/mutants-FROM-TO/): sample.txt, caught.txt (with timeouts), missed.txt and
# unviable.txt (does not compile), and the folders quick/ and slow/ of cargo-mutants. A person must decide for each
# missed mutant whether it changes behaviour or only speed.
set -eu
cd "$(dirname "$0")/.."
count=${1:-150}
seed=${2:-1}
from=${3:-1}
to=${4:-$count}
timeout=${TAUTLINE_MUTANT_TIMEOUT:-100}
quick="--lib --test=audit --test=bits"
quick_crates=tautline-audit,tautline-laws,tautline-sim
slow="--test=flights --test=allocations --test=reported --test=claims --test=program"
slow_crates=tautline-sim,tautline-report,tautline-validate,tautline
export CARGO_TARGET_DIR="${CARGO_TARGET_DIR:-$PWD/target}"
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT

cargo mutants --version >/dev/null 2>&1 || cargo install --locked cargo-mutants

# Mutants are applied in place in the copy, so that builds of the other crates are reused.
mkdir "$scratch/tree"
tar -cf - --exclude=./target --exclude=./out --exclude=./.git . | tar -xf - -C "$scratch/tree"
out=$PWD/out/mutants${3:+-$from-$to}
rm -rf "$out"
mkdir -p "$out"
cd "$scratch/tree"
# Makes cargo rebuild crates that an interrupted run may have left with a mutant.
touch crates/*/src/lib.rs

mutants() {
    cargo mutants --no-shuffle --package tautline-audit,tautline-laws,tautline-sim \
        -f 'crates/audit/src/**' -f 'crates/laws/src/law/**' \
        -f 'crates/sim/src/sim/**' -f 'crates/sim/src/plant/**' "$@"
}

# Random order by a hash with the seed as its key. Mutants that delete a field of a struct are excluded: cargo-mutants
# 27.1 tries all of them despite `--re`, unless they are listed as caught.
yes "$seed" | head -c 64 > "$scratch/seed"
mutants --list > "$scratch/all.txt"
grep ': delete field ' "$scratch/all.txt" > "$scratch/fields.txt" || true
grep -v ': delete field ' "$scratch/all.txt" |
    sort --random-sort --random-source="$scratch/seed" | head -n "$count" | sed -n "$from,${to}p" > "$out/sample.txt"

# Runs the mutants that a file lists by their whole names against some tests. Results go to a folder.
try() {
    file=$1 results=$2 tests=$3 crates=$4
    [ -s "$file" ] || { echo "FROM TO: select no mutant of the sample" >&2; exit 2; }
    set --
    while IFS= read -r name; do
        set -- "$@" --re "^$(printf '%s' "$name" | sed 's/[][(){}.*+?|^$\\]/\\&/g')\$"
    done < "$file"
    # Arguments of cargo for builds and tests.
    for word in $tests; do
        set -- "$@" -C "$word"
    done
    mkdir -p "$results/mutants.out"
    cp "$scratch/fields.txt" "$results/mutants.out/caught.txt"
    status=0
    mutants --in-place --test-package "$crates" --timeout "$timeout" --output "$results" --iterate "$@" || status=$?
    # Exit codes of cargo-mutants: 2 for a missed mutant, 3 for a timeout.
    case $status in 0 | 2 | 3) ;; *) exit "$status" ;; esac
}

TAUTLINE_SCENES=${TAUTLINE_SCENES:-150}
export TAUTLINE_SCENES
try "$out/sample.txt" "$out/quick" "$quick" "$quick_crates"
found=$out/quick/mutants.out
cat "$found/caught.txt" "$found/timeout.txt" > "$out/caught.txt"
cp "$found/unviable.txt" "$out/unviable.txt"
cp "$found/missed.txt" "$out/missed.txt"
if [ -s "$out/missed.txt" ]; then
    cp "$out/missed.txt" "$scratch/again.txt"
    try "$scratch/again.txt" "$out/slow" "$slow" "$slow_crates"
    found=$out/slow/mutants.out
    cat "$found/caught.txt" "$found/timeout.txt" >> "$out/caught.txt"
    cp "$found/missed.txt" "$out/missed.txt"
fi
# Makes cargo rebuild the crates without mutants.
touch "$OLDPWD"/crates/*/src/lib.rs

lines() {
    wc -l < "$out/$1"
}
missed=$(lines missed.txt)
total="of a sample of $(lines sample.txt) with seed $seed"
echo "$(lines caught.txt) caught, $missed missed, $(lines unviable.txt) do not compile, $total"
cat "$out/missed.txt"
exit $((missed > 0))
