#!/bin/sh
# Fuzzes each target for some seconds: sh fuzz/run.sh [SECONDS [TARGET...]]
#
# The seeds of the tests are the first inputs. An input that fails is kept in fuzz/artifacts, and the exit code is 1.
set -eu
cd "$(dirname "$0")/.."
seconds=${1:-3} # also if it is empty
[ $# = 0 ] || shift
targets=${*:-$(sed -n 's/^name = "\([a-z_]*\)"$/\1/p' fuzz/Cargo.toml)}
fuzz=target/fuzz-tool/bin/cargo-fuzz

corpus=$PWD/target/fuzz/corpus
TAUTLINE_FUZZ_CORPUS=$corpus/readers cargo test --quiet --package tautline-recordings --test recordings every_format_has
mkdir -p "$corpus/readers/scenario"
cp assets/*.toml "$corpus/readers/scenario/"

failed=
for target in $targets; do
    mkdir -p "$corpus/$target"
    seeds=$corpus/readers/$(echo "$target" | tr _ -)
    # A development build: assertions and overflow checks are on. Without a sanitizer, which needs a nightly compiler;
    # the workspace has no unsafe code.
    "$fuzz" run --dev --sanitizer none --target-dir target/fuzz "$target" "$corpus/$target" \
        $([ ! -d "$seeds" ] || echo "$seeds") -- -max_total_time="$seconds" -timeout=20 -rss_limit_mb=4096 \
        -max_len=65536 -print_final_stats=1 || failed="$failed $target"
done
[ -z "$failed" ] || { echo "failing targets:$failed" >&2; exit 1; }
