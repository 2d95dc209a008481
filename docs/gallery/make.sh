#!/bin/sh
# Draws the pictures of the README and the book anew. From anywhere: sh docs/gallery/make.sh
set -eu
cd "$(dirname "$0")/../.."
cargo build --release
out=$(mktemp -d)
trap 'rm -r "$out"' EXIT

# The classical law ends in a violation, which is exit code 1.
fly() { target/release/tautline run "$1" --out "$out/$2" --quiet --no-figures || [ "$2" = laplacian ]; }
fly pentagon pentagon
fly pentagon-laplacian laplacian
fly examples/sphere.toml sphere
fly obstacles obstacles
fly show show
draw() { target/release/tautline render "$@" --size 960x540 --quiet; }
draw "$out/sphere" --out "$out/ball" --at end --camera follow --theme light
draw "$out/obstacles" --out "$out/among" --at 10 --camera follow
draw "$out/show" --out "$out/word" --at 23.8 --theme light
target/release/tautline render pentagon-laplacian --beside pentagon --film docs/gallery/first.gif \
    --size 800x400 --film-fps 12 --until 16 --speed 2 --quiet

target/release/tautline compare swap --laws laplacian,orca,cbf-qp,displacement --shield --runs 20 \
    --set actuation.max_accel_m_s2=5 --html "$out/compare.html" --quiet
# The first figure of the page.
sed 's/<svg/\n&/; s/<\/svg>/&\n/' "$out/compare.html" | grep -m 1 '^<svg' > docs/gallery/shield.svg

for moment in start closest end; do
    cp "$out/pentagon/snapshots/$moment.png" "docs/gallery/pentagon-$moment.png"
done
cp "$out/laplacian/snapshots/violation-1.png" docs/gallery/laplacian-violation.png
cp "$out/ball/end.png" docs/gallery/sphere.png
cp "$out/among/at-10.000s.png" docs/gallery/obstacles.png
cp "$out/word/at-23.800s.png" docs/gallery/show.png
