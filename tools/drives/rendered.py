# SPDX-License-Identifier: MIT
"""Drives rendered along given poses, each rendered once and kept in a folder."""

import dataclasses
import fcntl
import hashlib
import json
import os
import pathlib
import shutil
import subprocess

RENDERED = "rendered.json"  # written last: a drive without it is not complete

WORLD = 3  # raised when the renderer makes another world of the same poses


class DriveError(Exception):
    """One line: what is wrong with which file."""


@dataclasses.dataclass(frozen=True)
class Drive:
    """Everything that makes a rendered drive the one asked for."""

    poses: pathlib.Path  # a KITTI pose file; its name is the sequence's
    width_px: int = 620
    height_px: int = 188
    max_frames: int = 0  # 0: one per pose
    seed: int = 1

    @property
    def name(self):
        return self.poses.stem

    def num_frames(self):
        try:
            count = sum(1 for line in self.poses.read_text(encoding="ascii").splitlines() if line.strip())
        except (OSError, UnicodeDecodeError) as error:
            raise DriveError(f"{self.poses}: expected a KITTI pose file, found: {error}") from error
        if count == 0:
            raise DriveError(f"{self.poses}: expected a pose per line, found none")
        return min(count, self.max_frames) if self.max_frames else count

    def stamp(self):
        digest = hashlib.sha256(self.poses.read_bytes()).hexdigest()
        return {"poses_sha256": digest, "frames": self.num_frames(), "width": self.width_px,
                "height": self.height_px, "seed": self.seed, "world": WORLD}


def folder_of(cache, drive):
    """One folder per size, length and seed, so that none replaces another."""
    size = f"{drive.width_px}x{drive.height_px}"
    seed = "" if drive.seed == 1 else f"_seed{drive.seed}"
    frames = f"_{drive.max_frames}" if drive.max_frames else ""
    return cache / f"{size}{seed}" / f"{drive.name}{frames}"


def is_rendered(folder, drive):
    try:
        return json.loads((folder / RENDERED).read_text(encoding="utf-8")) == drive.stamp()
    except (OSError, ValueError):
        return False


def _behind_everybody(num_threads):
    """In the child, before it becomes the program: low priority, on so many of the processors."""
    os.nice(10)
    if num_threads:
        os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[-num_threads:])


def check_space(cache, drive):
    """At most a byte per colour and pixel: noise hardly compresses, so PNGs are not much smaller."""
    expected = drive.num_frames() * drive.width_px * drive.height_px * 3
    free = shutil.disk_usage(cache).free
    if free < expected:
        raise DriveError(f"{cache}: expected {expected / 1e9:.1f} GB of space to render {drive.name}, "
                         f"found {free / 1e9:.1f} GB")


def render(program, cache, drive, num_threads=1):
    """The folder of the drive (sequences/00, poses/00.txt inside), rendered where it is not yet."""
    folder = folder_of(cache, drive)
    folder.mkdir(parents=True, exist_ok=True)
    # Two of these tools at once on one cache: the second waits, then finds the drive rendered.
    with open(f"{folder}.lock", "w", encoding="ascii") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if is_rendered(folder, drive):
            return folder
        (folder / RENDERED).unlink(missing_ok=True)
        check_space(folder, drive)
        command = [program, "synth", str(folder), "--trajectory", str(drive.poses), "--frames", str(drive.num_frames()),
                   "--width", str(drive.width_px), "--height", str(drive.height_px), "--seed", str(drive.seed)]
        done = subprocess.run(command, check=False, stdout=subprocess.DEVNULL,
                              preexec_fn=lambda: _behind_everybody(num_threads))
        if done.returncode != 0:
            raise DriveError(f"{folder}: rendering ended with exit code {done.returncode}")
        (folder / RENDERED).write_text(json.dumps(drive.stamp(), indent=2) + "\n", encoding="utf-8")
    return folder
