#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# setup.sh [GROUP..]: what a group needs on a fresh machine: apt packages, and a Python environment of the group of that name in
# pyproject.toml. Without a group: what `make build` needs, ONNX Runtime and plotly.js too; `lab`, `tex` and `tools` add what `make test` needs.
# Safe to repeat; takes about a second when nothing is missing.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

readonly LOGS=build/setup
readonly BASE_VENV=build/venv-base
readonly ORT_DIR=third_party/onnxruntime/lib
readonly PLOTLY_DIR=third_party/plotly

# docs/dependencies.md says why each is here.
PACKAGES=(
  build-essential cmake ninja-build pkg-config ccache git ca-certificates file
  libopencv-dev libeigen3-dev libceres-dev libtbb-dev libyaml-cpp-dev libcli11-dev libfmt-dev
  nlohmann-json3-dev libspng-dev libturbojpeg0-dev libssl-dev
  libgtest-dev libgmock-dev libbenchmark-dev python3 python3-venv python3-dev
)

# Group, its environment, apt packages.
readonly TABLE="\
arm64     -                    g++-aarch64-linux-gnu mmdebstrap qemu-user
browser   build/venv-browser   chromium
coverage  build/venv-coverage
docs      build/venv-docs      doxygen
fuzz      -                    clang-16 libclang-rt-16-dev
lab       build/lab
lint      build/venv-lint
peers     build/venv-peers
root      -                    debootstrap
tex       -                    texlive-latex-recommended
tools     build/venv
wheel     build/venv-wheel"

say() { printf '==> %s\n' "$*"; }
die() {
  printf 'setup: %s\n' "$*" >&2
  exit 1
}

# The last lines of a log that name a dead network, whichever client wrote it.
network_failed() {
  grep -qiE 'could not resolve|temporary failure|unable to connect|cannot initiate the connection|failed to establish|connection (refused|timed out|reset|failed)|connecttimeout|read timed out|network is unreachable|name or service not known|max retries' "$@"
}

check_system() {
  local id="unknown" version=""
  if [[ -r /etc/os-release ]]; then
    id=$(. /etc/os-release && echo "${ID:-unknown}")
    version=$(. /etc/os-release && echo "${VERSION_ID:-}")
  fi
  case "$id-$version" in
    debian-12 | debian-13 | ubuntu-24.04) ;;
    *)
      [[ -n "${STEMVO_SKIP_APT:-}" ]] && return
      die "expected Debian 12, Debian 13 or Ubuntu 24.04, found '$id $version': install the equivalents of these packages, then repeat with STEMVO_SKIP_APT=1: ${PACKAGES[*]}"
      ;;
  esac
  case "$(uname -m)" in
    x86_64 | aarch64) ;;
    *) die "expected an x86_64 or aarch64 machine, found $(uname -m): ONNX Runtime has no library for it" ;;
  esac
}

missing_packages() { # missing_packages PACKAGE..
  local installed
  installed=$(dpkg-query -W -f='${db:Status-Status} ${Package}\n' "$@" 2>/dev/null |
    sed -n 's/^installed //p' || true)
  comm -23 <(printf '%s\n' "$@" | sort -u) <(sort -u <<<"$installed")
}

