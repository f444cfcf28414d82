# SPDX-License-Identifier: MIT
"""The files for people who cite, copy or change the project: they parse, and their commands work."""

import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

import yaml

ROOT = pathlib.Path(__file__).resolve().parents[2]
PROGRAM = pathlib.Path(os.environ.get("STEMVO_PROGRAM", ROOT / "build/release/stemvo"))


class Evaluation(unittest.TestCase):
    """examples/evaluate.py: the truth has no error, what is no trajectory is refused with the program's own line."""

    def evaluate(self, *arguments):
        environment = {**os.environ, "PATH": f"{PROGRAM.parent}:{os.environ['PATH']}"}
        return subprocess.run([sys.executable, ROOT / "examples/evaluate.py", *arguments], env=environment, capture_output=True, text=True,
                              check=False)

    def test_evaluates_without_a_run(self):
        with tempfile.TemporaryDirectory() as folder:
            poses = pathlib.Path(folder) / "poses.txt"
            poses.write_text("".join(f"1 0 0 {i % 3} 0 1 0 0 0 0 1 {i}\n" for i in range(30)))
            done = self.evaluate(poses, poses)
            self.assertEqual((done.returncode, done.stdout), (0, f"{poses}: ATE 0.0000 m, RPE 0.0000 m and 0.0000 deg a frame\n"), done.stderr)
            refused = self.evaluate(poses, ROOT / "LICENSE")
        self.assertEqual((refused.returncode, refused.stdout), (1, ""))
        self.assertRegex(refused.stderr, "^error: .*LICENSE:1: [^\n]+\n$")


class ContinuousIntegration(unittest.TestCase):
    """The job's steps, in order, as its shell runs them; what builds the program has been done."""

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        shutil.copytree(ROOT / "examples/ci", self.folder / "examples/ci")
        job = yaml.safe_load((ROOT / "examples/ci/stemvo_check.yml").read_text())["jobs"]["accuracy"]
        self.commands = {step["name"]: step["run"] for step in job["steps"] if "run" in step}

    def run_step(self, name):
        environment = {**os.environ, "PATH": f"{PROGRAM.parent}:{os.environ['PATH']}"}
        return subprocess.run(["bash", "-e", "-c", self.commands[name]], cwd=self.folder, env=environment, capture_output=True,
                              text=True, check=False)

    def test_passes_as_it_is_and_fails_on_a_bound(self):
        names = list(self.commands)
        self.assertEqual((names[0], names[-1]), ("Build", "Check"))
        self.assertTrue(self.commands["Build"].startswith("make build\n"))
        for name in names[1:]:
            done = self.run_step(name)
            self.assertEqual(done.returncode, 0, f"{name}: {done.stdout}{done.stderr}")
        thresholds = self.folder / "examples/ci/thresholds.yaml"
        thresholds.write_text(thresholds.read_text().replace("{min: 10}", "{min: 10000}"))
        self.assertEqual(self.run_step("Check").returncode, 1)


if __name__ == "__main__":
    unittest.main()
