#!/bin/sh
# Prints the section of CHANGELOG.md of a version, as the notes of its release: sh .github/notes.sh VERSION
#
# The heading is `## VERSION` or `## VERSION (DATE)`. A version without a section, or with an empty one, is an error:
# rename `## Unreleased` before the tag.
set -eu
[ $# = 1 ] || { echo "usage: notes.sh VERSION" >&2; exit 2; }
version=${1#v}
changelog=$(dirname "$0")/../CHANGELOG.md
notes=$(awk -v version="$version" '
    /^## / { inside = $2 == version; next }
    inside { print }
' "$changelog" | sed -e '/./,$!d')
if [ -z "$notes" ]; then
    echo "CHANGELOG.md: has no section of version $version; rename \"## Unreleased\" to \"## $version\"" >&2
    exit 1
fi
if ! grep -qx "version: $version" "$(dirname "$0")/../CITATION.cff"; then
    echo "CITATION.cff: has another version; write \"version: $version\"" >&2
    exit 1
fi
printf '%s\n' "$notes"
