#!/bin/sh
# Installs a released program: sh .github/install.sh VERSION FOLDER
# RELEASES is where the archives of a version lie: .../releases/download/vVERSION, or a folder (file:///...).
set -eu
[ $# = 2 ] || { echo "usage: RELEASES=URL install.sh VERSION FOLDER" >&2; exit 2; }
[ -n "${RELEASES:-}" ] || { echo "say where the archives lie: RELEASES=URL" >&2; exit 2; }
version=${1#v} folder=$2

case "$(uname -s)" in
    Linux) system=unknown-linux-gnu ;;
    Darwin) system=apple-darwin ;;
    MINGW* | MSYS* | CYGWIN*) system=pc-windows-msvc ;;
    *) echo "no archive is made for $(uname -s): build from source" >&2; exit 3 ;;
esac
case "$(uname -m)" in
    x86_64 | amd64) machine=x86_64 ;;
    arm64 | aarch64) machine=aarch64 ;;
    *) echo "no archive is made for $(uname -m): build from source" >&2; exit 3 ;;
esac
name=tautline-$version-$machine-$system

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
for file in "$name.tar.gz" "$name.tar.gz.sha256"; do
    curl --fail --silent --show-error --location --retry 3 --output "$work/$file" "$RELEASES/$file" || {
        echo "cannot fetch $RELEASES/$file" >&2
        exit 3
    }
done
# Of the archive itself, whatever file the checksum is said to be of.
if command -v sha256sum >/dev/null; then found=$(sha256sum <"$work/$name.tar.gz"); else found=$(shasum -a 256 <"$work/$name.tar.gz"); fi
if [ "${found%% *}" != "$(cut -d ' ' -f 1 "$work/$name.tar.gz.sha256")" ]; then
    echo "$name.tar.gz is not what its checksum says: it is not installed" >&2
    exit 3
fi
tar -xzf "$work/$name.tar.gz" -C "$work"
mkdir -p "$folder"
program=tautline
case "$system" in *windows*) program=tautline.exe ;; esac
if [ ! -f "$work/$name/$program" ]; then
    echo "$name.tar.gz has no $program: nothing is installed" >&2
    exit 3
fi
mv -f "$work/$name/$program" "$folder/"
echo "$folder"
