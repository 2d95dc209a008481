#!/bin/sh
# Starts what a release publishes: sh .github/smoke.sh FILE...
# FILE is an archive of the program, a wheel or the source distribution. PYTHON is the interpreter [python3].
set -eu
[ $# -ge 1 ] || { echo "usage: [PYTHON=...] smoke.sh FILE..." >&2; exit 2; }
version=$(sed -n 's/^version = "\(.*\)"/\1/p' "$(dirname "$0")/../Cargo.toml" | head -n 1)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# Flies the pentagon with a program: fly PROGRAM
fly() {
    found=$("$1" --version | tr -d '\r')
    if [ "$found" != "tautline $version" ]; then
        echo "$1: has the version \"$found\", must be \"tautline $version\"" >&2
        exit 1
    fi
    "$1" run pentagon --set law.kind=displacement --out "$work/flight" >"$work/answer"
    if ! grep -q '^CLEAR' "$work/answer"; then
        echo "$1: the flight is not CLEAR:" >&2
        cat "$work/answer" >&2
        exit 1
    fi
}

for file; do
    rm -rf "$work/"*
    case ${file##*/} in
        *.whl | "tautline-$version.tar.gz")
            "${PYTHON:-python3}" -m venv "$work/venv"
            bin=$work/venv/bin
            # Windows has another folder.
            [ -d "$bin" ] || bin=$work/venv/Scripts
            "$bin/python" -m pip install --quiet --disable-pip-version-check "$file"
            fly "$bin/tautline"
            (
                cd "$work"
                "$bin/python" -c 'import tautline as tl; assert tl.audit("flight", delta=1).status == "clear"'
            )
            ;;
        tautline-*.tar.gz)
            tar -xzf "$file" -C "$work"
            fly "$(ls "$work"/tautline-*/tautline "$work"/tautline-*/tautline.exe 2>/dev/null)"
            ;;
        *) echo "$file: must be an archive, a wheel or the source distribution" >&2; exit 2 ;;
    esac
    echo "$file: started"
done
