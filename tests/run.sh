#!/bin/sh
# All set-up that the tests need, and the tests. From anywhere: sh tests/run.sh
set -eu
cd "$(dirname "$0")/.."

sh tests/setup.sh

# The library core alone, then everything. Debug and release builds must fly the same bits: tests/program/determinism.rs
# compares the release program with its own debug build.
cargo check --lib --no-default-features
cargo build --release
cargo test "$@"
