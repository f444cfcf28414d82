# SPDX-License-Identifier: MIT
"""tools/long_drives.py: what is rendered is kept, what changed is rendered anew, runs are watched; tools/planted_camera.py: a row per calibration."""

import contextlib
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

from drives import rendered, watched_run

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


class RenderedDrives(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        write_poses(self.folder / "31.txt", 9)
        self.drive = rendered.Drive(self.folder / "31.txt", 96, 48)

    def render(self, drive):
        return rendered.render(PROGRAM, self.folder / "cache", drive)

    def test_is_rendered_once(self):
        folder = self.render(self.drive)
        frames = sorted((folder / "sequences/00/image_2").iterdir())
        self.assertEqual(len(frames), 9)
        self.assertEqual(len((folder / "poses/00.txt").read_text().splitlines()), 9)
        before = frames[3].stat().st_mtime_ns
        self.assertEqual(self.render(self.drive), folder)
        self.assertEqual(frames[3].stat().st_mtime_ns, before)

    def test_half_a_rendering_is_not_kept(self):
        folder = self.render(self.drive)
        (folder / rendered.RENDERED).unlink()  # as an interrupt leaves it
        (folder / "sequences/00/image_2/000004.png").unlink()
        self.render(self.drive)
        self.assertTrue((folder / "sequences/00/image_2/000004.png").exists())


class WatchedRuns(unittest.TestCase):
    def test_a_growing_process_shows_in_the_second_half(self):
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
            self.assertEqual(messages.words(), "warning: one of two words")
        first, second, _ = watched.memory_mb
        self.assertGreater(second - first, 20.0)  # of 40 MB
        self.assertGreater(watched.memory_ratio, 1.2)


class Command(unittest.TestCase):
    def test_prints_a_row_per_drive_and_goes_on_after_a_failure(self):
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            write_poses(folder / "31.txt", 60)
            done = tool("long_drives.py", folder / "cache", "--poses", folder, "--sequences", "77,31", "--size", "310x94",
                               "--set", "features.method=sift", "--out", folder / "out")
            self.assertEqual(done.returncode, 1, done.stderr)
            self.assertIn("77: ", done.stderr)
            rows = done.stdout.splitlines()
            self.assertEqual(len(rows), 3, done.stdout)
            cells = [cell.strip() for cell in rows[2].strip("|").split("|")]
            self.assertEqual(cells[:2], ["31", "60"])
            first, second, _ = map(float, cells[6].split("/"))
            self.assertGreater(first, 5.0)
            self.assertGreater(second, 5.0)
            self.assertTrue(all(float(value) > 0.0 for value in cells[8].split()))
            metrics = json.loads((folder / "out/31/metrics.json").read_text())
            self.assertEqual(cells[3], f"{metrics['r_rel_deg_per_100m']:.3f}")


class PlantedCamera(unittest.TestCase):
    def test_a_row_per_calibration(self):
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            write_poses(folder / "31.txt", 60)
            done = tool("planted_camera.py", folder / "cache", "--poses", folder, "--sequences", "31", "--size", "310x94",
                        "--plant", "5,-1.5", "--from-frame", "20")
            self.assertEqual(done.returncode, 0, done.stderr)
            true, planted = ([cell.strip() for cell in row.strip("|").split("|")] for row in done.stdout.splitlines()[2:])
        self.assertEqual((true[1], planted[1]), ("true", "5, -1.5 px off"))
        self.assertEqual((true[6], planted[6]), ("0.00, 0.00", "5.00, 1.50"))  # straight on, nothing tells of the camera
        errors = [[float(cell.split(" / ")[0]) for cell in row[2:6]] for row in (true, planted)]
        self.assertTrue(all(0.0 < error < 20.0 for row in errors for error in row), errors)
        self.assertNotEqual(*errors)


if __name__ == "__main__":
    unittest.main()
