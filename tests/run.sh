#!/bin/sh
# Sets up and runs the tests of the Rust crates. From anywhere: sh tests/run.sh [--long] [arguments of cargo test]
#
# --long adds the rest: ignored tests, release bits, MP4 films, fuzz targets, three of tests/mutants, packages,
# clusters, exported files, the Python package and the commands of the docs. TAUTLINE_LONG=1 adds random cases, an hour
# of fuzzing, and the slowest commands of the docs.
set -eu
cd "$(dirname "$0")/.."

long=
if [ "${1:-}" = --long ]; then
    long=yes
    shift
fi

if [ "$long" ]; then
    echo "tests: set-up, build and all tests, some 50 minutes on two cores"
else
    echo "tests: set-up, build and tests of the crates, some 20 minutes on two cores"
fi
sh tests/setup.sh ${long:+--long}

# The debug build flies the golden scenarios; with --long the release build must have the same hashes.
arguments=$#
if [ "$long" ]; then
    case " $* " in *" -- "*) set -- "$@" --include-ignored ;; *) set -- "$@" -- --include-ignored ;; esac
fi
# The Python package and the fuzz targets have tests of their own.
case " $* " in
    *" -p "* | *" --package "*) cargo test "$@" ;;
    *) cargo test --workspace --exclude tautline-python --exclude tautline-fuzz "$@" ;;
esac
if [ "$arguments" != 0 ] || [ ! "$long" ]; then exit; fi

cargo test --release -p tautline-sim --test bits
# The H.264 encoder, which is not a default feature.
cargo test -p tautline-render --features mp4 film
# A minute for all fuzz targets, with the same inputs in each run; TAUTLINE_LONG=1 takes an hour, with others.
sh fuzz/run.sh "${TAUTLINE_LONG:+170}"
# A mutant of the law and one of the audit, and one that empties sentences, on which no verdict may depend.
sh tests/mutants.sh 03-a22 07-sweep-off 11-reasons-without-text

# With the debug build: the GitHub action, hook and archives, clusters, every command of the docs.
for tests in tests/ci tests/cluster tests/docs; do
    target/cluster/bin/python -m unittest discover --verbose --start-directory "$tests"
done

# Exported files with the libraries of their formats.
target/readers/bin/python -m unittest discover --verbose --start-directory tests/readers

# The Python package, in a debug build, with its notebooks.
VIRTUAL_ENV="$PWD/target/python" target/python/bin/maturin develop --manifest-path python/Cargo.toml
TAUTLINE_NOTEBOOKS=yes target/python/bin/python -m unittest discover --verbose --start-directory tests/python
