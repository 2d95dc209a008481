#!/bin/sh
# Breaks the program at random: a seeded sample of what cargo-mutants would change in audit, law, sim and plant, one change
# at a time in a copy of the tree, and says which of them no test notices.
# From anywhere: sh tests/mutants-sample.sh [COUNT [SEED [FROM TO]]], by default 150 and 1. The same sources, count and seed
# give the same sample, of which FROM and TO choose a part: 61 150 leaves the first 60 out. Most changes are noticed by the
# unit tests of audit, laws and sim; only what those miss is tried on the slow ones. TAUTLINE_MUTANT_TIMEOUT is how long the tests
# of a change may take [s], by default 100: more on a machine that does other work beside.
# Leaves out/mutants/ (of a part, out/mutants-FROM-TO/) with sample.txt, caught.txt (by what no longer ends, too),
# missed.txt and unviable.txt (does not compile), and as it goes quick/ and slow/ as cargo-mutants writes them. Of what is
# missed a person says whether it changes behaviour or speed alone.
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

# In the copy, mutants are made in place: what was built of other crates is used again.
mkdir "$scratch/tree"
tar -cf - --exclude=./target --exclude=./out --exclude=./.git . | tar -xf - -C "$scratch/tree"
out=$PWD/out/mutants${3:+-$from-$to}
rm -rf "$out"
mkdir -p "$out"
cd "$scratch/tree"
# What was built of a change before, where that was broken off, must not be taken for this tree's.
touch crates/*/src/lib.rs

mutants() {
    cargo mutants --no-shuffle --package tautline-audit,tautline-laws,tautline-sim -f 'crates/audit/src/**' -f 'crates/laws/src/law/**' -f 'crates/sim/src/sim/**' \
        -f 'crates/sim/src/plant/**' "$@"
}

# Random order by a hash that the seed keys. A field left out of a struct is no part of it: cargo-mutants 27.1 tries each of
# them, whatever names are asked for, but for those that it is told were caught before.
yes "$seed" | head -c 64 > "$scratch/seed"
mutants --list > "$scratch/all.txt"
grep ': delete field ' "$scratch/all.txt" > "$scratch/fields.txt" || true
grep -v ': delete field ' "$scratch/all.txt" |
    sort --random-sort --random-source="$scratch/seed" | head -n "$count" | sed -n "$from,${to}p" > "$out/sample.txt"

# Tries the mutants whose whole names are in a file on some tests; results go to a folder.
try() {
    file=$1 results=$2 tests=$3 crates=$4
    [ -s "$file" ] || { echo "no mutant of the sample is in this part" >&2; exit 2; }
    set --
    while IFS= read -r name; do
        set -- "$@" --re "^$(printf '%s' "$name" | sed 's/[][(){}.*+?|^$\\]/\\&/g')\$"
    done < "$file"
    # For building and for testing alike.
    for word in $tests; do
        set -- "$@" -C "$word"
    done
    mkdir -p "$results/mutants.out"
    cp "$scratch/fields.txt" "$results/mutants.out/caught.txt"
    status=0
    mutants --in-place --test-package "$crates" --timeout "$timeout" --output "$results" --iterate "$@" || status=$?
    # Exit codes of cargo-mutants: 2 for something missed, 3 for something that no longer ended.
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
# The broken program must not be taken for this tree's.
touch "$OLDPWD"/crates/*/src/lib.rs

lines() {
    wc -l < "$out/$1"
}
missed=$(lines missed.txt)
echo "$(lines caught.txt) caught, $missed missed, $(lines unviable.txt) do not compile, of a sample of $(lines sample.txt) with seed $seed"
cat "$out/missed.txt"
exit $((missed > 0))
