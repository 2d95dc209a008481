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

# Campaigns on a cluster, and what others' continuous integration is given, with the program that was just built; arguments ask
# for some of cargo's tests alone.
if [ $# = 0 ]; then
    for tests in tests/cluster tests/ci; do
        target/cluster/bin/python -m unittest discover --verbose --start-directory "$tests"
    done
fi
