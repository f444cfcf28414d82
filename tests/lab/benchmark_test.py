# SPDX-License-Identifier: MIT
"""stemvo-lab benchmark: what `stemvo run` measures, kept, beside zero motion and, where they belong, published numbers."""

import json
import os
import subprocess

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner
from small_kitti import write_sequence
from stemvo.lab import benchmark, runs, search
from stemvo.lab.cli import main

GRAY = ("--set", "stem.model=gray", "--config", "default")


@pytest.fixture
def kitti(tmp_path):
    for name in ("03", "street"):
        write_sequence(tmp_path / "kitti", name)
    return tmp_path / "kitti"


def call(kitti, out, *arguments, code=0):
    answer = CliRunner().invoke(main, ["benchmark", str(kitti), "--out", str(out), *arguments])
    assert answer.exit_code == code, answer.output
    return pd.read_csv(out / "benchmark.csv") if (out / "benchmark.csv").exists() else answer.output


def computed(monkeypatch):
    """Titles of the runs that are computed from now on."""
    titles, compute = [], runs._compute
    monkeypatch.setattr(runs, "_compute", lambda method, sequence, *rest: (titles.append(f"{sequence.name} {method.title}"),
                                                                          compute(method, sequence, *rest))[1])
    return titles


def test_the_numbers_and_bytes_are_those_of_run(kitti, tmp_path):
    call(kitti, tmp_path / "out", *GRAY)
    for scale, source in ((runs.ROAD, "camera_height"), (runs.TRUE_STEPS, "ground_truth")):
        subprocess.run([os.environ["STEMVO_PROGRAM"], "run", kitti / "sequences/03", "--set", "stem.model=gray", "--set", f"scale.source={source}",
                        "--out", tmp_path / source, "--quiet"], check=True)
        folder = benchmark.folder_of(tmp_path / "out", runs.Method("default", scale), runs.Sequence(kitti, "03"))
        assert (folder / "trajectory_kitti.txt").read_bytes() == (tmp_path / source / "trajectory_kitti.txt").read_bytes()
        theirs, ours = json.loads((tmp_path / source / "metrics.json").read_text()), json.loads((folder / "row.json").read_text())["row"]
        for key in (*runs.METRICS, "tracked_fraction"):
            assert ours[key] == pytest.approx(theirs[key], abs=1e-9), key
        assert ours["ate_rmse_m"] == pytest.approx(theirs["ate_rmse_m"]["sim3"], abs=1e-9)
        assert ours["alignment"] == theirs["alignment"]


def test_only_what_changed_is_computed_again(kitti, tmp_path, monkeypatch):
    titles = computed(monkeypatch)
    call(kitti, tmp_path / "out", *GRAY)
    assert titles == [f"{name} default, {scale}" for name in ("03", "street") for scale in (runs.ROAD, runs.TRUE_STEPS)]
    first = (tmp_path / "out/benchmark.md").read_bytes()
    for change, expected in ((lambda: None, []), (lambda: os.remove(kitti / "sequences/street/image_0/000007.png"), ["street"] * 2),
                             (lambda: (tmp_path / "out/runs/03/default_camera_height/trajectory_kitti.txt").write_text("1 0 0 0 0 1 0 0 0 0 1 0\n"), ["03"])):
        titles.clear()
        change()
        call(kitti, tmp_path / "out", *GRAY)
        assert [title.split()[0] for title in titles] == expected
        assert expected or (tmp_path / "out/benchmark.md").read_bytes() == first
    titles.clear()
    call(kitti, tmp_path / "out", *GRAY, "--set", "seed=3")
    assert len(titles) == 4


