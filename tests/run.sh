#!/bin/sh
# Sets up and runs tests. From anywhere:
#
#   sh tests/run.sh [arguments of cargo test]   the tests of the crates and of the program
#   sh tests/run.sh --change | --long           the phases of a change, or all
#   sh tests/run.sh --only PHASE...             some phases
#
# CONTRIBUTING.md lists the phases. TAUTLINE_LONG=1 adds random cases, an hour of fuzzing, and the slowest commands of
# the docs.
set -eu
cd "$(dirname "$0")/.."

change="crates ignored bits proofs ci cluster docs readers python"
# These compile all crates again.
all="$change film fuzz mutants"
# The Python package and the fuzz targets have tests of their own.
rust="--workspace --exclude tautline-python --exclude tautline-fuzz"

# The debug build flies the golden scenarios.
crates() {
    # Clippy compiles the examples; here each of them would be linked with the whole tree.
    cargo test $rust --lib --bins --tests
    cargo test $rust --doc
}

ignored() { cargo test $rust --lib --bins --tests -- --ignored; }

# The release build must have the hashes of the debug build.
bits() { cargo test --release -p tautline-sim --test bits; }

# The H.264 encoder, which is not a default feature. The whole workspace is selected here and below: dependencies keep
# the features of the phase `crates` and are not compiled again.
film() { cargo test $rust --features tautline-render/mp4 --lib film; }

# A minute for all fuzz targets, with the same inputs in each run; TAUTLINE_LONG=1 takes an hour, with others.
fuzz() { sh fuzz/run.sh "${TAUTLINE_LONG:+170}"; }

# A mutant of the law and one of the audit, and one that empties sentences, on which no verdict may depend.
# The phase `crates` has shown that their tests pass without them.
mutants() { TAUTLINE_TESTED=yes sh tests/mutants.sh 02-one-over-n 07-sweep-off 11-reasons-without-text; }

# The Python tests below start the debug build of the program.
with_program() {
    cargo build --quiet $rust --bin tautline
    "target/$1/bin/python" -m unittest discover --verbose --start-directory "$2"
}

# The proofs of the contract of the shield, and copies with a defect. Then logs of flights, and changed copies of them.
proofs() {
    sh proofs/check.sh
    cargo build --quiet $rust --bin tautline
    python3 -m unittest discover --verbose --start-directory tests/proofs
}

# The GitHub action, hook and archives, and packages.
ci() { with_program cluster tests/ci; }

cluster() { with_program cluster tests/cluster; }

# Every command of the docs.
docs() {
    cargo build --quiet $rust --example own_law --bin example-shield
    with_program cluster tests/docs
}

# Exported files with the libraries of their formats.
readers() { with_program readers tests/readers; }

# The Python package, in a debug build, with its notebooks. The program of the same sources continues its campaigns.
python() {
    cargo build --quiet $rust --bin tautline
    VIRTUAL_ENV="$PWD/target/python" target/python/bin/maturin develop --manifest-path python/Cargo.toml
    TAUTLINE_NOTEBOOKS=yes target/python/bin/python -m unittest discover --verbose --start-directory tests/python
}

# Runs a phase and prints its processor time.
phase() {
    printf '\n== %s\n' "$1"
    "$1"
    times >"$scratch/times"
    # User and system time of ended children, each as MINUTESmSECONDSs.
    cpu_s=$(awk 'NR == 2 { gsub("s", ""); split($1, user, "m"); split($2, kernel, "m")
        printf "%d", 60 * (user[1] + kernel[1]) + user[2] + kernel[2] }' "$scratch/times")
    echo "$1: $((cpu_s - before_s)) CPU s" | tee -a "$scratch/phases"
    before_s=$cpu_s
}

phases=crates
case ${1:-} in
    --change | --long)
        phases=$change
        [ "$1" = --change ] || phases=$all
        option=$1
        shift
        [ $# = 0 ] || { echo "$option: takes no arguments, got $*" >&2 && exit 2; }
        echo "tests: set-up, build and $phases"
        ;;
    --only)
        shift
        phases=$*
        [ "$phases" ] || { echo "--only: give some of: $all" >&2 && exit 2; }
        for name in $phases; do
            case " $all " in *" $name "*) ;; *) echo "$name: no such phase; give some of: $all" >&2 && exit 2 ;; esac
        done
        set --
        echo "tests: set-up, build and $phases"
        ;;
    *) echo "tests: set-up, build and tests of the crates, some 15 minutes on two cores" ;;
esac
if [ $# != 0 ]; then
    sh tests/setup.sh crates
    case " $* " in
        *" -p "* | *" --package "*) exec cargo test "$@" ;;
        *) exec cargo test $rust "$@" ;;
    esac
fi

scratch=$(mktemp -d)
trap 'cat "$scratch/phases" 2>/dev/null; rm -rf "$scratch"' EXIT
before_s=0
set_up() { sh tests/setup.sh $phases; }
phase set_up
for name in $phases; do phase "$name"; done
printf '\n'
