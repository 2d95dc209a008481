#!/bin/sh
# All set-up that the tests need, and the tests. From anywhere: sh tests/run.sh
set -eu
cd "$(dirname "$0")/.."

sh tests/setup.sh

# Debug and release builds must fly the same bits, whatever is built in: the core alone for release, then everything in
# debug, are held against the same hashes.
cargo test --release --no-default-features --test bits
cargo test "$@"
