# SPDX-License-Identifier: MIT
"""The Python package as a user gets it: `pip install .` into a fresh environment, the page's program,
the program's own trajectory byte for byte, and bad input."""

import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

import documented

ROOT = pathlib.Path(__file__).resolve().parents[2]
PROGRAM = os.environ["STEMVO_PROGRAM"]
FRAMES = 12

TRAJECTORY = """
import sys, stemvo
recording = stemvo.read_recording(sys.argv[1])
odometry = stemvo.Odometry(recording.camera)
for image, timestamp in recording:
    result = odometry.process(image, timestamp)
    assert result.timestamp == timestamp and result.state and result.num_matches >= 0
    print(*(f"{value + 0.0:.12e}" for value in result.world_from_camera[:3].ravel()))  # as KITTI's file is written
"""

# Each line must raise ValueError, or what stands behind it, with one line that holds the text.
BAD_INPUT = """
import sys, numpy as np, stemvo
camera = stemvo.Camera(500, 500, 320, 94, 640, 188)
odometry = stemvo.Odometry(camera)
gray = np.zeros((188, 640), np.uint8)
poses = np.tile(np.eye(4), (5, 1, 1))
cases = [
    (lambda: odometry.process(gray[:100]), "expected 640x188 pixels"),
    (lambda: odometry.process(gray.astype(np.float32)), "uint8"),
    (lambda: odometry.process(np.zeros((188, 640, 4), np.uint8)), "found 188x640x4"),
    (lambda: odometry.process(np.uint8(3)), "image"),
    (lambda: odometry.process(np.zeros((0, 640), np.uint8)), "expected 640x188"),
    (lambda: odometry.process(gray[:, ::-1]), "side by side"),
    (lambda: odometry.process(gray[::-1]), "side by side"),
    (lambda: odometry.process(np.broadcast_to(np.uint8(1), (188, 640))), "side by side"),
    (lambda: odometry.process("image"), "process"),
    (lambda: stemvo.Odometry(stemvo.Camera(-1, 500, 320, 94, 640, 188)), "camera: expected focal lengths"),
    (lambda: stemvo.Odometry(camera, {"stem.filtre": 1}), "stem.filtre: "),
    (lambda: stemvo.Odometry(camera, {"features.max_features": "many"}), "features.max_features: expected"),
    (lambda: stemvo.Odometry(camera, {"stem.filter": float("nan")}), "stem.filter: expected"),
    (lambda: stemvo.Odometry(camera, {"stem.model": "no such"}), "no such"),
    (lambda: stemvo.Odometry(camera, {"scale.source": "ground_truth"}), "scale.source: expected"),
    (lambda: stemvo.Odometry(camera, 3), "options: expected"),
    (lambda: stemvo.Options.load("/nowhere.yaml"), "/nowhere.yaml"),
    (lambda: stemvo.read_recording("/nowhere"), "/nowhere"),
    (lambda: stemvo.evaluate("/nowhere", poses), "/nowhere"),
    (lambda: stemvo.evaluate(poses, poses[:4]), "expected 4 poses"),
    (lambda: stemvo.evaluate(poses * 2.0, poses), "estimate[0]: expected a rotation"),
    (lambda: stemvo.evaluate(poses, poses, align="up"), "up"),
]
for number, (call, text) in enumerate(cases):
    try:
        call()
    except (ValueError, TypeError) as error:
        said = str(error)
        assert text in said, (number, text, said)
        assert "\\n" not in said or isinstance(error, TypeError), (number, said)
    else:
        raise SystemExit(f"case {number} ({text}): expected an error, found none")
assert odometry.process(gray).state and odometry.process(None).state == "no_image"  # it still works
assert stemvo.evaluate(poses, poses)["ate_rmse_m"] == 0.0
"""


def call(*command, **options):
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, **options)
    if done.returncode != 0:
        raise AssertionError(f"{command[:3]}: {done.returncode}\n{done.stdout[-3000:]}{done.stderr[-3000:]}")
    return done.stdout


