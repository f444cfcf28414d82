# SPDX-License-Identifier: MIT
"""The sequence that every row runs on: a KITTI folder, or a drive rendered here."""

import hashlib
import pathlib
import subprocess
import sys

import places
from places import BenchError

RENDERED_FRAMES = 200


def rendered_drive(program):
    """A sequence of RENDERED_FRAMES frames, rendered once per build of the program."""
    made_by = f"{hashlib.sha256(program.read_bytes()).hexdigest()} {RENDERED_FRAMES}"
    drive, stamp = places.WORK / "drive", places.WORK / "drive.stamp"
    if not stamp.exists() or stamp.read_text(encoding="utf-8") != made_by:
        print(f"rendering a drive of {RENDERED_FRAMES} frames to {drive}", file=sys.stderr)
        subprocess.run(["rm", "-rf", drive], check=True)
        subprocess.run([program, "synth", drive, "--frames", str(RENDERED_FRAMES)], check=True, stderr=subprocess.DEVNULL)
        stamp.write_text(made_by, encoding="utf-8")
    return drive / "sequences/00"


def check_folder(folder):
    """Raises BenchError where the folder cannot be a sequence."""
    if not folder.is_dir():
        raise BenchError(f"{folder}: expected a KITTI sequence (a folder with image_2 or image_0), found {'a file' if folder.exists() else 'nothing'}")
    if not any((folder / name).is_dir() for name in ("image_2", "image_0")):
        raise BenchError(f"{folder}: expected a folder image_2 or image_0 in it, found neither")


def truth_file(folder):
    """Where KITTI has its true poses; the file may be missing."""
    folder = folder.resolve()
    return folder.parent.parent / "poses" / f"{folder.name}.txt"


def frame_range(text):
    """Begin and end of "A:B", "A:" or ":B"; (0, None), all of them, without a text."""
    begin, _, end = (text or "").partition(":")
    return int(begin or 0), int(end) if end else None


def frame_files(folder, frames) -> list[pathlib.Path]:
    """The pictures of these frames ("A:B"), of the camera that every row takes."""
    camera = "image_2" if (folder / "image_2").is_dir() else "image_0"
    return sorted((folder / camera).glob("*.png"))[slice(*frame_range(frames))]
