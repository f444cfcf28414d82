# SPDX-License-Identifier: MIT
"""The benchmark of whole programs (bench/run.py): statistics, errors, turns, and the peer, on a tiny rendered drive and on 03."""

import contextlib
import io
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest
from unittest import mock

ROOT = pathlib.Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT / "bench"))

import places  # noqa: E402
import results  # noqa: E402
import rounds  # noqa: E402
import rows  # noqa: E402
import run  # noqa: E402

PROGRAM = os.environ.get("STEMVO_PROGRAM", "")
DATA = os.environ.get("STEMVO_SHARED_DATA")
NO_PEERS = "build/venv-peers is missing (tools/setup.sh peers)"


class Statistics(unittest.TestCase):
    def test_spread(self):
        self.assertEqual(results.spread([3.0, 1.0, 2.0]), results.Spread(2.0, 1.0, 3.0))
        self.assertEqual(results.spread([4.0, 1.0]), results.Spread(2.5, 1.0, 4.0))
        self.assertEqual(results.spread([5.0]), results.Spread(5.0, 5.0, 5.0))

    def test_ratios_are_within_a_round(self):
        # A machine that is half as fast in the second round changes no ratio.
        self.assertEqual(results.ratios([3.0, 6.0], [1.0, 2.0]), [3.0, 3.0])
        with self.assertRaises(ValueError):
            results.ratios([1.0], [1.0, 2.0])


class BeforeTheFirstRun(unittest.TestCase):
    """Wrong arguments are refused at once, in one line."""

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        (self.folder / "image_0").mkdir()

    def refused(self, *arguments):
        with contextlib.redirect_stderr(io.StringIO()) as said, mock.patch.object(rounds, "run_measured") as measured:
            self.assertEqual(run.main(["--program", sys.executable, "--only", "defaults", *map(str, arguments)]), 1)
        measured.assert_not_called()
        self.assertEqual(len(said.getvalue().splitlines()), 1, said.getvalue())
        return said.getvalue()

    def test_a_folder_that_is_no_sequence(self):
        self.assertIn("/nonexist: expected a KITTI sequence (a folder with image_2 or image_0), found nothing", self.refused("/nonexist"))
        self.assertIn(f"{__file__}: expected a KITTI sequence (a folder with image_2 or image_0), found a file", self.refused(__file__))
        self.assertIn("expected a folder image_2 or image_0 in it, found neither", self.refused(self.folder / "image_0"))

    def test_a_json_file_that_cannot_be_written(self):
        nowhere = self.folder / "no/such/x.json"
        self.assertIn(f"{nowhere}: expected a file that can be written, found: No such file or directory",
                      self.refused(self.folder, "--json", nowhere))
        self.assertIn("found: Is a directory", self.refused(self.folder, "--json", self.folder))


