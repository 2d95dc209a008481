#!/bin/sh
# Draws the pictures of the README anew. From anywhere: sh docs/gallery/make.sh
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
target/release/tautline render "$out/sphere/run.mcap" --out "$out/ball" --at end --camera 35,22,38 --theme light \
    --size 960x540 --quiet

target/release/tautline render "$out/obstacles/run.mcap" --out "$out/among" --at 3 --size 960x540 --quiet
target/release/tautline render "$out/show/run.mcap" --out "$out/word" \
    --at 23.8 --camera top --theme light --size 960x540 \
    --quiet

for moment in start closest end; do
    cp "$out/pentagon/snapshots/$moment.png" "docs/gallery/pentagon-$moment.png"
done
cp "$out/laplacian/snapshots/violation-1.png" docs/gallery/laplacian-violation.png
cp "$out/ball/end.png" docs/gallery/sphere.png
cp "$out/among/at-3.000s.png" docs/gallery/obstacles.png
cp "$out/word/at-23.800s.png" docs/gallery/show.png
