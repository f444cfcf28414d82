# SPDX-License-Identifier: MIT
"""The benchmark of whole programs (bench/run.py): statistics, errors, and the peer, on a tiny rendered drive."""

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

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "bench"))

import run  # noqa: E402

PROGRAM = os.environ.get("STEMVO_PROGRAM", "")


class Statistics(unittest.TestCase):
    def test_spread(self):
        self.assertEqual(run.spread([3.0, 1.0, 2.0]), run.Spread(2.0, 1.0, 3.0))
        self.assertEqual(run.spread([4.0, 1.0]), run.Spread(2.5, 1.0, 4.0))
        self.assertEqual(run.spread([5.0]), run.Spread(5.0, 5.0, 5.0))

    def test_ratios_are_within_a_round(self):
        # A machine that is half as fast in the second round changes no ratio.
        self.assertEqual(run.ratios([3.0, 6.0], [1.0, 2.0]), [3.0, 3.0])
        with self.assertRaises(ValueError):
            run.ratios([1.0], [1.0, 2.0])

    def test_rows_of_the_table(self):
        def result(name, fps, ratio, error):
            def all_of(value):
                return {"median": value, "low": value, "high": value}
            return {"name": name, "fps": all_of(fps), "time_over_first": all_of(ratio), "cpu_ms_per_frame": all_of(20.0),
                    "peak_mib": 99.6, "t_rel_percent": error}

        lines = run.table([result("defaults", 100.0, 1.0, 0.74), result("opencv orb", 40.0, 2.5, None)]).splitlines()
        self.assertIn("time, defaults = 1", lines[0])
        self.assertEqual(lines[1].split(), "defaults 100.0 100.0-100.0 1.00 1.00-1.00 20.0 100 0.74".split())
        self.assertEqual(lines[2].split(), "opencv orb 40.0 40.0-40.0 2.50 2.50-2.50 20.0 100 -".split())


class Measuring(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def measure(self, code):
        return run.run_measured([sys.executable, "-c", code], os.sched_getaffinity(0), self.folder / "log")

    def test_wall_time_processor_time_and_memory(self):
        slept = self.measure("import time; time.sleep(0.5)")
        self.assertGreater(slept.wall_s, 0.5)
        self.assertLess(slept.cpu_s, 0.4)
        worked = self.measure("import time\nwhile time.process_time() < 0.5: pass\nx = b'1' * 100_000_000")
        self.assertGreater(worked.cpu_s, 0.5)
        self.assertGreater(worked.peak_mib, slept.peak_mib + 80)

    def test_cores(self):
        one = {min(os.sched_getaffinity(0))}
        run.run_measured([sys.executable, "-c", "import os; print(sorted(os.sched_getaffinity(0)))"], one, self.folder / "log")
        self.assertEqual((self.folder / "log").read_text().strip(), str(sorted(one)))

    def test_a_failure_says_what_the_program_said(self):
        with self.assertRaisesRegex(run.BenchError, "exit code 3: no such frame"):
            self.measure("print('no such frame'); raise SystemExit(3)")


class Rows(unittest.TestCase):
    def chosen(self, *arguments):
        return [row.name for row in run.chosen_rows(run.parse_arguments(["--program", sys.executable, *arguments]))]

    def test_choice(self):
        self.assertEqual(self.chosen("--without", "opencv orb,full stem"), ["defaults", "folded stem", "gray"])
        self.assertEqual(self.chosen("--only", "gray,defaults"), ["defaults", "gray"])
        self.assertEqual(self.chosen("--only", "defaults,before", "--add", f"before={sys.executable}"), ["defaults", "before"])

    def test_errors(self):
        with self.assertRaisesRegex(run.BenchError, "expected a row of defaults, .*, found 'orb'"):
            self.chosen("--only", "orb")
        with self.assertRaisesRegex(run.BenchError, "no row is left"):
            self.chosen("--only", "gray", "--without", "gray")
        with self.assertRaisesRegex(run.BenchError, "/nowhere: expected a program for the row 'before'"):
            self.chosen("--only", "before", "--add", "before=/nowhere")
        with mock.patch.object(run, "PEER_PYTHON", pathlib.Path("/nowhere")), self.assertRaisesRegex(run.BenchError, "tools/setup.sh peers"):
            self.chosen("--only", "opencv orb")
        for wrong in (["--rounds", "0"], ["--add", "name"], ["--cores", "0"]):
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
                mock.patch.object(run, "WORK", self.folder / "work"):
            self.assertEqual(run.main([str(self.sequence), "--program", PROGRAM, "--json", str(self.folder / "a.json"), *arguments]), code,
                             progress.getvalue())
        return said.getvalue(), progress.getvalue()

    def test_in_turn(self):
        said, progress = self.bench("--only", "defaults,folded stem,gray", "--rounds", "2", "--frames", "5:25")
        order = [line.split(":")[1].strip() for line in progress.splitlines() if line.startswith("round")]
        self.assertEqual(order, ["defaults", "folded stem", "gray"] * 2)
        results = json.loads((self.folder / "a.json").read_text())
        self.assertEqual([row["name"] for row in results["rows"]], ["defaults", "folded stem", "gray"])
        for row in results["rows"]:
            self.assertEqual(len(row["wall_s"]), 2)
            self.assertLessEqual(row["fps"]["low"], row["fps"]["median"])
            self.assertAlmostEqual(row["fps"]["high"], 20 / min(row["wall_s"]), places=6)
            self.assertGreater(row["peak_mib"], 20)
            self.assertLess(row["t_rel_percent"], 10)
        self.assertEqual(results["rows"][0]["time_over_first"], {"median": 1.0, "low": 1.0, "high": 1.0})
        for key in ("machine", "commit", "stemvo", "rounds", "load_before"):
            self.assertIn(f"{key}: ", said)

    @unittest.skipUnless(run.PEER_PYTHON.exists(), "build/venv-peers is missing (tools/setup.sh peers)")
    def test_the_peer_is_a_working_odometry(self):
        self.bench("--only", "defaults,opencv orb", "--rounds", "1")
        peer = json.loads((self.folder / "a.json").read_text())["rows"][1]
        self.assertLess(peer["t_rel_percent"], 25, "a wrong direction or composition is far above")
        self.assertGreater(peer["t_rel_percent"], 0)
        with self.subTest("without ground truth every step is 1 long"):
            out = self.folder / "unit.txt"
            subprocess.run([run.PEER_PYTHON, run.PEER, self.sequence, "--out", out, "--frames", "0:4"], check=True)
            places = [[float(line.split()[i]) for i in (3, 7, 11)] for line in out.read_text().splitlines()]
            self.assertEqual(len(places), 4)
            for a, b in zip(places, places[1:]):
                self.assertAlmostEqual(sum((x - y) ** 2 for x, y in zip(a, b)), 1.0, places=6)

    def test_a_sequence_that_is_none(self):
        said, progress = self.bench("--only", "defaults", "--frames", "100:200", code=1)
        self.assertIn("exit code 1: error:", progress)


if __name__ == "__main__":
    unittest.main()