install_packages() { # install_packages [PACKAGE..]
  [[ -n "${STEMVO_SKIP_APT:-}" || $# == 0 ]] && return
  local missing as_root=()
  mapfile -t missing < <(missing_packages "$@")
  ((${#missing[@]} == 0)) && return
  local by_hand="run as root: apt-get update && apt-get install ${missing[*]}"
  if ((EUID != 0)); then
    command -v sudo >/dev/null || die "packages are missing, you are not root and there is no sudo; $by_hand"
    # Without a terminal sudo cannot ask for a password.
    if [[ -t 0 ]]; then sudo -v || die "packages are missing and sudo refused; $by_hand"
    else sudo -n true 2>/dev/null || die "packages are missing and sudo wants a password; $by_hand"; fi
    as_root=(sudo)
  fi
  as_root+=(env DEBIAN_FRONTEND=noninteractive apt-get -o DPkg::Lock::Timeout=300)
  say "Installing ${#missing[@]} apt packages (log: $LOGS/apt.log): ${missing[*]}"
  # A broken third-party source must not stop us: only the install decides.
  "${as_root[@]}" update </dev/null >"$LOGS/apt.log" 2>&1 || true
  if ! "${as_root[@]}" install -y --no-install-recommends "${missing[@]}" </dev/null >>"$LOGS/apt.log" 2>&1; then
    network_failed "$LOGS/apt.log" && die "no network: apt-get could not fetch the packages (log: $LOGS/apt.log)"
    die "apt-get install failed: $(grep -m1 '^E:' "$LOGS/apt.log" || echo unknown) (log: $LOGS/apt.log)"
  fi
}

# version_at_least FOUND NEEDED
version_at_least() { [[ "$(printf '%s\n%s\n' "$2" "$1" | sort -V | head -n1)" == "$2" ]]; }

check_toolchain() {
  local cxx=${CXX:-g++} needed=12 found
  # CXX may carry a launcher or flags ("ccache g++"): ask it as it is.
  # shellcheck disable=SC2086
  found=$($cxx -dumpfullversion -dumpversion 2>/dev/null) || die "no C++ compiler: '$cxx' does not run"
  # shellcheck disable=SC2086
  $cxx --version | grep -qi clang && needed=16
  version_at_least "$found" "$needed" || die "compiler too old: '$cxx' is version $found, needed $needed or newer (set CXX)"
  found=$(cmake --version 2>/dev/null | sed -n '1s/[^0-9]*//p') || true
  [[ -n "$found" ]] || die "cmake does not run"
  version_at_least "$found" 3.25 || die "cmake too old: $(command -v cmake) is version $found, needed 3.25 or newer"
}

# The first Python that the pinned wheels exist for and that can make environments.
find_python() {
  local python
  for python in python3 /usr/bin/python3; do
    if "$python" -c 'import sys, ensurepip, venv; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 14))' 2>/dev/null; then
      echo "$python"
      return
    fi
  done
  die "no Python 3.11 to 3.14 with the venv module: expected python3 on PATH or /usr/bin/python3 to be one"
}

make_venv() { # make_venv GROUP FOLDER
  local venv=$2 log=$LOGS/${2##*/}.log python requirements wanted
  python=$(find_python)
  requirements=$("$python" tools/locked.py "$1")
  # The path is part of it because scripts of an environment hold it.
  wanted="$PWD $(sha256sum <<<"$requirements")"
  if [[ -f $venv/stamp && "$(<"$venv/stamp")" == "$wanted" ]] && "$venv/bin/python" -c '' 2>/dev/null; then
    return
  fi
  say "Making the Python environment $venv (log: $log)"
  rm -rf "$venv"
  "$python" -m venv "$venv" >"$log" 2>&1 || die "'$python -m venv $venv' failed (log: $log)"
  # Not compiled: most modules are never imported.
  if ! "$venv/bin/python" -m pip install --disable-pip-version-check --no-input --no-compile --only-binary=:all: \
    --require-hashes --requirement <(echo "$requirements") </dev/null >>"$log" 2>&1; then
    network_failed "$log" && die "no network: pip could not fetch the Python packages (log: $log)"
    die "pip could not fetch the Python packages: $(grep -m1 -E '^ *ERROR' "$log" || echo unknown) (log: $log)"
  fi
  echo "$wanted" >"$venv/stamp"
}

# The library of the wheel is the same for every Python, and serves any program.
install_onnxruntime() {
  local package library
  package=$(echo "$BASE_VENV"/lib/python3.*/site-packages/onnxruntime)
  library=$(basename "$package"/capi/libonnxruntime.so.1.*)
  cmp --silent "$package/capi/$library" "$ORT_DIR/$library" && return
  rm -f "$ORT_DIR"/*
  cp "$package"/{LICENSE,ThirdPartyNotices.txt} "$ORT_DIR/"
  ln -s "$library" "$ORT_DIR/libonnxruntime.so.1"
  cp "$package/capi/$library" "$ORT_DIR/"
}

# plotly.js, which report.html draws with: the wheel of plotly.py holds it.
install_plotly() {
  local packages
  packages=$(echo "$BASE_VENV"/lib/python3.*/site-packages)
  [[ $PLOTLY_DIR/plotly.min.js.gz -nt $BASE_VENV/stamp ]] && return
  cp "$packages"/plotly-*.dist-info/licenses/LICENSE.txt "$PLOTLY_DIR/"
  gzip -9 -n -c "$packages/plotly/package_data/plotly.min.js" >"$PLOTLY_DIR/new"
  mv "$PLOTLY_DIR/new" "$PLOTLY_DIR/plotly.min.js.gz"
}

# `stemvo-lab` in build/lab: compiled where the sources changed, its Python read from the checkout.
install_lab() {
  local log=$LOGS/lab-package.log
  say "Building the Python package (log: $log)"
  build/lab/bin/python -m pip install --disable-pip-version-check --no-input --no-deps --no-build-isolation --editable . </dev/null >"$log" 2>&1 ||
    die "the Python package did not build (log: $log)"
}

set_up_group() { # set_up_group GROUP
  local row venv packages
  row=$(awk -v group="$1" '$1 == group' <<<"$TABLE")
  [[ -n "$row" ]] || die "expected a group of$(awk '{ printf " %s", $1 }' <<<"$TABLE"), found '$1'"
  read -r _ venv packages <<<"$row"
  # shellcheck disable=SC2086
  install_packages $packages
  [[ $venv == - ]] || make_venv "$1" "$venv"
  [[ $1 != lab ]] || install_lab
}

set_up_base() {
  mkdir -p "$ORT_DIR" "$PLOTLY_DIR" 2>/dev/null && [[ -w $LOGS && -w $ORT_DIR && -w $PLOTLY_DIR ]] ||
    die "$PWD/build and $PWD/third_party must be writable: they may belong to root from an earlier 'sudo make'"
  check_system
  install_packages "${PACKAGES[@]}"
  check_toolchain
  make_venv base "$BASE_VENV"
  install_onnxruntime
  install_plotly
}

mkdir -p "$LOGS" 2>/dev/null || true
(($# > 0)) || set_up_base
for group in "$@"; do set_up_group "$group"; done
