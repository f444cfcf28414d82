# SPDX-License-Identifier: MIT
"""report.html of run in Chromium: it draws without a network, hover, wheel and keyboard work."""

import csv
import itertools
import json
import math
import os
import pathlib
import re
import shutil
import subprocess
import pytest

ROOT = pathlib.Path(__file__).resolve().parents[3]
PROGRAM = os.environ.get("STEMVO_PROGRAM", str(ROOT / "build/release/stemvo"))
BROWSER = ROOT / "build/venv-browser/bin/python"
FRAMES = 30
LABEL = r"^frame \d+: [a-z_]+\d+ of \d+ tracks|^(ground truth|map)frame \d+: right -?[\d.]+"


def call(*arguments):
    subprocess.run(list(map(str, [PROGRAM, *arguments])), check=True, capture_output=True)


def look_at(report, *options):
    look = subprocess.run([BROWSER, ROOT / "tests/browser/look_at_report.py", report, *options], capture_output=True, text=True, check=False)
    if look.returncode != 0:
        raise AssertionError(look.stderr)
    return json.loads(look.stdout)


def read_positions(file):
    poses = [list(map(float, line.split())) for line in file.read_text().splitlines()]
    return [(pose[3], pose[7], pose[11]) for pose in poses]


@pytest.mark.skipif(not (BROWSER.exists() and pathlib.Path("/usr/bin/chromium").exists()), reason="tools/setup.sh browser has not run")
class TestReportPage:
    @pytest.fixture(scope="class", autouse=True)
    @classmethod
    def set_up(cls, tmp_path_factory):
        cls.folder = tmp_path_factory.mktemp("of")
        call("synth", cls.folder / "drive", "--frames", FRAMES, "--width", 620, "--height", 188)
        call("run", cls.folder / "drive/sequences/00", "--out", cls.folder / "result", "--quiet")
        cls.found = look_at(cls.folder / "result/report.html")

    def expect_a_sound_page(self, found):
        assert found["errors"] == [] and [url for url in found["requests"] if not url.startswith(("file:", "data:", "blob:"))] == []
        assert all(count > 0 for count in found["points"]), found["points"]
        assert all(count > 1 for count in found["log_ticks"]), found["log_ticks"]
        assert all(len(colours) == 1 for colours in found["colours"].values()), found["colours"]
        for width, seen in found["screens"].items():
            self.expect_a_sound_screen(int(width), seen)
            assert found["light"] != seen["dark"]

    def expect_a_sound_screen(self, width, seen):
        assert seen["width"] <= width
        for fault in ("titles_in_the_way", "hard_to_read", "slider_stays", "wrong_colours", "buttons_over_legend"):
            assert seen[fault] == [], fault
        assert set(seen["at_edges_of_spaces"]) - {0} == set()
        assert all(moved > 20 for moved in seen.get("swiped", [])), seen
        assert all(label and "..." not in label for label in seen["labels"].values()), seen["labels"]
        for heading in ("Path from above", "Path in space"):
            assert re.search(LABEL, seen["labels"][f"{heading}, estimate"])
        x, z = seen["map"]
        for one, other, share in ((x, z, 1.0 if width > 500 else 0.65), (z, x, 0.65)):  # no more ground than the path needs, and a margin
            assert one["axis"] < 1.3 * max(one["path"], share * other["path"]), seen["map"]

    def test_a_recording_without_ground_truth(self):
        images = self.folder / "plain"
        shutil.copytree(self.folder / "drive/sequences/00/image_2", images)
        (self.folder / "camera.yaml").write_text("resolution: [620, 188]\nintrinsics: [359, 359, 303, 92]\ndistortion_model: none\nrate_hz: 10\n")
        call("run", images, "--camera", self.folder / "camera.yaml", "--out", self.folder / "plain_result", "--quiet")
        found = look_at(self.folder / "plain_result/report.html", "--narrow")
        self.expect_a_sound_page(found)
        assert "Path from above" in found["headings"] and "Error over distance" not in found["headings"] and "Command" in found["headings"]

    def test_draws_everything_without_errors_or_a_network(self):
        self.expect_a_sound_page(self.found)
        assert f"frames 0:{FRAMES} of 00" in self.found["title"] and self.found["figures"] == 7
        assert len(self.found["images"]) == 7  # one under the slider
        assert all(width > 100 for width in self.found["images"])
        for caption in self.found["captions"]:
            assert re.search(r"^frame \d+: \w+, \d+ of \d+ matches; flow 0 \(blue\) to \d+ px \(yellow\), outliers red$", caption)
        for heading in ("Path from above", "Numbers", "Error by segment length", "Tracks and state", "Scale and camera", "Command", "Configuration"):
            assert heading in self.found["headings"]

    def test_figures_say_what_the_files_say(self):
        result, traces = self.folder / "result", self.found["traces"]
        with (result / "frames.csv").open() as file:
            rows = list(csv.DictReader(file))
        estimate, truth = (read_positions(path) for path in (result / "trajectory_kitti.txt", self.folder / "drive/poses/00.txt"))
        steps = [math.dist(a, b) for a, b in itertools.pairwise(truth)]
        off = [math.dist(a, b) for a, b in zip(estimate, truth, strict=True)]

        def expect(figure, name, axis, values, digits=3):
            for found, value in zip(traces[figure][name][axis], values, strict=True):
                assert found == pytest.approx(value, abs=0.5 * 10**-digits, rel=0), f"{figure}, {name}, {axis}"

        expect("Path from above", "estimate", "y", [z for _, _, z in estimate])
        expect("Path from above", "ground truth", "x", [x for x, _, _ in truth])
        expect("Path in space", "estimate", "z", [-y for _, y, _ in estimate])
        expect("Error over distance", "position", "x", itertools.accumulate(steps, initial=0.0))
        expect("Error over distance", "position", "y", off)
        expect("Error over distance", "height, too high is above 0", "y", [b[1] - a[1] for a, b in zip(estimate, truth, strict=True)])
        expect("Tracks and state", "inliers", "y", [int(row["inliers"]) for row in rows])
        assert traces["Tracks and state"]["state"]["y"] == [row["state"] for row in rows]
        traces["Scale and camera"]["length of a step"]["y"].pop(0)  # the first frame has none
        expect("Scale and camera", "length of a step", "y", [math.dist(a, b) for a, b in itertools.pairwise(estimate)])
        expect("Scale and camera", "principal point, x", "y", [float(row["cx_px"]) - float(rows[0]["cx_px"]) for row in rows])
        expect("Time per stage", "pose", "y", [float(row["pose_ms"]) for row in rows])
        assert float(re.search(r", ([\d.]+) m off", self.found["by_keyboard"]).group(1)) == pytest.approx(off[2], abs=0.5e-2, rel=0)

    def test_keyboard_hover_and_wheel(self):
        assert self.found["images_under_the_slider"] == [["frame 0", 320], ["frame 10", 320], ["frame 20", 320]]
        assert self.found["by_keyboard"].startswith("frame 2: "), self.found["by_keyboard"]
        assert re.search(f"frame {FRAMES // 2}: [a-z_]+.* m off", self.found["hover"])
        assert self.found["hover"] == self.found["by_hover"].replace(", ", "")
        (left, right), (zoomed_left, zoomed_right) = self.found["zoom"]
        assert zoomed_right - zoomed_left < 0.9 * (right - left) and self.found["scrolled_over_a_chart"] > 50
