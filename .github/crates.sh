#!/bin/sh
# Packs or publishes the crates: sh .github/crates.sh package|publish [ARGUMENT...]
#
# Arguments go to `cargo package` or `cargo publish`, for example --dry-run. While the command runs, Cargo.toml has
# REPOSITORY, the URL of the repository, in place of its placeholder, and the crates have copies of embedded files.
#
# `publish` publishes crate by crate in the order of their dependencies and skips versions that the registry already
# has, so a failed run can be repeated. The registry accepts 5 new crates at once, then one every 10 minutes: after a
# refusal (HTTP 429) the script tries again every WAIT_S seconds [300].
set -eu
[ $# -ge 1 ] || { echo "usage: [REPOSITORY=URL] crates.sh package|publish [ARGUMENT...]" >&2; exit 2; }
command=$1
shift
case $command in package | publish) ;; *) echo "$command: must be package or publish" >&2; exit 2 ;; esac
case ${REPOSITORY:-https://} in
    https://*) ;;
    *) echo "REPOSITORY: must be a URL (https://...), got $REPOSITORY" >&2; exit 2 ;;
esac
wait_s=${WAIT_S:-300}
cd "$(dirname "$0")/.."
manifests=$(echo Cargo.toml crates/*/Cargo.toml)

work=$(mktemp -d)
# Restores the manifest with its time, so that cargo does not rebuild the crates.
restore() {
    if [ -f "$work/Cargo.toml" ]; then cp -p "$work/Cargo.toml" Cargo.toml; fi
    sh .github/embed.sh remove
    rm -rf "$work"
}
trap restore EXIT
trap 'exit 130' HUP INT TERM

sh .github/embed.sh crates
set -- --allow-dirty "$@"

if [ -n "${REPOSITORY:-}" ]; then
    cp -p Cargo.toml "$work/Cargo.toml"
    sed "s|^repository = .*|repository = \"$REPOSITORY\"|" "$work/Cargo.toml" >Cargo.toml
fi

# The name in a manifest.
name() {
    sed -n 's/^name = "\(.*\)"/\1/p' "$1" | head -n 1
}

# All crates in one call. A dry run is one call, too: its crates depend on versions that the registry does not have.
case "$command $* " in
    package\ * | *" --dry-run "* | *" -n "*)
        # Examples and the fuzz targets are members of the workspace, too.
        for manifest in examples/crates/*/Cargo.toml fuzz/Cargo.toml python/Cargo.toml; do
            set -- --exclude "$(name "$manifest")" "$@"
        done
        cargo "$command" --workspace "$@"
        exit
        ;;
esac

# `tsort` reads pairs of a dependency and its user. A pair of equal names only adds the name.
for manifest in $manifests; do
    crate=$(name "$manifest")
    echo "$crate $crate"
    awk -v crate="$crate" '
        /^\[/ { inside = /dependencies\]$/ && !/^\[workspace/ }
        inside && /^tautline/ { split($0, part, /[^A-Za-z0-9_-]/); print part[1], crate }
    ' "$manifest"
done >"$work/pairs"
crates=$(tsort "$work/pairs")

for crate in $crates; do
    echo "$crate: publishing"
    tries=1
    until cargo publish --package "$crate" "$@" 2>"$work/log"; do
        cat "$work/log" >&2
        if grep -q -e 'already exists on' -e 'is already uploaded' "$work/log"; then
            echo "$crate: skipped, already published"
            continue 2
        fi
        if ! grep -q '429 Too Many Requests' "$work/log"; then
            echo "$crate: not published; repeat the command after a correction, it skips published crates" >&2
            exit 1
        fi
        if [ "$tries" = 30 ]; then
            echo "$crate: not published in $tries attempts; repeat the command later" >&2
            exit 1
        fi
        tries=$((tries + 1))
        echo "$crate: too many new crates; attempt $tries follows in $wait_s s" >&2
        sleep "$wait_s"
    done
    cat "$work/log" >&2
done
