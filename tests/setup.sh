#!/bin/sh
# Installs what building and testing need beside the Rust toolchain, where it is not there. From anywhere:
# sh tests/setup.sh
set -eu
cd "$(dirname "$0")/.."

# The C and C++ toolchain that linking and the H.264 encoder need; everything else comes with cargo.
if ! command -v cc >/dev/null 2>&1 || ! command -v c++ >/dev/null 2>&1; then
    sudo=$([ "$(id -u)" = 0 ] || echo sudo)
    $sudo apt-get update
    $sudo apt-get install -y --no-install-recommends gcc g++ libc6-dev
fi

# The browser that tests/reports opens reports in.
if ! command -v chromium >/dev/null 2>&1; then
    sudo=$([ "$(id -u)" = 0 ] || echo sudo)
    $sudo apt-get update
    $sudo apt-get install -y --no-install-recommends chromium fonts-dejavu-core
fi

# The compiler that checks the types of the script of replays.
if ! target/typescript/node_modules/.bin/tsc --version >/dev/null 2>&1; then
    if ! command -v npm >/dev/null 2>&1; then
        sudo=$([ "$(id -u)" = 0 ] || echo sudo)
        $sudo apt-get update
        $sudo apt-get install -y --no-install-recommends nodejs npm
    fi
    mkdir -p target/typescript
    npm install --silent --no-audit --no-fund --prefix target/typescript 'typescript@5'
fi

# The builder of the book, which tests/docs runs.
if ! target/mdbook/bin/mdbook --version >/dev/null 2>&1; then
    cargo install --quiet --locked --debug --no-default-features --features search --root target/mdbook \
        --target-dir target/mdbook/build 'mdbook@0.5.4'
    rm -rf target/mdbook/build
fi

# A driver in software where no graphics driver is installed: tests/viewer fails without one.
if ! ls /usr/share/vulkan/icd.d/*.json >/dev/null 2>&1 && ! ls /etc/vulkan/icd.d/*.json >/dev/null 2>&1; then
    sudo=$([ "$(id -u)" = 0 ] || echo sudo)
    $sudo apt-get update
    $sudo apt-get install -y --no-install-recommends mesa-vulkan-drivers libvulkan1
fi

# The screen, the hand and the libraries of windows that tests/window needs.
if ! command -v Xvfb >/dev/null 2>&1 || ! command -v xdotool >/dev/null 2>&1; then
    sudo=$([ "$(id -u)" = 0 ] || echo sudo)
    $sudo apt-get update
    $sudo apt-get install -y --no-install-recommends xvfb xdotool libx11-6 libx11-xcb1 libxcursor1 libxi6 libxrandr2 \
        libxkbcommon-x11-0
fi

# A virtual environment below target/ that can import MODULES, with PACKAGES: environment NAME MODULES PACKAGE...
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
        echo "$folder needs $*, which cannot be installed for $(python3 --version) here" >&2
        exit 1
    fi
}

# Ray, for tests/cluster; and what reads hooks, for tests/ci.
environment cluster 'pre_commit, ray, yaml' 'ray>=2.40,<3' pre-commit pyyaml

# What builds the Python package, and what tests/python runs it with.
environment python 'gymnasium, ipykernel, matplotlib, maturin, mypy, nbclient, numpy, pandas, pettingzoo, pyarrow' \
    gymnasium ipykernel 'matplotlib>=3.5' 'maturin>=1.9.4,<2' mypy nbclient 'numpy>=1.23' 'pandas>=1.5' pettingzoo pyarrow

# Slurm, of which tests/cluster starts a node of its own.
if ! (PATH="$PATH:/usr/sbin" && command -v munged && command -v slurmctld && command -v slurmd && command -v sbatch) >/dev/null; then
    sudo=$([ "$(id -u)" = 0 ] || echo sudo)
    $sudo apt-get update
    $sudo apt-get install -y --no-install-recommends munge slurmctld slurmd slurm-client
fi
