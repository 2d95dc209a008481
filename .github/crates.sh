#!/bin/sh
# Packs or publishes the crates, in the order of their dependencies: sh .github/crates.sh package|publish [ARGUMENT...]
#
# Arguments go to `cargo package` or `cargo publish`, for example --dry-run. REPOSITORY, the URL of the repository, is
# written into the manifests first; then the working tree is changed, so use a copy (a runner has one).
set -eu
[ $# -ge 1 ] || { echo "usage: [REPOSITORY=URL] crates.sh package|publish [ARGUMENT...]" >&2; exit 2; }
command=$1
shift
case $command in package | publish) ;; *) echo "$command: must be package or publish" >&2; exit 2 ;; esac
cd "$(dirname "$0")/.."

if [ -n "${REPOSITORY:-}" ]; then
    case $REPOSITORY in
        https://*) ;;
        *) echo "REPOSITORY: must be a URL (https://...), got $REPOSITORY" >&2; exit 2 ;;
    esac
    for manifest in Cargo.toml crates/*/Cargo.toml; do
        # The table [package] only: the workspace has a license, too.
        line="repository = \"$REPOSITORY\""
        sed "/^\[package\]/,/^\[/ s|^license.workspace = true|&\n$line|" "$manifest" >"$manifest.new"
        mv "$manifest.new" "$manifest"
    done
    set -- --allow-dirty "$@"
fi

# Examples and the fuzz targets are members of the workspace, too.
for manifest in examples/crates/*/Cargo.toml fuzz/Cargo.toml python/Cargo.toml; do
    set -- --exclude "$(sed -n 's/^name = "\(.*\)"/\1/p' "$manifest" | head -n 1)" "$@"
done
cargo "$command" --workspace "$@"
