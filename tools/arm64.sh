#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# arm64.sh: stemvo for 64-bit ARM, cross-compiled: build/arm64/stemvo, its unit tests, and build/arm64/stemvo_VERSION_arm64.deb. The libraries
# are Debian's arm64 packages, unpacked into build/arm64-root; ONNX Runtime is that of PyPI's wheel. Programs run under qemu-aarch64.
# arm64.sh wheel FOLDER: the wheel of the Python package, with all it needs, in FOLDER; tools/wheel.sh must have run (a module's stub is made
# by importing it, which this machine cannot).
# arm64.sh test [FILES]: the package in a root of its own (what it depends on is there, and a clip has the path it has here), and unit tests:
# those of the code in vectors, or FILES of tests/unit ('*': all, which takes half an hour).
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
[[ ${1:-} == test ]] || tools/setup.sh arm64
for program in aarch64-linux-gnu-g++ mmdebstrap qemu-aarch64; do
  command -v "$program" >/dev/null || { echo "arm64.sh: needs $program: tools/setup.sh arm64" && exit 77; }
done

readonly ROOT=build/arm64-root BUILD=build/arm64
readonly LIBRARIES=$ROOT/usr/lib/aarch64-linux-gnu

unpack() { # unpack FOLDER PACKAGE..: packages with all they need, from the release of this machine
  rm -rf "$1"
  # A package that is a file must be under the same name in the new root.
  mmdebstrap --quiet --arch=arm64 --variant=extract --include="$(IFS=, && echo "${*:2}")" \
    --setup-hook='for file in '"$PWD/$BUILD"'/*.deb; do if [ -e "$file" ]; then install -D "$file" "$1$file"; fi; done' "$(. /etc/os-release && echo "$VERSION_CODENAME")" "$1" >build/setup/arm64-root.log 2>&1 ||
    { tail build/setup/arm64-root.log >&2 && return 1; }
}

# The packages' own scripts do not run in a root that is only unpacked: their links are set here. ONNX Runtime asks which processor it runs
# on, and ends where it finds the one that emulates: the emulator shows it this file, of a Raspberry Pi 4.
finish_root() { # finish_root FOLDER
  local name processor
  mkdir -p "$1/proc"
  for ((processor = 0; processor < $(nproc); ++processor)); do
    printf '%s\n' "processor : $processor" "Features : fp asimd evtstrm aes pmull sha1 sha2 crc32 cpuid" "CPU implementer : 0x41" \
      "CPU architecture: 8" "CPU variant : 0x0" "CPU part : 0xd08" "CPU revision : 3" ""
  done >"$1/proc/cpuinfo"
  for name in libblas liblapack; do
    ln -sfn atlas/$name.so "$1/usr/lib/aarch64-linux-gnu/$name.so"
    ln -sfn atlas/$name.so.3 "$1/usr/lib/aarch64-linux-gnu/$name.so.3"
  done
}

make_root() {
  local packages wheel stamp
  packages=$(sed -n '/^PACKAGES=(/,/^)/p' tools/setup.sh | grep -oE 'lib[a-z0-9.-]+-dev|nlohmann-json3-dev' | grep -v benchmark)\ libpython3-dev
  wheel=$(python3 tools/locked.py base | sed -n 's/^\(onnxruntime==[^ ]*\).*/\1/p')
  stamp="$wheel $packages"
  [[ -f $ROOT/stamp && "$(<"$ROOT/stamp")" == "$stamp" ]] && return
  echo "==> Unpacking the arm64 packages into $ROOT"
  # shellcheck disable=SC2086
  unpack "$ROOT" libc6-dev "libstdc++-$(aarch64-linux-gnu-gcc -dumpversion)-dev" $packages
  finish_root "$ROOT"
  sed -i 's#;/usr/lib/aarch64-linux-gnu/#;${CMAKE_SYSROOT}/usr/lib/aarch64-linux-gnu/#g' "$LIBRARIES/cmake/Ceres/CeresTargets.cmake"
  build/venv-base/bin/python -m pip download --quiet --no-deps --require-hashes --only-binary=:all: --platform manylinux_2_28_aarch64 \
    --dest "$ROOT/wheel" --requirement <(python3 tools/locked.py base | sed -n '/^onnxruntime==/,/^[^ ]/{/^onnxruntime\|^ /p}')
  python3 -m zipfile -e "$ROOT"/wheel/onnxruntime-*.whl "$ROOT/wheel"
  mkdir -p "$ROOT/opt/onnxruntime/lib"
  cp "$ROOT"/wheel/onnxruntime/capi/libonnxruntime.so.1.* "$ROOT"/wheel/onnxruntime/{LICENSE,ThirdPartyNotices.txt} "$ROOT/opt/onnxruntime/lib/"
  ln -s "$(basename "$ROOT"/opt/onnxruntime/lib/libonnxruntime.so.1.*)" "$ROOT/opt/onnxruntime/lib/libonnxruntime.so.1"
  ln -s libonnxruntime.so.1 "$ROOT/opt/onnxruntime/lib/libonnxruntime.so"
  rm -rf "$ROOT/wheel"
  echo "$stamp" >"$ROOT/stamp"
}

