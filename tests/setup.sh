#!/bin/sh
# Installs the missing requirements of builds and tests, except for the Rust toolchain.
# From anywhere: sh tests/setup.sh [PHASE...]
#
# Without arguments: those of the phase `crates` of tests/run.sh. One tool of each of the phases `ci`, `docs` and `fuzz`
# is built from source. `lint` needs a compiler and Python only.
set -eu
cd "$(dirname "$0")/.."
phases=${*:-crates}

# Returns whether one of these phases is to be set up.
needed_by() {
    for phase; do
        case " $phases " in *" $phase "*) return 0 ;; esac
    done
    return 1
}

has() { command -v "$1" >/dev/null 2>&1; }

# Installs packages of Debian.
debian() {
    sudo=$([ "$(id -u)" = 0 ] || echo sudo)
    $sudo apt-get update
    $sudo apt-get install -y --no-install-recommends "$@"
}

# The C and C++ toolchain, for linking and for the H.264 encoder.
has cc && has c++ || debian gcc g++ libc6-dev

# The interpreter that runs the checkers of proofs and prose.
has python3 || debian python3

if needed_by crates ignored film; then
    # The browser for tests/reports.
    has chromium || debian chromium fonts-dejavu-core

    # The compiler that checks the types of assets/replay.js.
    if ! target/typescript/node_modules/.bin/tsc --version >/dev/null 2>&1; then
        has npm || debian nodejs npm
        mkdir -p target/typescript
        npm install --silent --no-audit --no-fund --prefix target/typescript 'typescript@5'
    fi

    # A software driver if there is no graphics driver, for tests/viewer.
    ls /usr/share/vulkan/icd.d/*.json >/dev/null 2>&1 || ls /etc/vulkan/icd.d/*.json >/dev/null 2>&1 ||
        debian mesa-vulkan-drivers libvulkan1

    # Virtual screen, virtual input and window libraries for tests/window.
    has Xvfb && has xdotool ||
        debian xvfb xdotool libx11-6 libx11-xcb1 libxcursor1 libxi6 libxrandr2 libxkbcommon-x11-0
fi

# The checker of proofs/, and the compiler and integers of proofs/replay.
if needed_by proofs; then
    has coqc && has coqchk || debian coq
    [ -e "$(coqc -where)/user-contrib/Flocq/Version.vo" ] || debian libcoq-flocq
    ls "$(ocamlfind query zarith 2>/dev/null)/zarith.cmxa" >/dev/null 2>&1 ||
        debian ocaml ocaml-findlib libzarith-ocaml-dev
fi

# Builds a program from source into target/FOLDER/bin: tool FOLDER PROGRAM [options of cargo install] NAME@VERSION
# All checkouts of a user share it.
tool() {
    folder=target/$1
    program=$2
    shift 2
    for version; do :; done
    kept=${XDG_CACHE_HOME:-$HOME/.cache}/tautline/$version
    if ! "$kept/bin/$program" --version >/dev/null 2>&1; then
        cargo install --quiet --locked --debug --root "$kept" --target-dir target/tool "$@"
        rm -rf target/tool
    fi
    if [ "$(readlink "$folder")" != "$kept" ]; then
        mkdir -p target
        rm -rf "$folder"
        ln -s "$kept" "$folder"
    fi
}

# The builder of the book, which tests/docs runs.
if needed_by docs; then
    tool mdbook mdbook --no-default-features --features search 'mdbook@0.5.4'
fi

# The checker of licences and versions, which reads the sources of all systems.
if needed_by ci; then
    cargo fetch --quiet --locked
    tool deny cargo-deny --no-default-features 'cargo-deny@0.20.2'
fi

if needed_by fuzz; then
    tool fuzz-tool cargo-fuzz 'cargo-fuzz@0.13.2'
fi

# Creates target/NAME with packages, unless it can import MODULES: environment NAME MODULES PACKAGE...
environment() {
    folder=target/$1
    modules=$2
    shift 2
    if "$folder/bin/python" -c "import $modules" 2>/dev/null; then return; fi
    python3 -c 'import ensurepip, venv' 2>/dev/null || debian python3 python3-venv
    rm -rf "$folder"
    mkdir -p target
    python3 -m venv "$folder"
    if ! "$folder/bin/pip" install --quiet --disable-pip-version-check "$@"; then
        echo "$folder: cannot install $* for $(python3 --version)" >&2
        exit 1
    fi
}

# Ray for tests/cluster, pre-commit and YAML for tests/ci.
if needed_by ci cluster docs; then
    environment cluster 'pre_commit, ray, yaml' 'ray>=2.40,<3' pre-commit pyyaml
fi

# The library that uploads Crazyflie trajectories, for tests/readers. Its other dependencies are not needed.
if needed_by readers; then
    environment readers cflib.crazyflie.mem.trajectory_memory \
        --no-deps cflib==0.1.34 importlib_resources libusb-package 'numpy>=2.2,<3' packaging pyusb
fi

# Build tool of the Python package, and packages for tests/python.
if needed_by ci python; then
    used='cma, duckdb, gymnasium, ipykernel, joblib, matplotlib, maturin, mypy, nbclient, numpy, pandas, pettingzoo'
    environment python "$used, polars, pyarrow, tqdm" \
        'cma>=4,<5' duckdb gymnasium ipykernel joblib 'matplotlib>=3.5' 'maturin>=1.9.4,<2' mypy nbclient \
        'numpy>=1.23' 'pandas>=1.5' pettingzoo polars pyarrow tqdm
fi

# Slurm for tests/cluster, which starts a node.
if needed_by cluster; then
    (PATH="$PATH:/usr/sbin" && has munged && has slurmctld && has slurmd && has sbatch) ||
        debian munge slurmctld slurmd slurm-client
fi
