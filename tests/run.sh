#!/bin/sh
# All set-up that the tests need, and the tests. From anywhere: sh tests/run.sh [--long] [arguments of cargo test]
# --long adds what takes minutes: the tests that are marked as ignored, release bits, MP4 films, two of tests/mutants, clusters,
# notebooks, and the commands of the docs. TAUTLINE_LONG=1 beside it tries more random cases, and the slowest of those commands.
set -eu
cd "$(dirname "$0")/.."

long=
if [ "${1:-}" = --long ]; then
    long=yes
    shift
fi

sh tests/setup.sh

# Flies the golden scenarios in debug; with --long the release build is compared with the same hashes.
asked=$#
if [ "$long" ]; then
    case " $* " in *" -- "*) set -- "$@" --include-ignored ;; *) set -- "$@" -- --include-ignored ;; esac
fi
cargo test "$@"
if [ "$asked" != 0 ]; then exit; fi
if [ "$long" ]; then
    cargo test --release -p tautline-sim --test bits
    # The encoder that is not built in by default.
    cargo test -p tautline-render --features mp4 film
    # Two of the deliberate breaks, one of the law and one of the judge.
    sh tests/mutants.sh 03-a22 07-sweep-off
fi

# What is offered to others' continuous integration; campaigns on clusters and every command of the docs, with the program that
# was just built.
for tests in tests/ci ${long:+tests/cluster tests/docs}; do
    target/cluster/bin/python -m unittest discover --verbose --start-directory "$tests"
done

# The Python package, as its users build it but for the optimisation.
VIRTUAL_ENV="$PWD/target/python" target/python/bin/maturin develop --manifest-path python/Cargo.toml
TAUTLINE_NOTEBOOKS=$long target/python/bin/python -m unittest discover --verbose --start-directory tests/python
