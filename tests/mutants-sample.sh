#!/bin/sh
# Breaks the program at random: a seeded sample of what cargo-mutants would change in audit, law, sim and plant, one change
# at a time in a copy of the tree, and says which of them no test notices.
# From anywhere: sh tests/mutants-sample.sh [COUNT [SEED]], by default 150 and 1. The same sources, count and seed give the
# same sample. MUTANTS_TESTS names what cargo test runs; a change takes as long as building the program and these tests.
# Leaves out/mutants/ with sample.txt, caught.txt, missed.txt, timeout.txt (caught by what no longer ends) and
# unviable.txt (does not compile). Of what is missed a person says whether it changes behaviour or speed alone.
set -eu
cd "$(dirname "$0")/.."
count=${1:-150}
seed=${2:-1}
tests=${MUTANTS_TESTS:---lib --test audit --test flights --test bits --test allocations}
export CARGO_TARGET_DIR="${CARGO_TARGET_DIR:-$PWD/target}"
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT

cargo mutants --version >/dev/null 2>&1 || cargo install --locked cargo-mutants

# In the copy, mutants are made in place: what was built of other crates is used again.
mkdir "$scratch/tree"
tar -cf - --exclude=./target --exclude=./out --exclude=./.git . | tar -xf - -C "$scratch/tree"
out=$PWD/out/mutants
rm -rf "$out"
mkdir -p "$out"
cd "$scratch/tree"

mutants() {
    cargo mutants --no-shuffle -f 'src/audit/**' -f 'src/law/**' -f 'src/sim/**' -f 'src/plant/**' "$@"
}

# Random order by a hash that the seed keys. A field left out of a struct is no part of it: cargo-mutants 27.1 would try
# each of them, whatever names are asked for.
yes "$seed" | head -c 64 > "$scratch/seed"
mutants --list | grep -v ': delete field ' |
    sort --random-sort --random-source="$scratch/seed" | head -n "$count" > "$out/sample.txt"

# Each of the sample by its whole name.
set --
while IFS= read -r name; do
    set -- "$@" --re "^$(printf '%s' "$name" | sed 's/[][(){}.*+?|^$\\]/\\&/g')\$"
done < "$out/sample.txt"
status=0
# shellcheck disable=SC2086
mutants --in-place --output "$out" --exclude-re ': delete field ' "$@" -- $tests || status=$?
mv "$out"/mutants.out/*.txt "$out"
# The broken program must not be taken for this tree's.
touch "$OLDPWD/src/lib.rs"

lines() {
    wc -l < "$out/$1"
}
caught=$(($(lines caught.txt) + $(lines timeout.txt)))
missed=$(lines missed.txt)
echo "$caught caught, $missed missed, $(lines unviable.txt) do not compile, of a sample of $(lines sample.txt) with seed $seed"
cat "$out/missed.txt"
# Exit codes of cargo-mutants: 2 for something missed, 3 for something that no longer ended.
case $status in 0 | 2 | 3) exit $((missed > 0)) ;; *) exit "$status" ;; esac
