#!/bin/sh
# Packs the program for one system: sh .github/package.sh PROGRAM TARGET FOLDER [SUFFIX]
# Writes tautline-VERSION-TARGET[-SUFFIX].tar.gz and its SHA-256 into FOLDER. The suffix `viewer` marks the program with
# pictures and the window; the installer takes the archive without a suffix. NOTICES is the file of the licences of
# libraries [THIRD-PARTY.txt of .github/notices.sh].
set -eu
[ $# = 3 ] || [ $# = 4 ] || { echo "usage: package.sh PROGRAM TARGET FOLDER [SUFFIX]" >&2; exit 2; }
program=$1 target=$2 folder=$3
root=$(cd "$(dirname "$0")/.." && pwd)
version=$(sed -n 's/^version = "\(.*\)"/\1/p' "$root/Cargo.toml" | head -n 1)
notices=${NOTICES:-$root/THIRD-PARTY.txt}
[ -s "$notices" ] || { echo "$notices: missing; sh .github/notices.sh Cargo.toml writes it" >&2; exit 2; }
name=tautline-$version-$target${4:+-$4}

mkdir -p "$folder"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
mkdir "$work/$name"
cp "$program" "$root/README.md" "$root/CHANGELOG.md" "$root/LICENSE-MIT" "$root/LICENSE-APACHE" "$work/$name/"
cp "$notices" "$work/$name/THIRD-PARTY.txt"
tar -czf "$folder/$name.tar.gz" -C "$work" "$name"
cd "$folder"
if command -v sha256sum >/dev/null; then
    sha256sum "$name.tar.gz"
else
    shasum -a 256 "$name.tar.gz"
fi >"$name.tar.gz.sha256"
echo "$folder/$name.tar.gz"
