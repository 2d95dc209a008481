#!/bin/sh
# Installs a released program: RELEASES=URL sh .github/install.sh VERSION FOLDER
# RELEASES holds the archives of a version: .../releases/download/vVERSION, or a folder (file:///...).
set -eu
[ $# = 2 ] || { echo "usage: RELEASES=URL install.sh VERSION FOLDER" >&2; exit 2; }
[ -n "${RELEASES:-}" ] || { echo "RELEASES: must be the URL of the archives" >&2; exit 2; }
version=${1#v} folder=$2

case "$(uname -s)" in
    Linux) system=unknown-linux-gnu ;;
    Darwin) system=apple-darwin ;;
    MINGW* | MSYS* | CYGWIN*) system=pc-windows-msvc ;;
    *) echo "$(uname -s): has no archive; build from source" >&2; exit 3 ;;
esac
case "$(uname -m)" in
    x86_64 | amd64) machine=x86_64 ;;
    arm64 | aarch64) machine=aarch64 ;;
    *) echo "$(uname -m): has no archive; build from source" >&2; exit 3 ;;
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
# The name of a file in the checksum is ignored: only the hash counts.
if command -v sha256sum >/dev/null; then
    found=$(sha256sum <"$work/$name.tar.gz")
else
    found=$(shasum -a 256 <"$work/$name.tar.gz")
fi
if [ "${found%% *}" != "$(cut -d ' ' -f 1 "$work/$name.tar.gz.sha256")" ]; then
    echo "$name.tar.gz: differs from its checksum; nothing is installed" >&2
    exit 3
fi
tar -xzf "$work/$name.tar.gz" -C "$work"
mkdir -p "$folder"
program=tautline
case "$system" in *windows*) program=tautline.exe ;; esac
if [ ! -f "$work/$name/$program" ]; then
    echo "$name.tar.gz: has no $program; nothing is installed" >&2
    exit 3
fi
mv -f "$work/$name/$program" "$folder/"
echo "$folder"