class Measuring(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def measure(self, code):
        return rounds.run_measured([sys.executable, "-c", code], os.sched_getaffinity(0), self.folder / "log")

    def test_wall_time_processor_time_and_memory(self):
        slept = self.measure("import time; time.sleep(0.5)")
        self.assertGreater(slept.wall_s, 0.5)
        self.assertLess(slept.cpu_s, 0.4)
        worked = self.measure("import time\nwhile time.process_time() < 0.5: pass\nx = b'1' * 100_000_000")
        self.assertGreater(worked.cpu_s, 0.5)
        self.assertGreater(worked.peak_mib, slept.peak_mib + 80)

    def test_a_failure_says_what_the_program_said(self):
        with self.assertRaisesRegex(places.BenchError, "exit code 3: no such frame"):
            self.measure("print('no such frame'); raise SystemExit(3)")


class Rows(unittest.TestCase):
    def chosen(self, *arguments):
        return [row.name for row in rows.chosen(run.parse_arguments(["--program", sys.executable, *arguments]))]

    def test_choice(self):
        self.assertEqual(self.chosen("--without", "opencv orb,full stem"), ["defaults", "folded stem", "gray"])
        self.assertEqual(self.chosen("--only", "gray,defaults"), ["defaults", "gray"])
        self.assertEqual(self.chosen("--only", "defaults,before", "--add", f"before={sys.executable}"), ["defaults", "before"])

    def test_errors(self):
        with self.assertRaisesRegex(places.BenchError, "expected a row of defaults, .*, found 'orb'"):
            self.chosen("--only", "orb")
        with self.assertRaisesRegex(places.BenchError, "no row is left"):
            self.chosen("--only", "gray", "--without", "gray")
        with self.assertRaisesRegex(places.BenchError, "/nowhere: expected a program for the row 'before'"):
            self.chosen("--only", "before", "--add", "before=/nowhere")
        with mock.patch.object(places, "PEER_PYTHON", pathlib.Path("/nowhere")), self.assertRaisesRegex(places.BenchError, "tools/setup.sh peers"):
            self.chosen("--only", "opencv orb")
        for wrong in (["--rounds", "0"], ["--add", "name"], ["--cores", "0"], ["--frames", "a:b"], ["--frames", ":"]):
            with self.subTest(wrong), contextlib.redirect_stderr(io.StringIO()), self.assertRaises(SystemExit):
                run.parse_arguments(wrong)


class TinyDrive(unittest.TestCase):
    FRAMES = 30

    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.folder = pathlib.Path(folder.name)
        subprocess.run([PROGRAM, "synth", cls.folder / "drive", "--frames", str(cls.FRAMES), "--width", "620", "--height", "188"], check=True,
                       capture_output=True)
        cls.sequence = cls.folder / "drive/sequences/00"

    def bench(self, *arguments, code=0):
        with contextlib.redirect_stdout(io.StringIO()) as said, contextlib.redirect_stderr(io.StringIO()) as progress, \
                mock.patch.object(places, "WORK", self.folder / "work"):
            self.assertEqual(run.main([str(self.sequence), "--program", PROGRAM, "--json", str(self.folder / "a.json"), *arguments]), code,
                             progress.getvalue())
        return said.getvalue(), progress.getvalue()

    def test_in_turn(self):
        said, progress = self.bench("--only", "defaults,folded stem,gray", "--rounds", "2", "--frames", "5:25")
        order = [line.split(":")[1].strip() for line in progress.splitlines() if line.startswith("round")]
        self.assertEqual(order, ["defaults", "folded stem", "gray", "folded stem", "gray", "defaults"])
        found = json.loads((self.folder / "a.json").read_text())
        self.assertEqual([row["name"] for row in found["rows"]], ["defaults", "folded stem", "gray"])
        for row in found["rows"]:
            self.assertEqual(len(row["wall_s"]), 2)
            self.assertLessEqual(row["fps"]["low"], row["fps"]["median"])
            self.assertAlmostEqual(row["fps"]["high"], 20 / min(row["wall_s"]), places=6)
            self.assertGreater(row["peak_mib"], 20)
            self.assertLess(row["t_rel_percent"], 10)
            self.assertEqual(row["t_rel_lengths"], "metres from the road")
        self.assertEqual(found["rows"][0]["time_over_first"], {"median": 1.0, "low": 1.0, "high": 1.0})
        for key in ("machine", "commit", "stemvo", "rounds", "load_before", "busy"):
            self.assertIn(f"{key}: ", said)
        self.assertIn("time, defaults = 1", said)
        self.assertRegex(said, r"\nfolded stem +[\d.]+ +[\d.]+-[\d.]+ ")
        self.assertEqual(found["busy"], "BUSY MACHINE" in said)

    @unittest.skipUnless(places.PEER_PYTHON.exists(), NO_PEERS)
    def test_the_peer_is_a_working_odometry(self):
        self.bench("--only", "defaults,opencv orb", "--rounds", "1")
        peer = json.loads((self.folder / "a.json").read_text())["rows"][1]
        self.assertLess(peer["t_rel_percent"], 25, "a wrong direction or composition is far above")
        self.assertGreater(peer["t_rel_percent"], 0)
        self.assertEqual(peer["t_rel_lengths"], "per-step ground-truth scale")
        with self.subTest("without ground truth every step is 1 long"):
            out = self.folder / "unit.txt"
            subprocess.run([places.PEER_PYTHON, places.PEER, self.sequence, "--out", out, "--frames", "0:4"], check=True)
            positions = [[float(line.split()[i]) for i in (3, 7, 11)] for line in out.read_text().splitlines()]
            self.assertEqual(len(positions), 4)
            for a, b in zip(positions, positions[1:]):
                self.assertAlmostEqual(sum((x - y) ** 2 for x, y in zip(a, b)), 1.0, places=6)

    def test_a_sequence_that_is_none(self):
        said, progress = self.bench("--only", "defaults", "--frames", "100:200", code=1)
        self.assertIn("exit code 1: error:", progress)


def is_debug_build():
    cache = pathlib.Path(PROGRAM).parent / "CMakeCache.txt"
    return cache.exists() and "CMAKE_BUILD_TYPE:STRING=Debug" in cache.read_text(encoding="utf-8")


@unittest.skipIf(is_debug_build(), "a debug build, which nobody times")
@unittest.skipUnless(DATA, "STEMVO_SHARED_DATA is not set")
@unittest.skipUnless(places.PEER_PYTHON.exists(), NO_PEERS)
class AgainstThePeer(unittest.TestCase):
    def test_less_processor_time_than_orb_and_brute_force(self):
        # About 2.0 on 03; processor time because other programs lengthen it little.
        with tempfile.TemporaryDirectory() as folder, mock.patch.object(places, "WORK", pathlib.Path(folder)), \
                contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()) as progress:
            numbers = pathlib.Path(folder) / "numbers.json"
            code = run.main([f"{DATA}/kitti/sequences/03", "--frames", "0:60", "--rounds", "1", "--only", "defaults,opencv orb",
                             "--program", PROGRAM, "--json", str(numbers)])
            self.assertEqual(code, 0, progress.getvalue())
            ours, peer = (row["cpu_ms_per_frame"]["median"] for row in json.loads(numbers.read_text())["rows"])
        print(f"processor time of a frame: opencv orb {peer:.1f} ms, defaults {ours:.1f} ms, ratio {peer / ours:.2f}", file=sys.stderr)
        self.assertGreaterEqual(peer / ours, 1.2)


if __name__ == "__main__":
    unittest.main()
