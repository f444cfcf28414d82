# SPDX-License-Identifier: MIT
"""stemvo-lab compare: evo's ATE and RPE to 1e-6; differences are told where they are, and only there."""

import copy
import os
import pathlib

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner
from evo.core import metrics, trajectory
from evo.tools import file_interface
from stemvo.lab import bootstrap, compare, figures, tables
from stemvo.lab.cli import main


def call(out, *arguments, code=0):
    answer = CliRunner().invoke(main, ["compare", *map(str, arguments), "--out", str(out)])
    assert answer.exit_code == code, answer.output
    return answer.output


def path_of(noise, frames=400, seed=1):
    """A curve, and what a method with so much noise in its turns would say of it."""
    random, poses = np.random.default_rng(seed), [np.eye(4)]
    for i in range(frames - 1):
        turn = 0.02 * np.sin(0.03 * i) + noise * random.standard_normal()
        step = np.eye(4)
        step[:3, :3] = [[np.cos(turn), 0, np.sin(turn)], [0, 1, 0], [-np.sin(turn), 0, np.cos(turn)]]
        step[2, 3] = 1.0 + noise * random.standard_normal()
        poses.append(poses[-1] @ step)
    return np.array(poses)


def write_kitti(file, poses):
    np.savetxt(file, poses[:, :3].reshape(len(poses), 12))
    return file


def evo_of(truth_file, file, align, first=0):
    truth, estimate = (file_interface.read_kitti_poses_file(name) for name in (truth_file, file))
    return evo_errors(trajectory.PosePath3D(poses_se3=truth.poses_se3[first:first + estimate.num_poses]), estimate, align)


def evo_errors(truth, estimate, align):
    """ATE in m, RPE of neighbours in m and degrees."""
    aligned = copy.deepcopy(estimate)
    aligned.align_origin(truth) if align == "none" else aligned.align(truth, correct_scale=align == "sim3")
    found = []
    for metric, statistic in ((metrics.APE(metrics.PoseRelation.translation_part), metrics.StatisticsType.rmse),
                              (metrics.RPE(metrics.PoseRelation.translation_part, 1, metrics.Unit.frames), metrics.StatisticsType.mean),
                              (metrics.RPE(metrics.PoseRelation.rotation_angle_deg, 1, metrics.Unit.frames), metrics.StatisticsType.mean)):
        metric.process_data((truth, aligned))
        found.append(metric.get_statistic(statistic))
    return found


@pytest.mark.skipif("STEMVO_SHARED_DATA" not in os.environ, reason="STEMVO_SHARED_DATA is not set")
@pytest.mark.parametrize("align", ["none", "se3", "sim3"])
def test_peers_have_the_errors_that_evo_finds(tmp_path, align):
    data = pathlib.Path(os.environ["STEMVO_SHARED_DATA"])
    for number, first in (("10", 0), ("06", 0)):
        truth = data / f"full_poses/{number}.txt"
        files = sorted(file for file in (data / "peers").glob(f"*/{number}.txt") if len(file.read_text().splitlines()) == len(truth.read_text().splitlines()))
        call(tmp_path, *files, "--gt", truth, "--align", align, "--names", ",".join(file.parent.name for file in files))
        rows = pd.read_csv(tmp_path / "numbers.csv").set_index("path")
        assert len(rows) == len(files) + 1
        for file in files:
            ours = rows.loc[file.parent.name, ["ATE, m", "RPE, m", "RPE, deg"]].tolist()
            assert ours == pytest.approx(evo_of(truth, file, align, first), abs=1e-6), file


