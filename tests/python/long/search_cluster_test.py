# SPDX-License-Identifier: MIT
"""tools/search_cluster.py on several local Ray nodes, one of which is killed: the table is that of one machine."""

import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import time
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT / "tools"))
import _environment  # noqa: E402,F401

import numpy as np  # noqa: E402

from stems import metadata, onnx_writer  # noqa: E402
from stems import stem as stem_module  # noqa: E402

PROGRAM = os.environ.get("STEMVO_PROGRAM", str(ROOT / "build/release/stemvo"))
RAY = ROOT / "build/venv-ray/bin/python"


def write_models(folder):
    """Two models of random filters, smoothed so that most of them can be tracked."""
    rng = np.random.default_rng(3)
    files = []
    for name, filters in (("coarse", 5), ("fine", 4)):
        weights = rng.normal(size=(filters, 3, 4, 4)) / 40 + rng.normal(size=(filters, 1, 1, 1)) / 10
        stem = stem_module.Stem(weights, np.zeros(filters), 4 if name == "coarse" else 2)
        files.append(folder / f"{name}.onnx")
        metadata.write(files[-1], onnx_writer.build(stem), stem, network="random", layer=name, licence="MIT", command="test")
    return files


class Nodes:
    """A cluster of a head that runs nothing, a node of 1 processor and one of 2."""

    def __enter__(self):
        environment = {**os.environ, "RAY_USAGE_STATS_ENABLED": "0"}
        self._process = subprocess.Popen([RAY, ROOT / "tests/python/long/ray_nodes.py"], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                                         stderr=subprocess.DEVNULL, text=True, env=environment)
        self.address = self._process.stdout.readline().strip()
        return self

    def say(self, word):
        self._process.stdin.write(word + "\n")
        self._process.stdin.flush()

    def kill(self):
        self.say("kill")
        return self._process.stdout.readline().strip()

    def __exit__(self, *_error):
        try:
            self.say("stop")
            self._process.wait(30)
        except (OSError, subprocess.TimeoutExpired):
            self._process.kill()
            self._process.wait()
        self._process.stdin.close()
        self._process.stdout.close()


