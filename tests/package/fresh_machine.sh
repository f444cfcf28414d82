#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# fresh_machine.sh RELEASE FOLDER: README's first command, its Python and its study, word for word, from a clone of HEAD in an empty root of RELEASE (bookworm,
# trixie, noble) that has git and make; then docs/python.md's quick start. Needs root and debootstrap (tools/setup.sh root); takes a quarter of an hour.
set -euo pipefail

readonly RELEASE=$1 ROOT=$2/$1
SOURCE=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
readonly SOURCE
mapfile -t PIP < <(env | grep '^PIP_' | grep -v '^PIP_CERT=' || true)

inside() { chroot "$ROOT" /usr/bin/env -i "${PIP[@]}" PIP_CERT=/root/certificates.crt PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root LANG=C.UTF-8 "$@" </dev/null; }
in_clone() { echo "==> $RELEASE: $*"; inside bash -euc "cd /root/stemvo && $*"; }
leave() { ! mountpoint --quiet "$ROOT/proc" || umount "$ROOT/proc"; }
trap leave EXIT

make_root() {
  local more=()
  # Debian's debootstrap has neither Ubuntu's newer names nor its keys.
  [[ -e /usr/share/debootstrap/scripts/$RELEASE ]] || more=("$(sed -n '/old-releases/d; s/.*default_mirror //p' /usr/share/debootstrap/scripts/gutsy | head -n 1)" gutsy)
  debootstrap --variant=minbase ${more:+--no-check-gpg --components=main,universe} "$RELEASE" "$ROOT" "${more[@]}" >"$ROOT.log" || { tail "$ROOT.log"; exit 1; }
}

mkdir -p "$2"
[[ -d $ROOT ]] || make_root
cp -r /etc/apt/apt.conf.d /etc/apt/apt.conf "$ROOT/etc/apt/" 2>/dev/null || true  # a proxy, where there is one
cp /etc/resolv.conf /etc/hosts "$ROOT/etc/"
cp /etc/ssl/certs/ca-certificates.crt "$ROOT/root/certificates.crt"
mount -t proc proc "$ROOT/proc"
inside apt-get update >/dev/null
inside env DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends git make >"$ROOT.log" 2>&1 || { tail "$ROOT.log"; exit 1; }
rm -rf "$ROOT/root/stemvo"
git clone --quiet "$SOURCE" "$ROOT/root/stemvo"
inside chown -R root: /root/stemvo
in_clone make demo
in_clone "$(grep -oP '\*\*Python:\*\* `\K[^`]+' "$SOURCE/README.md")"
in_clone "build/release/stemvo synth drive --frames 12 --width 620 --height 188 --json >/dev/null"
PYTHONPATH=$SOURCE/tests/python python3 -c "import documented
print(next(block.text for block in documented.blocks('python') if 'read_recording' in block.text))" >"$ROOT/root/stemvo/quick_start.py"
in_clone venv/bin/python quick_start.py
in_clone make lab
in_clone "$(grep -P '^build/lab/bin/stemvo-lab search ' "$SOURCE/README.md")"
echo "==> $RELEASE: done"
