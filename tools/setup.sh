#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Everything stemvo needs on a fresh machine: apt packages, ONNX Runtime, plotly.js, a Python environment.
# Safe to repeat; takes about a second when nothing is missing. Called by `make build`; `setup.sh cluster` adds Ray,
# `setup.sh peers` what `make bench` compares with, `setup.sh browser` Chromium for a test of `make test-all`,
# `setup.sh fuzz` clang for tools/fuzz.sh, `setup.sh coverage` gcovr for tools/coverage.sh, `setup.sh docs` what `make docs` needs, `setup.sh lint` clang-tidy,
# `setup.sh root` debootstrap for a test of `make test-all`.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

readonly LOGS=build/setup
readonly VENV=build/venv
readonly ORT_DIR=third_party/onnxruntime/lib
readonly PLOTLY_DIR=third_party/plotly

# docs/dependencies.md says why each is here.
PACKAGES=(
  build-essential cmake ninja-build pkg-config ccache git ca-certificates file
  libopencv-dev libeigen3-dev libceres-dev libtbb-dev libyaml-cpp-dev libcli11-dev libfmt-dev
  nlohmann-json3-dev libdeflate-dev libturbojpeg0-dev libpng-dev libcereal-dev libssl-dev
  libgtest-dev libgmock-dev libbenchmark-dev python3 python3-venv python3-dev
)

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

missing_packages() {
  local installed
  installed=$(dpkg-query -W -f='${db:Status-Status} ${Package}\n' "${PACKAGES[@]}" 2>/dev/null |
    sed -n 's/^installed //p' || true)
  comm -23 <(printf '%s\n' "${PACKAGES[@]}" | sort -u) <(sort -u <<<"$installed")
}

