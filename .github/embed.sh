#!/bin/sh
# Copies files of the repository into the packages that need them, or removes the copies: sh .github/embed.sh copy|remove
#
# A package holds only files of its own folder. Crates embed files of `assets` and `shaders`, and every package has both
# licences. A wheel has those of its libraries too, if .github/notices.sh wrote them. The build scripts of the crates find
# the copies.
set -eu
cd "$(dirname "$0")/.."
case ${1:-} in copy | remove) ;; *) echo "usage: embed.sh copy|remove" >&2; exit 2 ;; esac

each() {
    for crate in sim report; do echo "assets crates/$crate/assets"; done
    for crate in report render; do echo "shaders crates/$crate/shaders"; done
    for package in crates/*/ python/; do
        for licence in LICENSE-MIT LICENSE-APACHE; do echo "$licence $package$licence"; done
    done
    if [ -f THIRD-PARTY.txt ]; then echo THIRD-PARTY.txt python/THIRD-PARTY.txt; fi
}

each | while read -r from to; do
    rm -rf "$to"
    if [ "$1" = copy ]; then cp -R "$from" "$to"; fi
done
