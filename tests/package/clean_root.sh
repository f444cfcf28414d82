#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# clean_root.sh BUILD: the Debian package in an empty root of this machine's release. apt installs it, an ordinary user runs it,
# apt removes it, nothing of it stays. Ends with 77 (skipped) without root or debootstrap (tools/setup.sh root).
set -euo pipefail

readonly BUILD=$1 WORK=$1/package_clean_root
readonly ROOT=$WORK/root

if ((EUID != 0)) || ! command -v debootstrap >/dev/null; then
  echo "clean_root: needs root and debootstrap"
  exit 77
fi
inside() { chroot "$ROOT" /usr/bin/env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin LANG=C.UTF-8 DEBIAN_FRONTEND=noninteractive "$@" </dev/null; }
remove() {
  ! mountpoint --quiet "$ROOT/proc" || umount "$ROOT/proc"
  rm -rf --one-file-system "$WORK"
}

remove
trap remove EXIT
mkdir -p "$WORK"
cpack -G DEB --config "$BUILD/CPackConfig.cmake" -B "$WORK"
release=$(. /etc/os-release && echo "$VERSION_CODENAME")
components=$(. /etc/os-release && [[ $ID == ubuntu ]] && echo main,universe || echo main)
debootstrap --variant=minbase --components="$components" "$release" "$ROOT" >"$WORK/debootstrap.log" || { tail "$WORK/debootstrap.log"; exit 1; }
cp -r /etc/apt/apt.conf.d /etc/apt/apt.conf "$ROOT/etc/apt/" 2>/dev/null || true  # a proxy, where there is one
cp /etc/resolv.conf "$ROOT/etc/"
mount -t proc proc "$ROOT/proc"  # by which the loader knows where the program is
cp "$WORK"/stemvo_*.deb "$ROOT/tmp/package.deb"

echo "==> Install"
inside apt-get update
inside apt-get install -y --no-install-recommends /tmp/package.deb
for file in bin/stemvo share/man/man1/stemvo.1 share/bash-completion/completions/stemvo share/zsh/vendor-completions/_stemvo \
  share/fish/vendor_completions.d/stemvo.fish lib/libstemvo.a lib/pkgconfig/stemvo.pc lib/cmake/stemvo/stemvoConfig.cmake include/stemvo/odometry.hpp; do
  [[ -s $ROOT/usr/$file ]] || { echo "expected /usr/$file, found none"; exit 1; }
done

echo "==> Run"
inside useradd --create-home someone
inside su someone -c "cd && stemvo --version && stemvo synth drive --frames 10 --width 320 --height 96 && stemvo run drive/sequences/00"
for file in report.html trajectory.png trajectory_kitti.txt metrics.json; do
  [[ -s $ROOT/home/someone/results/00/$file ]] || { echo "expected ~/results/00/$file, found none"; exit 1; }
done

echo "==> Remove"
inside apt-get purge -y stemvo
left=$(find "$ROOT" -xdev -name '*stemvo*' -not -path "$ROOT/home/*" -not -path "$ROOT/tmp/*")
[[ -z $left ]] || { echo "expected nothing to stay, found $left"; exit 1; }
echo "==> Nothing of it is left"
