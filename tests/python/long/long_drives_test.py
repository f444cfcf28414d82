# SPDX-License-Identifier: MIT
"""tools/long_drives.py: a row per drive, runs are watched; tools/planted_camera.py: a row per calibration."""

import contextlib
import json
import os
import pathlib
import subprocess
import sys

from drives import watched_run

ROOT = pathlib.Path(__file__).resolve().parents[3]
PROGRAM = os.environ["STEMVO_PROGRAM"]
STEP_M = 0.8


def write_poses(file, count):
    """A drive straight ahead."""
    lines = [f"1 0 0 0 0 1 0 0 0 0 1 {STEP_M * i:.6f}" for i in range(count)]
    file.write_text("\n".join(lines) + "\n", encoding="ascii")


def tool(name, *arguments):
    command = [sys.executable, str(ROOT / "tools" / name), "--program", PROGRAM, *map(str, arguments)]
    return subprocess.run(command, check=False, capture_output=True, text=True)


def test_a_growing_process_shows_in_the_second_half():
    script = ("import sys, time\n"
              "kept = []\n"
              "print('warning: one of two words', file=sys.stderr)\n"
              "for i in range(40):\n"
              "    kept.append(bytearray(2_000_000))\n"
              "    print(f'\\r{i + 1}/40 frames, and more', end='', file=sys.stderr, flush=True)\n"
              "    time.sleep(0.05)\n")
    with contextlib.closing(watched_run.Messages()) as messages:
        process = subprocess.Popen([sys.executable, "-c", script], stderr=messages.slave)
        watched = watched_run.watch(process, messages.frames_done, 40)
        assert messages.words() == "warning: one of two words"
    first, second, _ = watched.memory_mb
    assert second - first > 20.0  # of 40 MB
    assert watched.memory_ratio > 1.2


def test_prints_a_row_per_drive_and_goes_on_after_a_failure(tmp_path):
    write_poses(tmp_path / "31.txt", 240)  # more than a second, so that a tenth of a second tells the quarters
    done = tool("long_drives.py", tmp_path / "cache", "--poses", tmp_path, "--sequences", "77,31", "--size", "310x94", "--set", "features.method=sift",
                "--out", tmp_path / "out")
    assert done.returncode == 1 and "77: " in done.stderr, done.stderr
    rows = done.stdout.splitlines()
    assert len(rows) == 3, done.stdout
    cells = [cell.strip() for cell in rows[2].strip("|").split("|")]
    assert cells[:2] == ["31", "240"]
    first, second, _ = map(float, cells[6].split("/"))
    assert min(first, second) > 5.0 and all(float(value) > 0.0 for value in cells[8].split())
    metrics = json.loads((tmp_path / "out/31/metrics.json").read_text())
    assert cells[3] == f"{metrics['r_rel_deg_per_100m']:.3f}"


def test_a_row_per_calibration(tmp_path):
    write_poses(tmp_path / "31.txt", 60)
    done = tool("planted_camera.py", tmp_path / "cache", "--poses", tmp_path, "--sequences", "31", "--size", "310x94",
                "--plant", "5,-1.5", "--from-frame", "20")
    assert done.returncode == 0, done.stderr
    true, planted = ([cell.strip() for cell in row.strip("|").split("|")] for row in done.stdout.splitlines()[2:])
    assert (true[1], planted[1]) == ("true", "5, -1.5 px off")
    assert (true[6], planted[6]) == ("0.00, 0.00", "5.00, 1.50")  # straight on, nothing tells of the camera
    errors = [[float(cell.split(" / ")[0]) for cell in row[2:6]] for row in (true, planted)]
    assert all(0.0 < error < 20.0 for row in errors for error in row), errors
    assert errors[0] != errors[1]
