# SPDX-License-Identifier: MIT
"""The files for people who cite, copy or change the project: they parse, and their commands work."""

import os
import pathlib
import re
import shutil
import subprocess
import sys

import yaml
import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
PROGRAM = pathlib.Path(os.environ.get("STEMVO_PROGRAM", ROOT / "build/release/stemvo"))


class TestEvaluation:
    """examples/evaluate.py: the truth has no error, what is no trajectory is refused with the program's own line."""

    def evaluate(self, *arguments):
        environment = {**os.environ, "PATH": f"{PROGRAM.parent}:{os.environ['PATH']}"}
        return subprocess.run([sys.executable, ROOT / "examples/evaluate.py", *arguments], env=environment, capture_output=True, text=True,
                              check=False)

    def test_evaluates_without_a_run(self, tmp_path):
        poses = tmp_path / "poses.txt"
        poses.write_text("".join(f"1 0 0 {i % 3} 0 1 0 0 0 0 1 {i}\n" for i in range(30)))
        done = self.evaluate(poses, poses)
        assert (done.returncode, done.stdout) == (0, f"{poses}: ATE 0.0000 m, RPE 0.0000 m and 0.0000 deg a frame\n"), done.stderr
        refused = self.evaluate(poses, ROOT / "LICENSE")
        assert (refused.returncode, refused.stdout) == (1, "") and re.search("^error: .*LICENSE:1: [^\n]+\n$", refused.stderr)


class TestMoved:
    """`make build` drops the configuration of a checkout that lay elsewhere, and no other."""

    def test_a_moved_checkout_is_configured_anew(self, tmp_path):
        base = tmp_path.resolve()
        there, elsewhere, linked = base / "there", base / "elsewhere", base / "linked"
        for checkout in (there, elsewhere):
            (checkout / "build/release/CMakeFiles").mkdir(parents=True)
        linked.symlink_to(there)
        (there / "tools").mkdir()
        shutil.copy(ROOT / "Makefile", there)
        for script, text in (("tools/setup.sh", "mkdir -p build/setup"), ("cmake", "ls build/release >>seen")):
            (there / script).write_text(f"#!/bin/sh\n{text}\n")
            (there / script).chmod(0o755)
        for home, is_kept in ((there, True), (linked, True), (elsewhere, False), (base / "gone", False)):
            cache = there / "build/release/CMakeCache.txt"
            cache.write_text(f"A:STRING=1\nCMAKE_HOME_DIRECTORY:INTERNAL={home}\n")
            (there / "build/release/CMakeFiles").mkdir(exist_ok=True)
            subprocess.run(["make", "--silent", "build"], cwd=there, check=True, capture_output=True, env={**os.environ, "PATH": f"{there}:{os.environ['PATH']}"})
            assert cache.exists() == is_kept, home
            assert (there / "build/release/CMakeFiles").exists() == is_kept, home


class TestContinuousIntegration:
    """The job's steps, in order, as its shell runs them; what builds the program has been done."""

    @pytest.fixture(autouse=True)
    def set_up(self, tmp_path):
        self.folder = tmp_path
        shutil.copytree(ROOT / "examples/ci", self.folder / "examples/ci")
        job = yaml.safe_load((ROOT / "examples/ci/stemvo_check.yml").read_text())["jobs"]["accuracy"]
        self.commands = {step["name"]: step["run"] for step in job["steps"] if "run" in step}

    def run_step(self, name):
        environment = {**os.environ, "PATH": f"{PROGRAM.parent}:{os.environ['PATH']}"}
        return subprocess.run(["bash", "-e", "-c", self.commands[name]], cwd=self.folder, env=environment, capture_output=True,
                              text=True, check=False)

    def test_passes_as_it_is_and_fails_on_a_bound(self):
        names = list(self.commands)
        assert (names[0], names[-1]) == ("Build", "Check") and self.commands["Build"].startswith("make build\n")
        for name in names[1:]:
            done = self.run_step(name)
            assert done.returncode == 0, f"{name}: {done.stdout}{done.stderr}"
        thresholds = self.folder / "examples/ci/thresholds.yaml"
        thresholds.write_text(thresholds.read_text().replace("{min: 10}", "{min: 10000}"))
        assert self.run_step("Check").returncode == 1
