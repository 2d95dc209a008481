#!/bin/sh
# Writes THIRD-PARTY.txt, the licences of all libraries in a program or a wheel: sh .github/notices.sh MANIFEST
# Needs cargo-about 0.9.
set -eu
[ $# = 1 ] || { echo "usage: notices.sh MANIFEST" >&2; exit 2; }
cd "$(dirname "$0")/.."
cargo about generate --locked --manifest-path "$1" --config .github/about.toml .github/about.hbs \
    --output-file THIRD-PARTY.txt
