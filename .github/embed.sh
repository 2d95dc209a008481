#!/bin/sh
# Copies files of the repository into the packages that need them: sh .github/embed.sh crates|wheel|remove
#
# A package holds only files of its own folder. Crates embed files of `assets` and `shaders`; their build scripts
# find the copies. Every crate has both licences. A wheel has them too, and those of its libraries if
# .github/notices.sh wrote them.
set -eu
cd "$(dirname "$0")/.."
case ${1:-} in crates | wheel | remove) ;; *) echo "usage: embed.sh crates|wheel|remove" >&2; exit 2 ;; esac

# Pairs of a file or folder and its copy.
crates() {
    for crate in sim report; do echo "assets crates/$crate/assets"; done
    for crate in report render; do echo "shaders crates/$crate/shaders"; done
    for crate in crates/*/; do
        for licence in LICENSE-MIT LICENSE-APACHE; do echo "$licence $crate$licence"; done
    done
}
wheel() {
    for licence in LICENSE-MIT LICENSE-APACHE THIRD-PARTY.txt; do echo "$licence python/$licence"; done
}

if [ "$1" = remove ]; then
    (crates && wheel) | while read -r from to; do rm -rf "$to"; done
else
    "$1" | while read -r from to; do
        rm -rf "$to"
        if [ -e "$from" ]; then cp -R "$from" "$to"; fi
    done
fi