# A package of one name holds a library of one name on every architecture of a release.
packages_of_libraries() {
  local library
  for library in $(readelf -d "$BUILD/stemvo" "$BUILD"/libstemvo_video.so "$ROOT"/opt/onnxruntime/lib/libonnxruntime.so.1 |
    sed -n 's/.*(NEEDED).*\[\(.*\)\]/\1/p' | grep -v -e onnxruntime -e ld-linux | sort -u); do
    dpkg-query -S "*/$(gcc -print-multiarch)/$library" 2>/dev/null | sed -nE "s#^([a-z0-9.+-]+)[:,].*#\1#p" | head -n 1
  done | sort -u | paste -sd, | sed 's/,/, /g'
}

make_wheel() { # make_wheel FOLDER
  local version tag pip=build/venv-wheel/bin
  version=$("$pip/python" -c 'import sys; print(*sys.version_info[:2], sep=".")')
  tag=cp${version/./}
  install -D "build/python-$tag-$tag-linux_x86_64/python/_core.pyi" "build/python-$tag-$tag-linux_aarch64/python/_core.pyi"
  rm -rf "$BUILD/wheel"
  _PYTHON_HOST_PLATFORM=linux-aarch64 SETUPTOOLS_EXT_SUFFIX=.cpython-${version/./}-aarch64-linux-gnu.so \
    CMAKE_ARGS="--toolchain $PWD/cmake/arm64.cmake -DONNXRUNTIME_ROOT=/opt/onnxruntime -DPython_INCLUDE_DIR=$PWD/$ROOT/usr/include/python$version" \
    "$pip/pip" wheel --quiet --disable-pip-version-check --no-deps --wheel-dir "$BUILD/wheel" --config-settings=build.targets=stemvo_python .
  PATH=$PWD/$pip:$PATH AUDITWHEEL_LD_LIBRARY_PATH=$PWD/$LIBRARIES auditwheel repair --wheel-dir "$1" "$BUILD"/wheel/stemvo-*.whl >build/setup/auditwheel.log 2>&1 ||
    { tail -n 20 build/setup/auditwheel.log >&2 && return 1; }
}

make_root
tests=$([[ ${1:-} != test ]] || echo "${2:-}")
cmake -G Ninja -B "$BUILD" --toolchain cmake/arm64.cmake -D CMAKE_BUILD_TYPE=Release -D ONNXRUNTIME_ROOT=/opt/onnxruntime \
  -D "STEMVO_UNIT_TESTS=${tests:-features_*_test.cpp;unit/geometry_*_test.cpp;unit/stem_*}" -D CMAKE_SKIP_INSTALL_ALL_DEPENDENCY=ON --log-level=WARNING >build/setup/configure-arm64.log 2>&1 || { cat build/setup/configure-arm64.log && exit 1; }
cmake --build "$BUILD" --parallel "$(nproc)" --target stemvo_app stemvo_video
rm -f "$BUILD"/stemvo_*.deb
(cd "$BUILD" && cpack -G DEB -D CPACK_DEBIAN_PACKAGE_ARCHITECTURE=arm64 -D CPACK_DEBIAN_PACKAGE_SHLIBDEPS=OFF \
  -D "CPACK_DEBIAN_PACKAGE_DEPENDS=$(cd - >/dev/null && packages_of_libraries)" >cpack.log) || { cat "$BUILD/cpack.log" && exit 1; }
[[ ${1:-} != wheel ]] || make_wheel "$2"
[[ ${1:-} == test ]] || exit 0

cmake --build "$BUILD" --parallel "$(nproc)" --target stemvo_unit_tests
# A test starts the writer of videos; the emulator passes that on to this machine, so that it must be this machine's.
cp build/release/tests/stemvo_write_video "$BUILD/tests/"
# Ceres' part of this one takes two minutes under the emulator.
GTEST_FILTER=-Bundle.EndsWhereCeresDoes ctest --test-dir "$BUILD" --label-regex unit --exclude-regex portable --timeout 3000 --parallel "$(nproc)" --output-on-failure
readonly INSTALLED=build/arm64-installed
unpack "$INSTALLED" "$PWD"/"$BUILD"/stemvo_*_arm64.deb
finish_root "$INSTALLED"
emulated() { qemu-aarch64 -cpu cortex-a72 -L "$INSTALLED" "$INSTALLED/usr/bin/stemvo" "$@"; }
emulated --version
[[ -n ${STEMVO_SHARED_DATA:-} ]] || { echo "arm64.sh: STEMVO_SHARED_DATA is not set: no clip was run" && exit 0; }
readonly CLIP=$STEMVO_SHARED_DATA/kitti/sequences/06
emulated run "$CLIP" --out "$BUILD/clip"
build/release/stemvo check "$BUILD/clip/metrics.json" --against tests/regression/thresholds/kitti_06_camera_height.yaml
build/release/stemvo run "$CLIP" --out "$BUILD/clip-here"
# Instructions round differently, and what is chosen by a hair may be chosen otherwise.
build/lab/bin/python - "$BUILD"/clip{,-here}/trajectory_kitti.txt <<'PYTHON'
import sys

import numpy

there, here = (numpy.loadtxt(path).reshape(-1, 3, 4)[:, :, 3] for path in sys.argv[1:])
length = numpy.linalg.norm(numpy.diff(here, axis=0), axis=1).sum()
apart = numpy.linalg.norm(there - here, axis=1).max()
print(f"{len(here)} frames, {length:.1f} m: at most {apart:.4f} m apart")
sys.exit(not apart < 0.002 * length)
PYTHON
