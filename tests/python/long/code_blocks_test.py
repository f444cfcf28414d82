# SPDX-License-Identifier: MIT
"""Every code block of the site does what it says: commands run on small rendered drives in place of KITTI's, camera files are loaded,
programs are those that other tests compile and run. A block that is new is run as well; what cannot be is listed with the test that does."""

import os
import pathlib
import re
import shutil
import subprocess

import documented
import numpy as np
import pytest
import yaml
from exporting import random_arrays

ROOT = documented.ROOT
PROGRAM = pathlib.Path(os.environ.get("STEMVO_PROGRAM", ROOT / "build/release/stemvo"))
FRAMES = 25

# Commands that build, install, fetch, or need hours: how they begin, and what runs them, or their tool, instead.
RUN_ELSEWHERE = {
    "make demo": "tests/python/long/code_blocks_test.py",
    "make test": ".ci/run",
    "make build": ".ci/run",
    "ctest --preset": ".ci/run",
    "cmake --preset": ".ci/run",
    "make bench": "tests/python/long/bench_run_test.py",
    "bench/run.py": "tests/python/long/bench_run_test.py",
    "build/release/stemvo_bench": ".ci/run",
    "build/release/tests/stemvo_unit_tests": ".ci/run",
    "STEMVO_BENCH_": ".ci/run",
    "cmake -S examples": "tests/package/install_and_consume.cmake",
    "build/examples/": "tests/package/install_and_consume.cmake",
    "pip install": "tests/python/long/package_test.py",
    "python -m stemvo.view": "tests/python/long/package_test.py",
    "python -m stemvo.bag": "tests/python/bag_test.py",
    "tools/ablation.py": "tests/python/long/ablation_test.py",
    "tools/long_drives.py": "tests/python/long/long_drives_test.py",
    "tools/planted_camera.py": "tests/python/long/long_drives_test.py",
    "stemvo-lab export convnext_xlarge": "tests/lab/export_weights_test.py",
    "stemvo-lab export efficientnetv2-l": "tests/lab/export_weights_test.py",
    "stemvo-lab export resnet50.onnx": "tests/lab/export_graph_test.py",
    "stemvo calibrate": "tests/long/calibrate_test.cpp",  # a short drive does not tell of the camera
    "stemvo-lab warps": "tests/lab/warps_test.py",
    "build/release/stemvo synth build/teacher": "tests/lab/long/default_model_test.py",
    "stemvo-lab learn build/teacher": "tests/lab/long/default_model_test.py",
    "build/lab/bin/ray": "tests/lab/long/ray_test.py",
    "build/lab/bin/stemvo-lab search KITTI/sequences/00 --model stems/a.onnx": "tests/lab/long/ray_test.py",
}
# A reader puts names in these places; the rest makes a command short.
IN_PLACE_OF = [
    (r"--(held-out-)?frames 0:\d+", rf"--\1frames 0:{FRAMES - 1}"),
    (r"\bsynth (.*?)--frames \d+", rf"synth \1--width 620 --height 188 --frames {FRAMES}"),
    (r"for i in 1 2 3;", "for i in 1;"),
    (r"for seed in 7 8;", "for seed in 7;"),
    (r"KITTI/sequences/03 KITTI/sequences/00 streets", "KITTI/sequences/03 streets"),
    (r"street\{7,8\}", "street7"),
    (r"--controls gray,log,census", "--controls gray"),
    (r"\{street,walk\}\{1,2,3\} --objective landing", "{street,walk}1 --objective landing --steps 2"),
    (r"(stemvo-lab robustness (?!.*--kinds).*?) --out", r"\1 --kinds none,rain --out"),
    (r"\bbuild/demo/data/", "KITTI/"),
    (r"--calib refined.txt", "--calib KITTI/sequences/00/calib.txt"),
    (r"( --model stems/(efficientnetv2b0|mobilenet025|resnet18)\.onnx){3}", ""),
    (r"--model (M\b|stems/efficientnetv2b0.onnx)", "--model default"),
    # Ray starts slowly: with README's search, a robustness and ray_test.py it has been tried.
    (r"(stemvo-lab (search .*--model default|robustness KITTI/sequences/03 --kinds).*) --out", r"\1 --no-ray --out"),
    (r"\bNAME\.onnx", "weights.onnx"),
    (r"\bWEIGHTS\b", "weights.npz"),
    (r"\bRECORDING\b", "KITTI/sequences/03"),
    (r"^(memusage|/usr/bin/time -f %R|strace -f -c -e trace=mmap) ", ""),
]


def commands(block):
    """Lines, without what is continued in the next one."""
    return block.text.replace("\\\n", " ").splitlines()


