#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# clean_root.sh BUILD: in an empty root of this machine's release, what README says, word for word: the wheel with the pages' Python; the Debian
# package, with a video, folders of EuRoC's and TUM's layout and a bag; the C++ program with CMake. apt removes the package, nothing of it stays.
# The wheel is the one in build/wheel (tools/wheel.sh; CTest makes it first). Ends with 77 (skipped) without root or debootstrap (tools/setup.sh root); without pip's network there is no Python and no bag.
set -euo pipefail

readonly BUILD=$1 WORK=$1/package_clean_root
readonly ROOT=$WORK/root
SOURCE=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
readonly SOURCE HOME_DIR=$ROOT/home/someone

if ((EUID != 0)) || ! command -v debootstrap >/dev/null; then
  echo "clean_root: needs root and debootstrap"
  exit 77
fi
mapfile -t PIP < <(env | grep '^PIP_' || true)
PIP+=(PIP_NO_COMPILE=1)  # most modules are never imported
inside() { chroot "$ROOT" /usr/bin/env -i "${PIP[@]}" PATH=/usr/sbin:/usr/bin:/sbin:/bin LANG=C.UTF-8 DEBIAN_FRONTEND=noninteractive "$@" </dev/null; }
as_someone() { inside su someone -c "cd && $*"; }
install() { inside apt-get install -y --no-install-recommends "$@" >"$WORK/apt.log" 2>&1 || { tail "$WORK/apt.log"; exit 1; }; }
pages() { PYTHONPATH=$SOURCE/tests/python python3 -c "import documented
for block in documented.blocks('$1'):
    if block.place.startswith('$2'): print(block.text)"; }
expect_file() { [[ -s $ROOT$1 ]] || { echo "expected $1, found none"; exit 1; }; }
remove() {
  ! mountpoint --quiet "$ROOT/proc" || umount "$ROOT/proc"
  rm -rf --one-file-system "$WORK"
}

make_root() {
  local release components
  release=$(. /etc/os-release && echo "$VERSION_CODENAME")
  components=$(. /etc/os-release && [[ $ID == ubuntu ]] && echo main,universe || echo main)
  debootstrap --variant=minbase --components="$components" "$release" "$ROOT" >"$WORK/debootstrap.log" || { tail "$WORK/debootstrap.log"; exit 1; }
  cp -r /etc/apt/apt.conf.d /etc/apt/apt.conf "$ROOT/etc/apt/" 2>/dev/null || true  # a proxy, where there is one
  cp /etc/resolv.conf /etc/hosts "$ROOT/etc/"
  cp /etc/pip.conf "$ROOT/etc/" 2>/dev/null || true
  echo force-unsafe-io >"$ROOT/etc/dpkg/dpkg.cfg.d/unsafe"  # this root is removed anyway: no wait for the disk
  mount -t proc proc "$ROOT/proc"  # by which the loader knows where the program is
  inside apt-get update >/dev/null
  inside useradd --create-home someone
  "$BUILD/stemvo" synth "$HOME_DIR/drive" --frames 12 --width 620 --height 188 --json >/dev/null
  "$BUILD/stemvo" synth "$HOME_DIR/car" --frames 4 --json >/dev/null  # of the size in README's program
  inside chown -R someone /home/someone
}

# The wheel, without the package's libraries; it makes the recordings.
try_python() {
  echo "==> Python"
  install python3 python3-venv libx11-6
  cp /etc/ssl/certs/ca-certificates.crt "$ROOT/etc/ssl/certs/" 2>/dev/null || true  # a proxy's too
  as_someone python3 -m venv venv
  if ! as_someone venv/bin/pip download --quiet --no-deps --dest reached pillow 2>"$WORK/pip.log"; then
    echo "clean_root: pip reaches nothing: no Python, video, EuRoC, TUM or bag is tried: $(tail -n 1 "$WORK/pip.log")"
    left_out=1
    return
  fi
  cp "$SOURCE"/build/wheel/stemvo-*manylinux*.whl "$SOURCE/"{tests/package/make_recordings,tests/python/bags,python/stemvo/bag,python/stemvo/result_bag}.py "$HOME_DIR/"
  as_someone 'venv/bin/pip install --quiet "$(echo stemvo-*.whl)[bag,video]"'
  as_someone venv/bin/python make_recordings.py .
  pages python docs/python.md >"$HOME_DIR/pages.py"
  as_someone venv/bin/python -I pages.py
  as_someone venv/bin/python -m stemvo.bag drive.bag bag
}

try_package() {
  echo "==> Package"
  cpack -G DEB --config "$BUILD/CPackConfig.cmake" -B "$WORK" >/dev/null
  cp "$WORK"/stemvo_*.deb "$ROOT/tmp/package.deb"
  install /tmp/package.deb
  for file in bin/stemvo share/man/man1/stemvo.1 share/bash-completion/completions/stemvo share/zsh/vendor-completions/_stemvo \
    share/fish/vendor_completions.d/stemvo.fish lib/libstemvo.a lib/pkgconfig/stemvo.pc lib/cmake/stemvo/stemvoConfig.cmake include/stemvo/odometry.hpp \
    share/doc/stemvo/{copyright,LICENSE,plotly/LICENSE.txt,onnxruntime/LICENSE}; do
    expect_file "/usr/$file"
  done
  as_someone "stemvo --version && stemvo run drive/sequences/00 --quiet"
  for file in report.html trajectory.png trajectory_kitti.txt metrics.json; do
    expect_file "/home/someone/results/00/$file"
  done
  ((left_out == 0)) || return 0
  for input in "drive.avi --camera camera.yaml" euroc tum bag; do
    as_someone "stemvo run $input --quiet"
  done
  for name in euroc tum bag; do  # the same frames
    cmp "$HOME_DIR"/results/{drive,"$name"}/trajectory_kitti.txt
  done
}

# Tries zsh and fish; deb.cmake has bash's.
try_completions() {
  echo "==> Completions"
  install zsh fish
  cat >"$HOME_DIR/try.zsh" <<'END'
compadd() { while [[ $1 != -- ]]; do shift; done; shift; for one in $@; do [[ $one == ${words[CURRENT]}* ]] && print -r -- "[$one]"; done }
try() { words=(stemvo "$@"); CURRENT=${#words}; source /usr/share/zsh/vendor-completions/_stemvo }
try mo; try run --fr; try run x --set stem.mo; true
END
  cat >"$HOME_DIR/try.fish" <<'END'
for line in 'stemvo mo' 'stemvo run --fr' 'stemvo run x --set stem.mo'
  complete -C $line | string replace -r '.*' '[$0]'
end
END
  local found
  for shell in "zsh -f try.zsh" "fish try.fish"; do
    found=$(as_someone "$shell" | cut -f1 | tr -d '[]\n' | tr -s ' ')
    [[ $found == "models--framesstem.model=" ]] || { echo "$shell: expected completions, found '$found'"; exit 1; }
  done
}

try_cmake() {
  echo "==> C++"
  local packages
  packages=$(grep -o 'apt install [^`]*libopencv-dev[^`]*' "$SOURCE/README.md")
  # shellcheck disable=SC2086
  install ${packages#apt install }
  mkdir "$HOME_DIR/poses"
  pages cpp README.md >"$HOME_DIR/poses/main.cpp"
  pages cmake README.md >"$HOME_DIR/poses/CMakeLists.txt"
  inside chown -R someone /home/someone/poses
  as_someone "cmake -S poses -B built >/dev/null && cmake --build built >/dev/null && built/poses car/sequences/00/image_2/*.png" >"$WORK/positions"
  [[ $(wc -l <"$WORK/positions") == 4 ]] || { echo "expected 4 positions, found:"; cat "$WORK/positions"; exit 1; }
  grep -oP '`\Kg\+\+ [^`]*pkg-config[^`]*' "$SOURCE/README.md" >"$HOME_DIR/poses/without_cmake"
  as_someone "cd poses && sh -e without_cmake && ./poses ../car/sequences/00/image_2/*.png" | cmp - "$WORK/positions"
}

remove
trap remove EXIT
mkdir -p "$WORK"
left_out=0
make_root
try_python
try_package
try_completions
try_cmake
echo "==> Remove"
inside apt-get purge -y stemvo >/dev/null
left=$(find "$ROOT" -xdev -name '*stemvo*' -not -path "$ROOT/home/*" -not -path "$ROOT/tmp/*")
[[ -z $left ]] || { echo "expected nothing to stay, found $left"; exit 1; }
echo "==> Nothing of it is left"
((left_out == 0)) || exit 77  # skipped: a part was not tried
