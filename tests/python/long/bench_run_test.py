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
import rows  # noqa: E402
import run  # noqa: E402

PROGRAM = os.environ.get("STEMVO_PROGRAM", "")
DATA = os.environ.get("STEMVO_SHARED_DATA")
NO_PEERS = "build/venv-peers is missing (tools/setup.sh peers)"


class Statistics(unittest.TestCase):
    def test_ratios_are_within_a_round(self):
        # A machine that is half as fast in the second round changes no ratio.
        self.assertEqual(results.ratios([3.0, 6.0], [1.0, 2.0]), [3.0, 3.0])
        with self.assertRaises(ValueError):
            results.ratios([1.0], [1.0, 2.0])


class Rows(unittest.TestCase):
    def chosen(self, *arguments):
        return [row.name for row in rows.chosen(run.parse_arguments(["--program", sys.executable, *arguments]))]

    def test_errors(self):
        with self.assertRaisesRegex(places.BenchError, "expected a row of defaults, .*, found 'orb'"):
            self.chosen("--only", "orb")


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