def test_published_numbers_stand_only_beside_all_official_frames(kitti, tmp_path, monkeypatch):
    official = {"frames": 8, "length_m": 4, "width_px": 160, "height_px": 80}
    row = {"method": "a method", "scale_source": "stereo", "alignment": "none", "t_rel_percent": {"03": 11.43}, "r_rel_deg_per_100m": {},
           "average_offset_m": {}, "ate_rmse_m": {}, "source": "a journal"}
    for change in ({}, {"frames": 9}, {"length_m": 6}, {"width_px": 161}, {"height_px": 81}):
        monkeypatch.setattr(runs, "published", lambda change=change: {"sequences": {"03": official | change}, "published": [row]})
        rows = call(kitti, tmp_path / "out", *GRAY, "--sequences", "03")
        assert ("a method" in set(rows["method"])) == (not change)
        assert set(rows["frames"]) == {f"clip 0:8 of {change.get('frames', 8)}" if change else "all 8 frames"}
    zero = rows[rows["method"] == "zero motion"]["offset"]
    assert zero.tolist() == [pytest.approx(np.mean(0.5 * np.arange(8)))]


def test_a_failure_is_a_row_with_its_reason(kitti, tmp_path):
    os.remove(kitti / "sequences/03/calib.txt")
    rows = call(kitti, tmp_path / "out", *GRAY, "--sequences", "03,07,street", code=1)
    assert [("calib.txt" in note, "sequences/07" in note) for note in rows["note"][:2]] == [(True, False), (False, True)]
    assert rows["sequence"].tolist() == ["03", "07", "street", "street", "street"]
    assert "failed" not in (tmp_path / "out/overview.md").read_text()


def test_without_ground_truth_errors_are_unknown(kitti, tmp_path):
    os.remove(kitti / "poses/street.txt")
    rows = call(kitti, tmp_path / "out", *GRAY, "--sequences", "street")
    assert rows["t_rel"].isna().all() and rows["note"].tolist()[1] == "no ground truth"


def test_files_of_other_programs(kitti, tmp_path):
    folder = tmp_path / "others"
    folder.mkdir()
    (folder / "03.txt").write_text("".join(f"1 0 0 {0.1 * i} 0 1 0 0 0 0 1 {0.5 * i}\n" for i in range(9)))  # longer than the clip
    rows = call(kitti, tmp_path / "out", "--trajectories", f"theirs={folder}", code=1)
    theirs = rows[(rows["sequence"] == "03") & (rows["method"] == "theirs")]
    assert theirs["scale from"].tolist() == [runs.AS_IT_COMES, runs.TRUE_STEPS]
    assert theirs["offset"].iloc[0] == pytest.approx(0.1 * 3.5)
    assert "street.txt: expected a trajectory" in rows[rows["sequence"] == "street"]["note"].iloc[0]


def test_wrong_requests_are_errors(kitti, tmp_path):
    for arguments, words in ((("--sequences", "../03"), "expected the names of folders in it, found '../03'"),
                             (("--set", "seed"), "expected KEY=VALUE, found 'seed'"), (("--set", "sed=1"), "sed"),
                             (("--config", "default", "--config", "default"), "expected methods of different names")):
        assert words in call(kitti, tmp_path / "none", *arguments, code=1)
    assert "expected a folder per sequence" in call(tmp_path, tmp_path / "none", code=1)


def test_a_configurations_sampling_is_its_models():
    assert "stem.sampling_px" not in runs.options_of("paper", (), "default")
    assert runs.options_of("paper")["stem.sampling_px"] == runs.options_of("paper", (), "paper")["stem.sampling_px"] == 4
    layers = search.layers_of(["default", "paper"], "paper", (), True)
    assert [dict(layer.options).get("stem.sampling_px") for layer in layers] == [None, 4, None, None]
    with pytest.raises(ValueError, match="stride 2 or a divisor of it, found 4"):
        search.layers_of(["default"], "paper", ["stem.sampling_px=4"], True)


def test_each_published_row_has_a_number_its_alignment_and_its_source():
    found = runs.published()
    assert len(found["sequences"]) == 11
    numbers = ("t_rel_percent", "r_rel_deg_per_100m", "average_offset_m", "ate_rmse_m")
    for row in found["published"]:
        assert all(row[key] for key in ("method", "scale_source", "alignment", "source")), row
        assert set().union(*(row[key] for key in numbers)) <= set(found["sequences"]) and any(row[key] for key in numbers)
        assert all(number > 0.0 for key in numbers for number in row[key].values())
    assert found["published"][0]["average_offset_m"]["00"] == 476.40
