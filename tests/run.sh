#!/bin/sh
# All set-up that the tests need, and the tests. From anywhere: sh tests/run.sh [--long] [arguments of cargo test]
# --long tries more cases where a test has more than a minute of them.
set -eu
cd "$(dirname "$0")/.."

if [ "${1:-}" = --long ]; then
    export TAUTLINE_LONG=1
    shift
fi

sh tests/setup.sh

# Debug and release builds must fly the same bits, whatever is built in: the core alone for release, then everything in
# debug, are held against the same hashes.
cargo test --release --no-default-features --test bits
cargo test "$@"

# Campaigns on a cluster, what others' continuous integration is given, and every command of the docs, with the program that was
# just built; arguments ask for some of cargo's tests alone.
if [ $# = 0 ]; then
    for tests in tests/cluster tests/ci tests/docs; do
        target/cluster/bin/python -m unittest discover --verbose --start-directory "$tests"
    done

    # The Python package, as its users build it but for the optimisation.
    VIRTUAL_ENV="$PWD/target/python" target/python/bin/maturin develop --manifest-path python/Cargo.toml
    target/python/bin/python -m unittest discover --verbose --start-directory tests/python
fi
