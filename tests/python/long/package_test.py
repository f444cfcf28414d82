# SPDX-License-Identifier: MIT
"""The Python package as a user gets it: the wheel that `pip install .` makes (tools/wheel.sh; CTest makes it first) in a fresh
environment, the page's program, and the program's own trajectory byte for byte."""

import csv
import itertools
import json
import os
import pathlib
import shutil
import subprocess
import sys

import documented
import PIL.Image
from package_scripts import FITTED, FOUND, RUN, TRACK, VIDEO
import pytest

ROOT = pathlib.Path(__file__).resolve().parents[3]
PROGRAM = os.environ["STEMVO_PROGRAM"]
FRAMES = 12
CAMERA = ("fx", "cx", "cy", "fx_sigma", "cx_sigma", "cy_sigma")
OPTIONS = {"camera_file": "--camera", "frames": "--frames", "ground_truth": "--gt", "tolerance_s": "--gt-tolerance", "times": "--times", "masks": "--mask"}


def call(*command, **options):
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, **options)
    if done.returncode != 0:
        raise AssertionError(f"{command[:3]}: {done.returncode}\n{done.stdout[-3000:]}{done.stderr[-3000:]}")
    return done.stdout


class TestPackage:
    @pytest.fixture(scope="class", autouse=True)
    @classmethod
    def set_up(cls, tmp_path_factory):
        cls.folder = tmp_path_factory.mktemp("of")
        call(sys.executable, "-m", "venv", cls.folder / "venv")
        cls.python = cls.folder / "venv/bin/python"
        (wheel,) = (ROOT / "build/wheel_as_built").glob("stemvo-*.whl")
        call(cls.python, "-m", "pip", "install", "--disable-pip-version-check", "--no-input", "--no-compile", f"{wheel}[bag,video,view]", "mypy==2.4.1",
             env={**os.environ, "PYTHONPATH": ""})
        call(PROGRAM, "synth", cls.folder / "drive", "--frames", FRAMES, "--width", 620, "--height", 188)

    def run_python(self, program, *arguments):
        # Neither the checkout nor the tools: only what was installed.
        return call(self.python, "-I", "-c", program, *arguments, cwd=self.folder)

    def compare(self, recording, **more):
        """Compares the program with Python on a recording; `more`: as read_recording takes it."""
        program, python = self.folder / "by_program", self.folder / "by_python"
        for folder in (program, python):
            shutil.rmtree(folder, ignore_errors=True)
        python.mkdir()
        options = [text for key, value in more.items() for one in (value if isinstance(value, list) else [value]) for text in (OPTIONS[key], one)]
        call(PROGRAM, "run", recording, "--out", program, "--quiet", *options)
        done = json.loads(self.run_python(TRACK, python, recording, json.dumps(more, default=str)))
        name = "trajectory_kitti.txt"
        rows = list(csv.DictReader((program / "frames.csv").read_text().splitlines()))
        is_seen = [row["state"] != "no_image" for row in rows]  # Python leaves out what cannot be read
        rows = list(itertools.compress(rows, is_seen))
        lines = (python / name).read_text().splitlines(), list(itertools.compress((program / name).read_text().splitlines(), is_seen))
        if all(is_seen):
            assert lines[0] == lines[1], f"{recording}: {name}"
        for ours, its in zip(*([float(word) for line in side for word in line.split()] for side in lines), strict=True):
            assert ours == pytest.approx(its, abs=0.01, rel=0)  # the program has a row for an image it cannot read, Python a gap
        states = [[row["state"], int(row["matches"]), int(row["inliers"]), row["scale_state"], float(row["timestamp_s"]), *(row[f"{key}_px"] for key in CAMERA)] for row in rows]
        assert done["states"] == states, recording
        metrics = json.loads((program / "metrics.json").read_text())
        assert done["scale_source"] == metrics["scale_source"], recording
        if done["errors"]:  # the keys and shapes of metrics.json; of matrices where the program has quaternions
            mine, expected = ((e | e["ate_rmse_m"] | {"ate_rmse_m": sorted(e["ate_rmse_m"])} for e in (done["errors"], metrics)))
            for key, error in mine.items():
                assert abs(error - expected[key]) < 1e-9 if isinstance(error, float) else error == expected[key], f"{recording}: {key}"
            assert list(done["errors"]) == [key for key in metrics if key in done["errors"]]
        assert (done["true_frames"] is None) == (metrics["ate_rmse_m"] is None), recording
        return done

    def camera_file(self, name, size, *more):
        """The file of the rendered drive's camera, for images of another size."""
        numbers = next(line for line in (self.folder / "drive/sequences/00/calib.txt").read_text().splitlines() if line.startswith("P2:")).split()
        scale = size[0] / 620
        intrinsics = [scale * float(numbers[i]) for i in (1, 6, 3, 7)]
        file = self.folder / name
        file.write_text(f"resolution: {list(size)}\nintrinsics: {intrinsics}\n" + "".join(f"{line}\n" for line in more))
        return file

    def test_kitti(self):
        sequence = self.folder / "drive/sequences/00"
        done = self.compare(sequence)
        assert [done["scale_source"], len(done["states"])] == ["camera_height", FRAMES]
        assert len(self.compare(sequence, frames="2:9", masks=["0,150,620,38"])["states"]) < FRAMES

    def test_a_folder_of_images(self):
        images = self.folder / "plain"
        shutil.copytree(self.folder / "drive/sequences/00/image_2", images)
        (images / "000005.png").write_bytes(b"no image")
        times = self.folder / "times.txt"
        times.write_text("".join(f"{100 + 0.1 * i}\n" for i in range(FRAMES)))
        truth = self.folder / "truth.txt"
        poses = [line.split() for line in (self.folder / "drive/poses/00.txt").read_text().splitlines()]
        truth.write_text("".join(f"{100.02 + 0.1 * i} {pose[3]} {pose[7]} {pose[11]} 0 0 0 1\n" for i, pose in enumerate(poses) if i not in (0, 5)))
        lens = ("distortion_model: radial-tangential", "distortion_coefficients: [-0.1, 0.02, 0.001, 0.0]")
        unknown = self.compare(images, camera_file=self.camera_file("lens.yaml", (620, 188), *lens), times=times, ground_truth=truth, tolerance_s=0.03)
        assert [unknown["scale_source"], unknown["true_frames"]] == ["none", [i for i in range(FRAMES) if i not in (0, 5)]]
        assert len(unknown["states"]) == FRAMES - 1
        known = self.compare(images, camera_file=self.camera_file("height.yaml", (620, 188), *lens, "camera_height: 1.65"), times=times)
        assert [known["scale_source"], known["true_frames"]] == ["camera_height", None]

    def test_large_frames(self):
        large = self.folder / "large"
        large.mkdir()
        for file in sorted((self.folder / "drive/sequences/00/image_2").glob("*.png"))[:5]:
            PIL.Image.open(file).resize((2480, 752)).save(large / file.name)
        self.compare(large, camera_file=self.camera_file("large.yaml", (2480, 752), "distortion_model: none", "rate_hz: 10"), masks=["0,600,2480,152"])

    @pytest.mark.skipif(not ("STEMVO_SHARED_DATA" in os.environ), reason="STEMVO_SHARED_DATA is not set")
    def test_real_recordings(self):
        data = pathlib.Path(os.environ["STEMVO_SHARED_DATA"])
        camera = self.folder / "freiburg2.yaml"  # as its authors publish it
        camera.write_text("resolution: [640, 480]\nintrinsics: [520.9, 521.0, 325.1, 249.7]\ndistortion_model: radial-tangential\n"
                          "distortion_coefficients: [0.2312, -0.7849, -0.0033, -0.0001, 0.9172]\n")
        for recording, more in (("kitti/sequences/03", {"frames": "0:20"}), ("euroc", {}), ("tum", {"camera_file": camera}), ("handheld", {"frames": "0:20"})):
            self.compare(data / recording, **more)

    def test_a_video(self):
        video, mask = self.folder / "drive.avi", "0,150,620,38"
        camera = self.camera_file("camera.yaml", (620, 188), "distortion_model: none", "camera_height: 1.65")
        tracked = self.run_python(VIDEO, self.folder / "drive/sequences/00/image_2", video, camera, mask)
        call(PROGRAM, "run", video, "--camera", camera, "--mask", mask, "--out", self.folder / "video", "--quiet")
        assert tracked == (self.folder / "video/trajectory_kitti.txt").read_text() and tracked.count("\n") == FRAMES

    def test_the_page(self):
        self.test_a_video()  # which leaves drive.avi and camera.yaml
        said = "".join(self.run_python(block.text) for block in documented.blocks("python"))
        assert "tracking" in said and "ate_rmse_m" in said

    def test_the_view_is_where_the_report_is(self):
        self.run_python(FITTED)

    def test_the_viewer_of_an_environment_that_is_not_active(self):
        self.run_python(FOUND)

    def view(self, *arguments):
        return subprocess.run(list(map(str, [self.python, "-I", "-m", "stemvo.view", *arguments])),
                              capture_output=True, text=True, cwd=self.folder, timeout=300)

    def test_view(self):
        sequence = self.folder / "drive/sequences/00"
        call(PROGRAM, "run", sequence, "--out", self.folder / "seen")
        for name, arguments in {"live": ["--live", sequence],
                                "result": [self.folder / "seen", "--recording", sequence]}.items():
            file = self.folder / f"{name}.rrd"
            done = self.view(*arguments, "--save", file)
            assert done.returncode == 0, done.stderr
            written = file.read_bytes()
            for entity in (b"/world/truth", b"/world/estimate/camera/image", b"/world/estimate/path/0", b"/plots/inliers", b"/state"):
                assert entity in written, name
        for arguments, text in ((["/nowhere"], "/nowhere/trajectory_kitti.txt"), ([], "expected RESULT"),
                                (["--live", sequence, "--set", "stem.filtre=1"], "stem.filtre: unknown key")):
            done = self.view(*arguments, "--save", self.folder / "bad.rrd")
            assert done.returncode != 0 and text in done.stderr and "Traceback" not in done.stderr

    def test_a_wheel_that_needs_no_library_of_the_system(self):
        (wheel,) = (ROOT / "build/wheel").glob("stemvo-*manylinux*.whl")
        call(sys.executable, "-m", "venv", self.folder / "clean")
        python = self.folder / "clean/bin/python"
        call(python, "-m", "pip", "install", "--disable-pip-version-check", "--no-input", wheel)
        code = "import stemvo; print(len(stemvo.read_recording(%r))); print(open('/proc/self/maps').read())" % str(self.folder / "drive/sequences/00")
        done = subprocess.run([python, "-I", "-c", code], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        assert done.stdout.startswith(f"{FRAMES}\n"), done.stdout[:100]
        assert wheel.stat().st_size < 40e6
        for name in ("libavcodec", "libgdal"):  # what videos need, and GPL's codecs
            assert name not in done.stdout
        for name in ("libopencv_core", "libonnxruntime", "libspng"):
            loaded = [line for line in done.stdout.splitlines() if name in line]
            assert loaded, name
            assert all(str(self.folder) in line for line in loaded), loaded[0]

    def test_run(self):
        self.run_python(RUN, self.folder / "drive/sequences/00")

    def test_types(self):
        folder = pathlib.Path(self.run_python("import stemvo; print(stemvo.__path__[0])").strip())
        assert (folder / "py.typed").exists()
        for block in documented.blocks("python"):
            call(self.python, "-m", "mypy", "--strict", "--ignore-missing-imports", "-c", block.text, cwd=self.folder)
