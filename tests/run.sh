#!/bin/sh
# All set-up that the tests need, and the tests. From anywhere: sh tests/run.sh
set -eu
cd "$(dirname "$0")/.."

# The C toolchain that linking needs; everything else comes with cargo.
if ! command -v cc >/dev/null 2>&1; then
    sudo=$([ "$(id -u)" = 0 ] || echo sudo)
    $sudo apt-get update
    $sudo apt-get install -y --no-install-recommends gcc libc6-dev
fi

# The browser that tests/browser.rs opens reports in.
if ! command -v chromium >/dev/null 2>&1; then
    sudo=$([ "$(id -u)" = 0 ] || echo sudo)
    $sudo apt-get update
    $sudo apt-get install -y --no-install-recommends chromium fonts-dejavu-core
fi

# The library core alone, then everything. Debug and release builds must fly the same bits: tests/determinism.rs
# compares the release program with its own debug build.
cargo check --lib --no-default-features
cargo build --release
cargo test "$@"