def is_run_elsewhere(command):
    return any(command.startswith(begin) for begin in RUN_ELSEWHERE)


def shortened(command):
    for pattern, text in IN_PLACE_OF:
        command = re.sub(pattern, text, command)
    return command


class TestCodeBlocks:
    @pytest.fixture(scope="class", autouse=True)
    @classmethod
    def set_up(cls, tmp_path_factory):
        cls.drives, cls.temporary = tmp_path_factory.mktemp("drives"), tmp_path_factory
        for options in (["KITTI", "--name", "00"], ["KITTI", "--name", "03", "--seed", "3"]):
            cls.synth(*options, "--width", "620", "--height", "188")
        cls.synth("drive", "--width", "640", "--height", "480")
        (cls.drives / "drive/images").symlink_to("sequences/00/image_2")
        np.savez(cls.drives / "weights.npz", **random_arrays((4, 4), 4, norm="batch"))

    @classmethod
    def synth(cls, name, *options):
        subprocess.run([PROGRAM, "synth", cls.drives / name, "--frames", str(FRAMES), *options], check=True, capture_output=True)

    def new_folder(self, camera):
        """A reader's folder; blocks of a page follow each other in it."""
        folder = self.temporary.mktemp("reader")
        for entry in self.drives.iterdir():
            (folder / entry.name).symlink_to(entry)
        for name in ("models", "tools"):
            (folder / name).symlink_to(ROOT / name)
        (folder / "build/release").mkdir(parents=True)
        (folder / "build/release/stemvo").symlink_to(PROGRAM)
        (folder / "build/lab").symlink_to(ROOT / "build/lab")
        (folder / "docs/images").mkdir(parents=True)
        (folder / "camera.yaml").write_text(camera.text)
        shutil.copy(ROOT / "examples/ci/thresholds.yaml", folder / "thresholds.yaml")
        return folder

    def run_script(self, script, folder):
        shutil.rmtree(folder / "result", ignore_errors=True)
        return subprocess.run(["bash", "-euo", "pipefail", "-c", script], cwd=folder, capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL,
                              env={**os.environ, "PATH": f"{PROGRAM.parent}:{ROOT}/build/lab/bin:{os.environ['PATH']}"})

    def cameras(self):
        return [block for block in documented.blocks("yaml") if "intrinsics" in yaml.safe_load(block.text)]

    def test_commands(self, subtests):
        (camera,) = self.cameras()
        num_run = 0
        folders = {}
        for block in documented.blocks(""):
            lines = [shortened(line) for line in commands(block) if not is_run_elsewhere(line)]
            if not any(lines):
                continue
            num_run += 1
            with subtests.test(block.place):
                page = block.place.split(":")[0]
                folders[page] = folders.get(page) or self.new_folder(camera)
                done = self.run_script("\n".join(lines), folders[page])
                assert done.returncode == 0, f"{block.place}: {lines}\n{done.stderr[-2000:]}"
        assert num_run > 15

    def test_the_demo(self):
        # `make demo` does this with a program that is built.
        done = subprocess.run([ROOT / "tools/demo.sh"], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        assert "build/demo/out/report.html" in done.stdout and (ROOT / "build/demo/out/map.ply").exists()

    def test_camera_files(self):
        for block in documented.blocks("yaml"):
            assert block in self.cameras(), "a kind of file that this test does not load"
            done = self.run_script("stemvo run drive/images --camera camera.yaml --frames 0:3 --out result", self.new_folder(block))
            assert done.returncode == 0, done.stderr

    def test_programs_are_examples_that_are_compiled(self):
        compiled = {file.read_text().split("\n", 1)[1] for file in (ROOT / "examples").glob("*.cpp")}  # CMake takes them all
        for block in documented.blocks("cpp"):
            assert block.text in compiled, f"{block.place}: no program of examples/, which the test `package` compiles and runs"

    def test_nothing_else_is_code(self):
        # python: all of them are run by package_test.py; cmake: by package/clean_root.sh. text and mermaid: nothing to run.
        assert {block.language for block in documented.blocks()} <= {"", "cmake", "cpp", "mermaid", "python", "text", "yaml"}
        assert [block.place for block in documented.blocks("text") if re.search(r"\b(stemvo|make|tools|build)\b", block.text)] == []

    def test_what_runs_elsewhere_is_still_there(self):
        lines = [line for block in documented.blocks("") for line in commands(block)]
        for begin, test in RUN_ELSEWHERE.items():
            assert any(line.startswith(begin) for line in lines), f"{begin}: on no page any more"
            assert (ROOT / test).exists(), test
