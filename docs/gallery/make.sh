#!/bin/sh
# Draws the film of the README and the figure of the shield anew. From anywhere: sh docs/gallery/make.sh
# The pictures are drawn and compared by a test: UPDATE_PICTURES=1 cargo test --test viewer pictures
set -eu
cd "$(dirname "$0")/../.."
cargo build --release
out=$(mktemp -d)
trap 'rm -r "$out"' EXIT

# Twelve vehicles change places twice. The first flight ends in violations, which is exit code 1.
fly() { target/release/tautline run swap "$@" --quiet --no-figures --no-snapshots; }
fly --set law.kind=laplacian --set name=no-avoidance --out "$out/without" || [ $? = 1 ]
fly --set name=certified-law --out "$out/with"
target/release/tautline render "$out/without/run.mcap" --beside "$out/with/run.mcap" --film docs/gallery/first.gif \
    --size 560x280 --film-fps 8 --until 24 --speed 8 --trail 1.5 --adapter none --quiet

target/release/tautline compare swap --laws laplacian,orca,cbf-qp,displacement --shield --runs 20 \
    --set actuation.max_accel_m_s2=5 --html "$out/compare.html" --quiet
# The first figure of the page.
sed 's/<svg/\n&/; s/<\/svg>/&\n/' "$out/compare.html" | grep -m 1 '^<svg' > docs/gallery/shield.svg
