#!/bin/sh
# Installs the missing requirements of builds and tests, except for the Rust toolchain.
# From anywhere: sh tests/setup.sh [--long]
#
# --long adds those of `tests/run.sh --long`. Three of its tools are built from source.
set -eu
cd "$(dirname "$0")/.."

# The C and C++ toolchain, for linking and for the H.264 encoder.
if ! command -v cc >/dev/null 2>&1 || ! command -v c++ >/dev/null 2>&1; then
    sudo=$([ "$(id -u)" = 0 ] || echo sudo)
    $sudo apt-get update
    $sudo apt-get install -y --no-install-recommends gcc g++ libc6-dev
fi

# The interpreter that runs the checker of proofs.
if ! command -v python3 >/dev/null 2>&1; then
    sudo=$([ "$(id -u)" = 0 ] || echo sudo)
    $sudo apt-get update
    $sudo apt-get install -y --no-install-recommends python3
fi

# The browser for tests/reports.
if ! command -v chromium >/dev/null 2>&1; then
    sudo=$([ "$(id -u)" = 0 ] || echo sudo)
    $sudo apt-get update
    $sudo apt-get install -y --no-install-recommends chromium fonts-dejavu-core
fi

# The compiler that checks the types of assets/replay.js.
if ! target/typescript/node_modules/.bin/tsc --version >/dev/null 2>&1; then
    if ! command -v npm >/dev/null 2>&1; then
        sudo=$([ "$(id -u)" = 0 ] || echo sudo)
        $sudo apt-get update
        $sudo apt-get install -y --no-install-recommends nodejs npm
    fi
    mkdir -p target/typescript
    npm install --silent --no-audit --no-fund --prefix target/typescript 'typescript@5'
fi

# A software driver if there is no graphics driver, for tests/viewer.
if ! ls /usr/share/vulkan/icd.d/*.json >/dev/null 2>&1 && ! ls /etc/vulkan/icd.d/*.json >/dev/null 2>&1; then
    sudo=$([ "$(id -u)" = 0 ] || echo sudo)
    $sudo apt-get update
    $sudo apt-get install -y --no-install-recommends mesa-vulkan-drivers libvulkan1
fi

# Virtual screen, virtual input and window libraries for tests/window.
if ! command -v Xvfb >/dev/null 2>&1 || ! command -v xdotool >/dev/null 2>&1; then
    sudo=$([ "$(id -u)" = 0 ] || echo sudo)
    $sudo apt-get update
    $sudo apt-get install -y --no-install-recommends xvfb xdotool libx11-6 libx11-xcb1 libxcursor1 libxi6 libxrandr2 \
        libxkbcommon-x11-0
fi

if [ "${1:-}" != --long ]; then exit; fi

# The builder of the book, which tests/docs runs.
if ! target/mdbook/bin/mdbook --version >/dev/null 2>&1; then
    cargo install --quiet --locked --debug --no-default-features --features search --root target/mdbook \
        --target-dir target/mdbook/build 'mdbook@0.5.4'
    rm -rf target/mdbook/build
fi

# The checker of licences and versions, which reads the sources of all systems, and the fuzzer.
cargo fetch --quiet --locked
if ! target/deny/bin/cargo-deny --version >/dev/null 2>&1; then
    cargo install --quiet --locked --debug --no-default-features --root target/deny --target-dir target/deny/build \
        'cargo-deny@0.20.2'
    rm -rf target/deny/build
fi
if ! target/fuzz-tool/bin/cargo-fuzz --version >/dev/null 2>&1; then
    cargo install --quiet --locked --debug --root target/fuzz-tool --target-dir target/fuzz-tool/build \
        'cargo-fuzz@0.13.2'
    rm -rf target/fuzz-tool/build
fi

# Creates target/NAME with packages, unless it can import MODULES: environment NAME MODULES PACKAGE...
environment() {
    folder=target/$1
    modules=$2
    shift 2
    if "$folder/bin/python" -c "import $modules" 2>/dev/null; then return; fi
    if ! python3 -c 'import ensurepip, venv' 2>/dev/null; then
        sudo=$([ "$(id -u)" = 0 ] || echo sudo)
        $sudo apt-get update
        $sudo apt-get install -y --no-install-recommends python3 python3-venv
    fi
    rm -rf "$folder"
    mkdir -p target
    python3 -m venv "$folder"
    if ! "$folder/bin/pip" install --quiet --disable-pip-version-check "$@"; then
        echo "$folder: cannot install $* for $(python3 --version)" >&2
        exit 1
    fi
}

# Ray for tests/cluster, pre-commit and YAML for tests/ci.
environment cluster 'pre_commit, ray, yaml' 'ray>=2.40,<3' pre-commit pyyaml

# The library that uploads Crazyflie trajectories, for tests/readers. Its other dependencies are not needed.
environment readers cflib.crazyflie.mem.trajectory_memory \
    --no-deps cflib==0.1.34 importlib_resources libusb-package 'numpy>=2.2,<3' packaging pyusb

# Build tool of the Python package, and packages for tests/python.
environment python \
    'cma, gymnasium, ipykernel, joblib, matplotlib, maturin, mypy, nbclient, numpy, pandas, pettingzoo, pyarrow' \
    'cma>=4,<5' gymnasium ipykernel joblib 'matplotlib>=3.5' 'maturin>=1.9.4,<2' mypy nbclient 'numpy>=1.23' \
    'pandas>=1.5' pettingzoo pyarrow

# Slurm for tests/cluster, which starts a node.
if ! (PATH="$PATH:/usr/sbin" && command -v munged && command -v slurmctld && command -v slurmd && command -v sbatch) \
    >/dev/null; then
    sudo=$([ "$(id -u)" = 0 ] || echo sudo)
    $sudo apt-get update
    $sudo apt-get install -y --no-install-recommends munge slurmctld slurmd slurm-client
fi