def test_names_formats_and_what_belongs_together(tmp_path):
    truth = path_of(0.0)
    truth_file, good = write_kitti(tmp_path / "truth.txt", truth), write_kitti(tmp_path / "good.txt", path_of(0.001)[40:])
    whole = write_kitti(tmp_path / "whole.txt", path_of(0.002, seed=2))
    assert "--first says which" in call(tmp_path / "out", write_kitti(tmp_path / "long.txt", np.concatenate([truth, truth])), "--gt", truth_file, code=1)
    one = write_kitti(tmp_path / "one.txt", truth[:1])
    for given, words in (([whole, good], "expected 400 poses, one per line of"), ([good, "--first", 41], "from which 360 follow"),
                         ([good, whole, "--first", 40], "from which 400 follow"), ([one], "expected 2 poses or more, found 1")):
        assert words in call(tmp_path / "out", *given, "--gt", truth_file, code=1)
    assert "expected 2 different names" in call(tmp_path / "out", good, whole, "--gt", truth_file, "--names", "a,a", code=1)
    call(tmp_path / "out", good, "--gt", truth_file, "--first", 40, "--align", "sim3")
    rows = pd.read_csv(tmp_path / "out/numbers.csv")
    assert rows["path"].tolist() == ["good", "zero motion"] and rows["poses"].tolist() == [360, 360] and rows["ATE, m"][0] < 1.0
    page = (tmp_path / "out/report.html").read_text()
    assert compare.ALIGNMENTS["sim3"] in page.replace("&#x27;", "'") and "http://" not in page.split("<h1>")[1] and 'name="viewport"' in page
    assert "<h2>t_rel by segment" in page and page.split("<h1>")[1].count('"paper_bgcolor":"rgba(0,0,0,0)"') == page.count('"namelength":-1') == 4
    for end, plane in (([0.1, 0.9, 60], [0, 2]), ([9, 1, 0.1], [0, 1]), ([9, 0.1, 1], [0, 2]), ([1, 9, 2], [0, 1])):  # KITTI 06 climbs more than it turns
        assert figures.plane_of(np.array([[0, 0, 0], end])) == plane
    for figure in ("paths", "position_error_over_distance", "t_rel_by_segment"):
        assert (tmp_path / f"out/{figure}.svg").stat().st_size > 1000 and (tmp_path / f"out/{figure}.pdf").read_bytes()[:5] == b"%PDF-"


def test_worse_is_told_and_equal_is_not(tmp_path):
    truth = write_kitti(tmp_path / "truth.txt", path_of(0.0))
    files = [write_kitti(tmp_path / f"{name}.txt", path_of(noise, seed=seed)) for name, noise, seed in (("good", 0.002, 2), ("alike", 0.002, 3), ("bad", 0.02, 4))]
    call(tmp_path / "out", *files, "--gt", truth)
    rows = pd.read_csv(tmp_path / "out/differences.csv").set_index("pair")
    assert rows["smaller t_rel"].to_dict() == {"good - alike": "not told apart", "good - bad": "good", "alike - bad": "alike"}
    short = [write_kitti(tmp_path / f"short_{file.name}", np.loadtxt(file).reshape(-1, 3, 4)[:3]) for file in files]
    assert "inf" not in call(tmp_path / "out", *short, "--gt", truth, "--first", 0)
    assert set(pd.read_csv(tmp_path / "out/differences.csv")["t_rel, %"]) == {"too few shared frames"}


def test_intervals_hold_the_truth():
    random, inside = np.random.default_rng(5), 0
    for _ in range(200):
        noise = np.convolve(random.standard_normal(219), np.ones(20) / 20, "valid")
        low, high = bootstrap.difference([bootstrap.Drive(noise + 1.3, np.ones(200), 20)])[1:]
        inside += low <= 0.3 <= high
    assert 180 <= inside <= 200
    assert bootstrap.difference([bootstrap.Drive(np.ones(9), np.zeros(9), 5)])[1:] == (-np.inf, np.inf)
    drives = [(np.full(60, 1.0) + 0.1 * random.standard_normal(60), 3), None]
    assert bootstrap.best_of({"a": drives, "b": [(drives[0][0] + 1.0, 3), None]}) == "a"
    assert bootstrap.best_of({"a": drives, "b": [(drives[0][0][::-1], 3), None]}) is None


def test_tables_escape():
    frame = tables.formatted(pd.DataFrame({"a_b": ["x|y & 5 %"], "n": [1.23456], "none": [None]}), {"n": 3})
    assert tables.markdown(frame).splitlines()[2] == "| x\\|y & 5 % | 1.235 | - |"
    assert r"x\textbar{}y \& 5 \% & 1.235 & - \\" in tables.latex(frame, "c")
    parts = tables.latex(tables.formatted(pd.DataFrame({"a": range(100)}), {}), "c").split(r"\begin{table}")[1:]
    assert [part.count(r" \\") - 1 for part in parts] == [45, 45, 10]
    assert [r"\caption{c (continued)}" in part for part in parts] == [False, True, True]
