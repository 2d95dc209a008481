#!/bin/sh
# Fuzzes each target for some seconds: sh fuzz/run.sh [SECONDS [TARGET...]]
#
# The seeds of the tests are the first inputs. An input that fails is kept in fuzz/artifacts, and the exit code is 1.
# Without SECONDS, runs are short and repeatable: the inputs follow from a fixed seed, without those of earlier runs.
set -eu
cd "$(dirname "$0")/.."
seconds=${1:-} # may be given as the empty string
[ $# = 0 ] || shift
fuzz=target/fuzz-tool/bin/cargo-fuzz

corpus=$PWD/target/fuzz/corpus
seed=0 # another one for each run
if [ -z "$seconds" ]; then
    seconds=3 seed=1
    rm -rf "$corpus"
fi
# A selection of one package alone would compile its dependencies with other features again.
TAUTLINE_FUZZ_CORPUS=$corpus/readers cargo test --quiet --workspace --exclude tautline-python --exclude tautline-fuzz \
    --test recordings every_format_has
mkdir -p "$corpus/readers/scenario"
cp assets/*.toml "$corpus/readers/scenario/"

# A target is a reader, `recording` for the recognition of formats, `scenario`, or a live source.
targets=${*:-$(ls "$corpus/readers") watch-lines watch-mavlink watch-rosbridge}
failed=
for target in $targets; do
    case $target in
        scenario) program=scenario ;;
        watch-*) program=watch ;;
        *) program=reader ;;
    esac
    mkdir -p "$corpus/$target"
    seeds=$corpus/readers/$target
    # A development build: assertions and overflow checks are on. Without a sanitizer, which needs a nightly compiler;
    # the workspace has no unsafe code.
    TAUTLINE_FUZZ=$target "$fuzz" run --dev --sanitizer none --target-dir target/fuzz "$program" "$corpus/$target" \
        $([ ! -d "$seeds" ] || echo "$seeds") -- -max_total_time="$seconds" -seed=$seed -timeout=20 -rss_limit_mb=4096 \
        -max_len=65536 -print_final_stats=1 || failed="$failed $target"
done
[ -z "$failed" ] || { echo "failing targets:$failed" >&2; exit 1; }