install_packages() {
  [[ -n "${STEMVO_SKIP_APT:-}" ]] && return
  local missing as_root=()
  mapfile -t missing < <(missing_packages)
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

pip_failed() { # pip_failed WHAT LOG
  network_failed "$2" && die "no network: pip could not fetch $1 (log: $2)"
  die "pip could not fetch $1: $(grep -m1 -E '^ *ERROR' "$2" || echo unknown) (log: $2)"
}

# make_venv FOLDER LOG REQUIREMENTS..
make_venv() {
  local venv=$1 log=$2 python wanted
  shift 2
  # The path is part of it because scripts of an environment hold it.
  wanted="$PWD $(cat "$@" | sha256sum)"
  if [[ -f $venv/stamp && "$(<"$venv/stamp")" == "$wanted" ]] && "$venv/bin/python" -c '' 2>/dev/null; then
    return
  fi
  python=$(find_python)
  say "Making the Python environment $venv (log: $log)"
  rm -rf "$venv"
  "$python" -m venv "$venv" >"$log" 2>&1 || die "'$python -m venv $venv' failed (log: $log)"
  "$venv/bin/python" -m pip install --disable-pip-version-check --no-input --only-binary=:all: \
    --require-hashes "${@/#/--requirement=}" </dev/null >>"$log" 2>&1 ||
    pip_failed "the Python packages" "$log"
  echo "$wanted" >"$venv/stamp"
}

# fetch_wheel NAME VERSION SHA256 PIP_OPTION..: unpacked to $LOGS/NAME
fetch_wheel() {
  local name=$1 version=$2 sha256=$3 wheel
  shift 3
  rm -rf "${LOGS:?}/$name"
  mkdir -p "$LOGS/$name"
  "$VENV/bin/python" -m pip download --disable-pip-version-check --no-input --no-deps --only-binary=:all: "$@" \
    --dest "$LOGS/$name" "$name==$version" </dev/null >"$LOGS/$name.log" 2>&1 || pip_failed "$name==$version" "$LOGS/$name.log"
  wheel=$(echo "$LOGS/$name"/*.whl)
  [[ "$(sha256sum <"$wheel")" == "$sha256  -" ]] ||
    die "$wheel: expected SHA256 $sha256, found $(sha256sum <"$wheel" | cut -d' ' -f1)"
  "$VENV/bin/python" -m zipfile -e "$wheel" "$LOGS/$name"
}

# is_whole STAMP SHA256_OF_WHEEL
is_whole() {
  grep -qsF "# wheel $2" "$1" && (cd "$(dirname "$1")" && sha256sum --check --status SHA256SUMS)
}

# Only the library inside the wheel is used, so one Python tag serves every Python.
install_onnxruntime() {
  local version=1.31.1 sha256 stamp=$ORT_DIR/SHA256SUMS
  case "$(uname -m)" in
    x86_64) sha256=74a6a52994616c4d18b33db1e13c226333a70a6ba07480a5cab9c2a50dff1430 ;;
    aarch64) sha256=dcaedc50333876f3829ab966b242147f0e548229e29c36fe44622ecf748c25ee ;;
  esac
  is_whole "$stamp" "$sha256" && return
  say "Fetching ONNX Runtime $version to $ORT_DIR (log: $LOGS/onnxruntime.log)"
  rm -rf "$ORT_DIR"
  mkdir -p "$ORT_DIR"
  fetch_wheel onnxruntime "$version" "$sha256" \
    --platform "manylinux_2_28_$(uname -m)" --python-version 3.13 --implementation cp --abi cp313
  cp "$LOGS"/onnxruntime/onnxruntime/capi/libonnxruntime.so.* "$ORT_DIR/"
  cp "$LOGS"/onnxruntime/onnxruntime/{LICENSE,ThirdPartyNotices.txt} "$ORT_DIR/"
  ln -sf "libonnxruntime.so.$version" "$ORT_DIR/libonnxruntime.so.1"
  rm -rf "$LOGS/onnxruntime"
  (cd "$ORT_DIR" && { echo "# wheel $sha256"; sha256sum libonnxruntime.so.1 "libonnxruntime.so.$version"; } >SHA256SUMS.new)
  mv "$ORT_DIR/SHA256SUMS.new" "$stamp"
}

# plotly.js, which report.html draws with: the wheel of plotly.py holds it.
install_plotly() {
  local version=6.5.0 sha256=5ac851e100367735250206788a2b1325412aa4a4917a4fe3e6f0bc5aa6f3d90a stamp=$PLOTLY_DIR/SHA256SUMS
  is_whole "$stamp" "$sha256" && return
  say "Fetching plotly.js of plotly $version to $PLOTLY_DIR (log: $LOGS/plotly.log)"
  rm -rf "$PLOTLY_DIR"
  mkdir -p "$PLOTLY_DIR"
  fetch_wheel plotly "$version" "$sha256"
  gzip -9 -n -c "$LOGS/plotly/plotly/package_data/plotly.min.js" >"$PLOTLY_DIR/plotly.min.js.gz"
  cp "$LOGS/plotly/plotly-$version.dist-info/licenses/LICENSE.txt" "$PLOTLY_DIR/"
  rm -rf "$LOGS/plotly"
  (cd "$PLOTLY_DIR" && { echo "# wheel $sha256"; sha256sum plotly.min.js.gz LICENSE.txt; } >SHA256SUMS.new)
  mv "$PLOTLY_DIR/SHA256SUMS.new" "$stamp"
}

# Ray, for searches on a cluster and their test: an environment of its own, which nothing else needs.
if [[ "${1:-}" == cluster ]]; then
  mkdir -p "$LOGS"
  make_venv build/venv-ray "$LOGS/venv-ray.log" tools/requirements-ray.txt
  exit
fi
# OpenCV's Python package, for the program that the benchmark compares with.
if [[ "${1:-}" == peers ]]; then
  mkdir -p "$LOGS"
  make_venv build/venv-peers "$LOGS/venv-peers.log" tools/requirements-peers.txt
  exit
fi

# Chromium, driven by Playwright, for the test that looks at report.html.
if [[ "${1:-}" == browser ]]; then
  mkdir -p "$LOGS"
  PACKAGES=(chromium)
  install_packages
  make_venv build/venv-browser "$LOGS/venv-browser.log" tools/requirements-browser.txt
  exit
fi

# clang with libFuzzer: another compiler than the program's.
if [[ "${1:-}" == fuzz ]]; then
  mkdir -p "$LOGS"
  PACKAGES=(clang-16 libclang-rt-16-dev)
  install_packages
  exit
fi
# An empty Debian, for the test that installs the package there.
if [[ "${1:-}" == root ]]; then
  mkdir -p "$LOGS"
  PACKAGES=(debootstrap)
  install_packages
  exit
fi
# What puts the system's libraries into a wheel.
if [[ "${1:-}" == wheel ]]; then
  mkdir -p "$LOGS"
  make_venv build/venv-wheel "$LOGS/venv-wheel.log" tools/requirements-wheel.txt
  exit
fi
if [[ "${1:-}" == lint ]]; then
  mkdir -p "$LOGS"
  make_venv build/venv-lint "$LOGS/venv-lint.log" tools/requirements-lint.txt
  exit
fi
# What others measure trajectories with.
if [[ "${1:-}" == evo ]]; then
  mkdir -p "$LOGS"
  make_venv build/venv-evo "$LOGS/venv-evo.log" tools/requirements-evo.txt
  exit
fi
# The generators of the site.
if [[ "${1:-}" == docs ]]; then
  mkdir -p "$LOGS"
  PACKAGES=(doxygen)
  install_packages
  make_venv build/venv-docs "$LOGS/venv-docs.log" tools/requirements-docs.txt
  exit
fi
if [[ "${1:-}" == coverage ]]; then
  mkdir -p "$LOGS"
  make_venv build/venv-coverage "$LOGS/venv-coverage.log" tools/requirements-coverage.txt
  exit
fi

mkdir -p "$LOGS" "$ORT_DIR" "$PLOTLY_DIR" 2>/dev/null && [[ -w $LOGS && -w $ORT_DIR && -w $PLOTLY_DIR ]] ||
  die "$PWD/build and $PWD/third_party must be writable: they may belong to root from an earlier 'sudo make'"
check_system
install_packages
check_toolchain
make_venv "$VENV" "$LOGS/venv.log" tools/requirements.txt tools/requirements-format.txt
install_onnxruntime
install_plotly
