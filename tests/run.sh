#!/bin/sh
# Sets up and runs the tests. From anywhere: sh tests/run.sh [--long] [arguments of cargo test]
#
# --long adds tests that take minutes: ignored tests, release bits, MP4 films, fuzz targets, three of tests/mutants,
# clusters, notebooks and the commands of the docs. TAUTLINE_LONG=1 adds random cases, an hour of fuzzing, and
# the slowest commands of the docs.
set -eu
cd "$(dirname "$0")/.."

long=
if [ "${1:-}" = --long ]; then
    long=yes
    shift
fi

sh tests/setup.sh

# The debug build flies the golden scenarios; with --long the release build must have the same hashes.
arguments=$#
if [ "$long" ]; then
    case " $* " in *" -- "*) set -- "$@" --include-ignored ;; *) set -- "$@" -- --include-ignored ;; esac
fi
# The Python package and the fuzz targets have tests of their own.
cargo test --workspace --exclude tautline-python --exclude tautline-fuzz "$@"
if [ "$arguments" != 0 ]; then exit; fi
if [ "$long" ]; then
    cargo test --release -p tautline-sim --test bits
    # The H.264 encoder, which is not a default feature.
    cargo test -p tautline-render --features mp4 film
    # A minute for all fuzz targets, with the same inputs in each run; TAUTLINE_LONG=1 takes an hour, with others.
    sh fuzz/run.sh "${TAUTLINE_LONG:+170}"
    # A mutant of the law and one of the audit, and one that empties sentences, on which no verdict may depend.
    sh tests/mutants.sh 03-a22 07-sweep-off 11-reasons-without-text
fi

# With the debug build: the GitHub action, hook and archives; with --long also clusters and every command of the docs.
for tests in tests/ci ${long:+tests/cluster tests/docs}; do
    target/cluster/bin/python -m unittest discover --verbose --start-directory "$tests"
done

# Exported files with the libraries of their formats.
target/readers/bin/python -m unittest discover --verbose --start-directory tests/readers

# The Python package, in a debug build.
VIRTUAL_ENV="$PWD/target/python" target/python/bin/maturin develop --manifest-path python/Cargo.toml
TAUTLINE_NOTEBOOKS=$long target/python/bin/python -m unittest discover --verbose --start-directory tests/python