@unittest.skipUnless(os.access(RAY, os.X_OK), "Ray is not installed (make cluster)")
class SearchCluster(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.folder = pathlib.Path(folder.name)
        cls.models = write_models(cls.folder)
        for name, seed in (("drive", 1), ("other", 7)):
            subprocess.run([PROGRAM, "synth", cls.folder / name, "--frames", "14", "--width", "620", "--height", "188", "--seed", str(seed)],
                           check=True, capture_output=True)
        for kind, name in (("sequences", "01"), ("poses", "01.txt")):
            (cls.folder / "other" / kind / name.replace("01", "00")).rename(cls.folder / "drive" / kind / name)
        cls.what = [str(cls.folder / "drive/sequences/00"), str(cls.folder / "drive/sequences/01")]

    def cluster(self, *options):
        models = [word for model in self.models for word in ("--model", str(model))]
        return [RAY, ROOT / "tools/search_cluster.py", *self.what, *models, "--program", PROGRAM, *map(str, options)]

    def test_a_killed_node_changes_nothing(self):
        subprocess.run([PROGRAM, "search", *self.what, "--model", ",".join(map(str, self.models)), "--exhaustive", "--out", self.folder / "single",
                        "--quiet"], check=True)
        out = self.folder / "cluster"
        with Nodes() as nodes:
            self.assertRegex(nodes.address, r":\d+$")
            search = subprocess.Popen(self.cluster("--out", out, "--address", nodes.address, "--filters-per-task", 2, "--quiet"),
                                      stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
            deadline = time.monotonic() + 120
            while not list((out / "parts").glob("part*")):
                self.assertIsNone(search.poll(), search.stderr.read() if search.poll() is not None else "")
                self.assertLess(time.monotonic(), deadline)
                time.sleep(0.02)
            self.assertEqual(nodes.kill(), "killed")
            said, complaints = search.communicate(timeout=300)
        self.assertEqual(search.returncode, 0, complaints)
        tasks, repeated = re.search(r"tasks: (\d+) run on \d+ nodes in \S+ s, (\d+) repeated, 0 from before", said).groups()
        self.assertEqual(int(tasks), 10)  # 3 ranges of 5 filters and 2 of 4, on two sequences
        self.assertGreaterEqual(int(repeated), 1, "the killed node was idle")
        single, merged = (self.folder / "single/filters.csv").read_bytes(), (out / "result/filters.csv").read_bytes()
        self.assertEqual(single, merged)
        self.assertEqual(len(single.splitlines()), 1 + 9 + 4)
        self.assertIn(b",ranked,", single)
        self.assertIn(b",t_rel_percent_01,", single)
        self.check_that_records_name_the_model_here(out)
        self.go_on(out)

    def check_that_records_name_the_model_here(self, out):
        for part in (*(out / "parts").iterdir(), out / "result"):
            identity = json.loads((part / "records.jsonl").read_text(encoding="utf-8").splitlines()[0])["of"]
            models = {layer["stem_model"] for layer in identity["layers"]}
            self.assertTrue(models & set(map(str, self.models)))
            self.assertLessEqual(models, {*map(str, self.models), "gray", "input_layer"})

    def go_on(self, out):
        """Parts that are done are not run again; another search is refused."""
        before = (out / "result/filters.csv").read_bytes()
        for part in ("part00003", "part00007"):
            for file in (out / "parts" / part).iterdir():
                file.unlink()
            (out / "parts" / part).rmdir()
        done = subprocess.run(self.cluster("--out", out, "--filters-per-task", 2, "--quiet", "--resume"), capture_output=True, text=True, check=False)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("tasks: 2 run on 1 nodes", done.stdout)
        self.assertEqual((out / "result/filters.csv").read_bytes(), before)
        for options, message in ((("--filters-per-task", 2), "found a search (--resume goes on with it)"),
                                 (("--filters-per-task", 2, "--frames", "0:12", "--resume"), "found others")):
            done = subprocess.run(self.cluster("--out", out, *options), capture_output=True, text=True, check=False)
            self.assertEqual((done.returncode, done.stderr.count("\n")), (1, 1), done.stderr)
            self.assertIn(message, done.stderr)
        self.changed_inputs_are_refused_before_any_work(out)

    def changed_inputs_are_refused_before_any_work(self, out):
        sequence = self.folder / "drive/sequences/00"
        image = next(sequence.glob("image_2/*7.png"))
        for file in (sequence / "calib.txt", self.folder / "drive/poses/00.txt", image, out / "plan.json"):
            content = file.read_bytes()
            file.write_bytes(content[:-9] if file.name == "plan.json" else content[:-9] + b"replaced\n")  # of the same size
            done = subprocess.run(self.cluster("--out", out, "--filters-per-task", 2, "--resume"), capture_output=True, text=True, check=False)
            file.write_bytes(content)
            self.assertEqual((done.returncode, done.stderr.count("\n")), (1, 1), done.stderr)
            self.assertIn("expected the plan of a search" if file.name == "plan.json" else "found others", done.stderr)
        done = subprocess.run(self.cluster("--out", out, "--filters-per-task", 2, "--resume", "--quiet"), capture_output=True, text=True, check=False)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("10 from before", done.stdout)

    def test_a_damaged_frame_is_told_and_options_are_those_of_the_search(self):
        drive = self.folder / "damaged"
        shutil.copytree(self.folder / "drive", drive)
        frame = next((drive / "sequences/00").glob("image_2/*7.png"))
        frame.write_bytes(frame.read_bytes()[:2000])
        what = [str(drive / "sequences/00"), "--model", str(self.models[1]), "--config", "default",
                "--set", "scale.source=ground_truth", "--no-baselines", "--quiet"]
        subprocess.run([PROGRAM, "search", *what, "--exhaustive", "--out", self.folder / "damaged_single"], check=True, capture_output=True)
        done = subprocess.run([RAY, ROOT / "tools/search_cluster.py", *what, "--program", PROGRAM,
                               "--filters-per-task", "2", "--out", self.folder / "damaged_cluster"], capture_output=True, text=True, check=False)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(done.stderr.count(f"warning: {frame}: expected a sound PNG image"), 1, done.stderr)
        table = (self.folder / "damaged_cluster/result/filters.csv").read_bytes()
        self.assertEqual(table, (self.folder / "damaged_single/filters.csv").read_bytes())
        self.assertEqual(len(table.splitlines()), 1 + 4)

    def test_errors(self):
        (self.folder / "text.onnx").write_text("text")
        cases = ((("--model", self.models[0]), "--model: expected each once"),
                 (("--config", "defualt"), "--config: expected a file or one of default, fast, paper, found 'defualt'"),
                 (("--config", self.folder / "none.yaml"), "--config: expected a file, found nothing at"), (("--filters", "0:5"), "inside 0:4 of"),
                 (("--model", "nope"), "--model: expected default, default_filter_2, paper or the path of an .onnx, found 'nope'"),
                 (("--model", self.folder / "text.onnx"), "text.onnx: expected an .onnx file"),
                 (("--program", self.folder / "none"), "expected the program stemvo"),
                 (("--address", "127.0.0.1:1"), "expected a Ray cluster"))
        for options, message in cases:
            done = subprocess.run(self.cluster("--out", self.folder / "none", *options), capture_output=True, text=True, check=False)
            self.assertEqual((done.returncode, done.stderr.count("\n")), (1, 1), done.stderr)
            self.assertIn(message, done.stderr)

    def test_what_the_program_refuses_is_said_once(self):
        done = subprocess.run(self.cluster("--out", self.folder / "refused", "--quiet", "--set", "stem.filtre=3"), capture_output=True,
                              text=True, check=False)
        self.assertEqual(done.returncode, 1)
        self.assertIn("stem.filtre", done.stderr.splitlines()[-1])


if __name__ == "__main__":
    unittest.main()
