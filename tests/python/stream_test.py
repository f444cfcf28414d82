# SPDX-License-Identifier: MIT
"""`stemvo run --stream` through a pipe, and recordings behind an address."""

import functools
import http.server
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import threading
import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
PROGRAM = pathlib.Path(os.environ.get("STEMVO_PROGRAM", ROOT / "build/release/stemvo"))
FRAMES = 60


class TestStream:
    @pytest.fixture(scope="class", autouse=True)
    @classmethod
    def set_up(cls, tmp_path_factory):
        cls.folder = tmp_path_factory.mktemp("of")
        subprocess.run([PROGRAM, "synth", cls.folder / "drive", "--frames", str(FRAMES), "--width", "320", "--height", "96"], check=True, capture_output=True)
        cls.drive = cls.folder / "drive/sequences/00"

    def start(self, *more, **pipes):
        command = [PROGRAM, "run", self.drive, "--stream", "--out", self.folder / "result", *more]
        return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **pipes)

    def poses(self):
        return [[float(x) for x in line.split()] for line in (self.folder / "result/trajectory_tum.txt").read_text(encoding="utf-8").splitlines()]

    def test_a_line_per_frame_while_it_runs_and_nothing_else(self):
        with self.start() as run:
            first = run.stdout.readline()
            assert run.poll() is None, "the first line comes before the end"
            rest, said = run.communicate(timeout=120)
        assert run.returncode == 0, said
        assert "report: " in said
        rows = [json.loads(line) for line in (first + rest).splitlines()]
        assert [row["frame"] for row in rows] == list(range(FRAMES))
        for row, pose in zip(rows, self.poses()):
            assert row["timestamp_s"] == pytest.approx(pose[0], abs=0.5e-6, rel=0)
            for number, expected in zip([*row["position"], *row["quaternion_xyzw"]], pose[1:]):
                assert number == pytest.approx(expected, abs=0.5e-6, rel=0)
        assert ({key: type(value) for key, value in rows[-1].items()} == {
            "frame": int, "timestamp_s": float, "state": str, "is_measured": bool, "position": list, "quaternion_xyzw": list, "step_variances": list,
            "scale_state": str, "map_id": int, "is_scale_new": bool, "map_from_world": dict})
        assert rows[-1]["state"] == "tracking" and len(rows[-1]["step_variances"]) == 6

    def test_the_example_reads_them(self):
        self.drive = shutil.copytree(self.drive, self.folder / "broken")
        (self.drive / "image_2/000000.png").write_bytes(b"")
        with self.start("--quiet", "--frames", "0:20") as run:
            example = subprocess.run([sys.executable, ROOT / "examples/follow_stream.py"], stdin=run.stdout, capture_output=True, text=True, check=True)
        lines = example.stdout.splitlines()
        assert len(lines) == 20 and re.search(r"^[0-9.]+ s, \w+: -?[0-9.]+ -?[0-9.]+ -?[0-9.]+, step \+- [0-9.]+$", lines[-1])

    def test_results_are_written_when_nobody_reads_any_more(self):
        with self.start() as run:
            run.stdout.readline()
            run.stdout.close()
            said = run.stderr.read()
        assert run.returncode == 130, said
        assert "warning: interrupted; the results hold the first" in said and self.poses()

    def test_not_beside_json(self):
        done = subprocess.run([PROGRAM, "run", self.drive, "--stream", "--json"], capture_output=True, text=True, check=False)
        assert (done.returncode, done.stdout) == (2, ""), done.stderr


class TestAddress:
    @pytest.fixture(autouse=True)
    def set_up(self, tmp_path):
        self.folder = tmp_path
        subprocess.run([PROGRAM, "synth", self.folder / "drive", "--frames", "12", "--width", "320", "--height", "96"], check=True, capture_output=True)
        self.images = sorted((self.folder / "drive/sequences/00/image_2").glob("*.png"))
        (self.folder / "camera.yaml").write_text("resolution: [320, 96]\nintrinsics: [185, 185, 159.5, 47.5]\ndistortion_model: none\n", encoding="utf-8")
        video = self.folder / "served/drive.avi"
        video.parent.mkdir()
        subprocess.run([PROGRAM.parent / "tests/stemvo_write_video", video, "10", *self.images], check=True, capture_output=True)

        server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(http.server.SimpleHTTPRequestHandler, directory=video.parent))
        threading.Thread(target=server.serve_forever, daemon=True).start()
        self.address = f"http://user:secret@127.0.0.1:{server.server_port}"
        yield
        server.shutdown()
        server.server_close()

    def run_on(self, recording, name, *more, **where):
        command = [PROGRAM, "run", recording, "--camera", self.folder / "camera.yaml", "--out", self.folder / name, *more]
        return subprocess.run(command, capture_output=True, text=True, check=False, **where)

    def test_a_video_behind_an_address_is_the_same_video(self):
        served = self.run_on(f"{self.address}/drive.avi?password=secret", "served_result", "--video", "cam:1.mkv", cwd=self.folder)
        assert served.returncode == 0, served.stderr
        assert "input: video drive" in served.stderr and (self.folder / "cam:1.mkv").stat().st_size > 0
        local = self.run_on(self.folder / "served/drive.avi", "local_result")
        assert local.returncode == 0, local.stderr
        for name in ("trajectory_tum.txt", "trajectory_map_tum.txt"):
            assert (self.folder / "served_result" / name).read_bytes() == (self.folder / "local_result" / name).read_bytes()
        texts = [path.read_text(encoding="utf-8") for path in (self.folder / "served_result").iterdir() if path.suffix in {".html", ".json", ".yaml", ".txt", ".csv"}]
        assert len(texts) > 5
        for text in [served.stdout, served.stderr, *texts]:
            assert "secret" not in text

    def test_nothing_there_is_one_line(self):
        done = self.run_on(f"{self.address}/none.avi", "none")
        assert done.returncode == 1
        assert re.search(r"^error: http://\*\*\*@[^\n]*none.avi: expected a stream of pictures that FFmpeg can decode, found none\n$", done.stderr)
