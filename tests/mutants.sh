#!/bin/sh
# Tests the tests: applies one mutant at a time to a copy of the tree and expects that its test fails.
# A file of tests/mutants/ describes a mutant: the source file, a part of a line, its replacement, and the test. With
# `survives: yes` the mutant must pass: it empties sentences, and no status, count or exit code may depend on them.
# From anywhere: sh tests/mutants.sh [NAME...], for example 01-sign. All thirteen take 45 minutes on two cores.
# TAUTLINE_TESTED=yes states that the tests pass without the mutants.
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

# Replaces a text, which must occur in exactly one line of a file.
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
    # A selection of one package alone would compile its dependencies with other features again.
    case $test in "-p "*) ;; *) test="--workspace --exclude tautline-python --exclude tautline-fuzz $test" ;; esac
    copy
    replace "$scratch/tree/$(field "$mutant" file)" "$(field "$mutant" from)" "$(field "$mutant" to)" || {
        echo "$mutant: $(field "$mutant" file) must have the line to replace exactly once"
        exit 2
    }
    # Both trees share the target folder: a touched file makes cargo rebuild it for the current tree.
    touch "$(field "$mutant" file)"
    # The test must pass without the mutant, and the mutant must compile.
    # shellcheck disable=SC2086
    if [ -z "${TAUTLINE_TESTED:-}" ]; then
        cargo test $test > "$scratch/log" 2>&1 && grep -q '^test .* ok$' "$scratch/log" || {
            echo "$mutant: the test fails without the mutant: $test"
            exit 2
        }
    fi
    touch "$scratch/tree/$(field "$mutant" file)"
    # shellcheck disable=SC2086
    (cd "$scratch/tree" && cargo test --no-run $test) > "$scratch/log" 2>&1 || {
        echo "$mutant: does not compile"
        cat "$scratch/log"
        exit 2
    }
    # shellcheck disable=SC2086
    outcome="caught by"
    (cd "$scratch/tree" && cargo test $test) > "$scratch/log" 2>&1 && outcome=SURVIVED
    expected="caught by"
    test "$(field "$mutant" survives)" = yes && expected=SURVIVED
    test "$outcome" = "$expected" || failed=1
    echo "$mutant: $outcome $test"
    # Makes cargo rebuild the file without the mutant.
    touch "$(field "$mutant" file)"
done
# The program of the shared target folder, which later tests call, must not be the one of the last mutant.
cargo build --quiet --workspace --exclude tautline-python --exclude tautline-fuzz --bin tautline
exit $failed
