#!/bin/sh
# Breaks the program on purpose, one way at a time, in a copy of the tree, and expects the test that guards against it to
# fail. Each file of tests/mutants/ is one way: a line of one source file and what it becomes, and the test.
# From anywhere: sh tests/mutants.sh [NAME...], for example 01-sign. All ten take half an hour on two cores.
set -eu
cd "$(dirname "$0")/.."
export CARGO_TARGET_DIR="${CARGO_TARGET_DIR:-$PWD/target}"
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT

copy() {
    rm -rf "$scratch/tree"
    mkdir "$scratch/tree"
    tar -cf - --exclude=./target --exclude=./out --exclude=./.git . | tar -xf - -C "$scratch/tree"
}

field() {
    sed -n "s/^$2: *//p" "tests/mutants/$1"
}

# Replaces a text that must occur exactly once in a file, byte by byte.
replace() {
    FROM=$2 TO=$3 awk '
        { at = index($0, ENVIRON["FROM"]) }
        at { found++; $0 = substr($0, 1, at - 1) ENVIRON["TO"] substr($0, at + length(ENVIRON["FROM"])) }
        { print }
        END { exit found != 1 }
    ' "$1" > "$scratch/changed" || return 1
    cp "$scratch/changed" "$1"
}

failed=0
for mutant in ${*:-$(ls tests/mutants)}; do
    test=$(field "$mutant" test)
    copy
    replace "$scratch/tree/$(field "$mutant" file)" "$(field "$mutant" from)" "$(field "$mutant" to)" || {
        echo "$mutant: the line to break is not in $(field "$mutant" file) exactly once"
        exit 2
    }
    # Both trees share what is built; touching the file makes cargo build it anew for the tree at hand.
    touch "$(field "$mutant" file)"
    # Without the break the test must run and pass, and with it the program must still be a program.
    # shellcheck disable=SC2086
    cargo test $test > "$scratch/log" 2>&1 && grep -q '^test .* ok$' "$scratch/log" || {
        echo "$mutant: the test does not pass on the unbroken program: $test"
        exit 2
    }
    touch "$scratch/tree/$(field "$mutant" file)"
    # shellcheck disable=SC2086
    (cd "$scratch/tree" && cargo test --no-run $test) > "$scratch/log" 2>&1 || {
        echo "$mutant: the broken program does not compile"
        cat "$scratch/log"
        exit 2
    }
    # shellcheck disable=SC2086
    if (cd "$scratch/tree" && cargo test $test) > "$scratch/log" 2>&1; then
        echo "$mutant: SURVIVED $test"
        failed=1
    else
        echo "$mutant: caught by $test"
    fi
    # The broken program must not be taken for this tree's.
    touch "$(field "$mutant" file)"
done
exit $failed