class Package(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.folder = pathlib.Path(folder.name)
        call(sys.executable, "-m", "venv", cls.folder / "venv")
        cls.python = cls.folder / "venv/bin/python"
        call(cls.python, "-m", "pip", "install", "--disable-pip-version-check", "--no-input", f"{ROOT}[bag,view]",
             env={**os.environ, "PYTHONPATH": "", "CMAKE_BUILD_PARALLEL_LEVEL": str(os.cpu_count())})
        call(PROGRAM, "synth", cls.folder / "drive", "--frames", FRAMES, "--width", 620, "--height", 188)

    def run_python(self, program, *arguments):
        # Neither the checkout nor the tools: only what was installed.
        return call(self.python, "-I", "-c", program, *arguments, cwd=self.folder)

    def test_same_trajectory_as_the_program(self):
        sequence = self.folder / "drive/sequences/00"
        call(PROGRAM, "run", sequence, "--out", self.folder / "out")
        expected = (self.folder / "out/trajectory_kitti.txt").read_text()
        self.assertEqual(self.run_python(TRAJECTORY, sequence), expected)
        lines = expected.splitlines()
        self.assertEqual(len(lines), FRAMES)
        self.assertNotEqual(lines[0], lines[-1])

    def test_the_page(self):
        said = "".join(self.run_python(block.text) for block in documented.blocks("python"))
        self.assertIn("tracking", said)
        self.assertIn("ate_rmse_m", said)

    def view(self, *arguments):
        return subprocess.run(list(map(str, [self.python, "-I", "-m", "stemvo.view", *arguments])),
                              capture_output=True, text=True, cwd=self.folder, timeout=300)

    def test_view(self):
        sequence = self.folder / "drive/sequences/00"
        call(PROGRAM, "run", sequence, "--out", self.folder / "seen", "--map")
        for name, arguments in {"live": ["--live", sequence],
                                "result": [self.folder / "seen", "--recording", sequence]}.items():
            file = self.folder / f"{name}.rrd"
            done = self.view(*arguments, "--save", file)
            self.assertEqual(done.returncode, 0, done.stderr)
            written = file.read_bytes()
            for entity in (b"/world/camera/image", b"/world/path/0", b"/plots/inliers", b"/state"):
                self.assertIn(entity, written, name)
        for arguments, text in ((["/nowhere"], "/nowhere/trajectory_kitti.txt"), ([], "expected RESULT"),
                                (["--live", sequence, "--set", "stem.filtre=1"], "stem.filtre: unknown key")):
            done = self.view(*arguments, "--save", self.folder / "bad.rrd")
            self.assertNotEqual(done.returncode, 0)
            self.assertIn(text, done.stderr)
            self.assertNotIn("Traceback", done.stderr)

    def test_bag(self):
        # What it reads: bag_test.py.
        done = subprocess.run([self.python, "-I", "-m", "stemvo.bag", "/nowhere.bag", self.folder / "bag"], capture_output=True, text=True, check=False)
        self.assertEqual((done.returncode, done.stdout), (1, ""))
        self.assertRegex(done.stderr, "^error: /nowhere.bag: [^\n]+\n$")

    def test_a_wheel_that_needs_no_library_of_the_system(self):
        wheels = self.folder / "wheels"
        call(ROOT / "tools/wheel.sh", wheels)
        (wheel,) = wheels.glob("*.whl")
        self.assertIn("manylinux", wheel.name)
        call(sys.executable, "-m", "venv", self.folder / "clean")
        python = self.folder / "clean/bin/python"
        call(python, "-m", "pip", "install", "--disable-pip-version-check", "--no-input", wheel)
        code = "import stemvo; print(len(stemvo.read_recording(%r))); print(open('/proc/self/maps').read())" % str(self.folder / "drive/sequences/00")
        done = subprocess.run([python, "-I", "-c", code], capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertTrue(done.stdout.startswith(f"{FRAMES}\n"), done.stdout[:100])
        for name in ("libopencv_core", "libavcodec", "libonnxruntime", "libdeflate"):
            loaded = [line for line in done.stdout.splitlines() if name in line]
            self.assertTrue(loaded, name)
            self.assertTrue(all(str(self.folder) in line for line in loaded), loaded[0])

    def test_bad_input(self):
        self.run_python(BAD_INPUT)

    def test_types(self):
        folder = pathlib.Path(self.run_python("import stemvo; print(stemvo.__path__[0])").strip())
        self.assertTrue((folder / "py.typed").exists())
        self.assertIn("def process(self, image", (folder / "_core.pyi").read_text())


if __name__ == "__main__":
    unittest.main()
