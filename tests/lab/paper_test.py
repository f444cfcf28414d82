# SPDX-License-Identifier: MIT
"""stemvo-lab paper: its tables, figures and LaTeX, on a stand-in model and rendered clips."""

import os
import pathlib
import re
import shutil
import subprocess

import numpy as np
import onnx
import pandas as pd
import pytest
from click.testing import CliRunner
from exporting import save_network
from small_kitti import write_sequence
from stemvo.lab import paper, runs
from stemvo.lab.cli import main

MODEL = pathlib.Path(__file__).parents[2] / "models/default.onnx"


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("paper")
    write_sequence(folder / "kitti", "00")
    write_sequence(folder / "kitti", "06", camera="image_2")
    (folder / "theirs").mkdir()
    (folder / "theirs/06.txt").write_text("".join(f"1 0 0 {0.1 * i} 0 1 0 0 0 0 1 {0.5 * i}\n" for i in range(8)))
    model = shutil.copy(MODEL, folder / "mobilenetv1_025_128or224_tfhub_imagenet.onnx")  # a long name
    answer = CliRunner().invoke(main, ["paper", str(model), str(folder / "kitti"), "--out", str(folder / "out"), "--filters", "0:2", "--tartanvo", str(folder / "theirs")])
    assert answer.exit_code == 0, answer.output
    return folder / "out"


def test_latex_compiles(made):
    tables = re.findall(r"\\input\{(.+?)\}", (made / "paper.tex").read_text())
    assert tables == ["table1.tex", "table2.tex", "table4.tex"]
    for name in tables:  # a column too many is LaTeX's error, one too few is not
        assert len({line.count(" & ") for line in (made / name).read_text().splitlines() if line.endswith(r"\\")}) == 1
    if not shutil.which("pdflatex"):
        pytest.skip("pdflatex is missing (tools/setup.sh tex)")
    subprocess.run(["pdflatex", "-interaction=batchmode", "-halt-on-error", "paper.tex"], cwd=made, check=True, stdout=subprocess.DEVNULL)
    assert (made / "paper.pdf").stat().st_size > 10000 and "Overfull" not in (made / "paper.log").read_text()


def test_layers_are_counted_beside_the_papers(made):
    rows = pd.read_csv(made / "table1.csv").set_index("Model")
    assert rows.loc["ConvNeXtXLarge (the paper)"].tolist() == [297, 332806, 36096, 296710]
    assert rows.iloc[3].tolist() == [1, 16, 16, 0] and rows.index[3] == "mobilenetv1_025_128or224_tfhub_imagenet (stand-in)"


def test_a_gray_input_is_one_row_and_each_number_says_what_it_ran_on(made):
    rows = pd.read_csv(made / "table2.csv")
    assert rows["Layer-filter"].str.startswith("Input layer").sum() == 1
    assert rows["ran on"][1] == "clip 0:8 of 4541" and rows["ran on"][2] == "clip 0:8 of 4541; stand-in"
    assert float(rows["E_t, m"][0]) == pytest.approx(0.5) and float(rows["E_r, deg"][0]) == 0.0
    colors = paper.filters_of([], None, is_gray=False)
    assert [label for label, _, _ in colors] == ["Input layer, R", "Input layer, G", "Input layer, B"]


def test_offsets(made):
    rows = pd.read_csv(made / "table4.csv").set_index("Dataset")
    assert rows.index.tolist() == [f"KITTI {name}" for name in paper.SEQUENCES]
    assert rows["Frames"].tolist() == ["clip 0:8 of 4541", "not there", "not there", "clip 0:8 of 1101", "not there", "not there"]
    assert rows["the paper, published"]["KITTI 00"] == 476.40 and rows["zero motion"]["KITTI 00"] == pytest.approx(1.75)
    assert rows["TartanVO, its path"]["KITTI 06"] == pytest.approx(0.35) and pd.isna(rows["TartanVO, its path"]["KITTI 00"])
    assert any(name.startswith("ours, stand-in") for name in rows.columns)


def test_figures(made):
    for name in ("figure1", "figure3", "figure5"):
        assert (made / f"{name}.svg").stat().st_size > 1000
    assert not (made / "figure4.svg").exists()


def test_each_layer_is_drawn_beyond_z(tmp_path):
    write_sequence(tmp_path, "00")
    paper.figure_1([paper.Layer("network", f"layer {i}", 1, "gray") for i in range(27)], runs.Sequence(tmp_path, "00"), 0, tmp_path)
    svg = (tmp_path / "figure1.svg").read_text()
    assert "(z) network, layer 24" in svg and "(aa) network, layer 25" in svg and "(bb) network, layer 26" in svg


def test_all_layers_of_a_network(tmp_path):
    random = np.random.default_rng(1)
    weights = {f"w{i}": random.standard_normal(shape).astype(np.float32) for i, shape in enumerate(((4, 3, 3, 3), (6, 4, 3, 3)))}
    nodes = [onnx.helper.make_node("Conv", [name, f"w{i}"], [f"y{i}"], strides=[2, 2], pads=[1, 1, 1, 1]) for i, name in enumerate(("x", "y0"))]
    save_network(tmp_path / "two.onnx", nodes, {"x": [1, 3, "h", "w"]}, {"y1": [1, 6, "a", "b"]}, weights)
    layers, totals = paper.export(tmp_path / "two.onnx", "all", tmp_path, "unit")
    assert totals == (2, 10, 10, 0) and [(layer.name, layer.filters, layer.stride_px) for layer in layers] == [("y0", 4, 2), ("y1", 6, 4)]


@pytest.mark.skipif("STEMVO_SHARED_DATA" not in os.environ, reason="STEMVO_SHARED_DATA is not set")
def test_weights_are_exported_first(tmp_path):
    stem = pathlib.Path(os.environ["STEMVO_SHARED_DATA"]) / "stems/mobilenetv1_025_128or224_tfhub_imagenet.npz"
    layers, totals = paper.export(stem, None, tmp_path)
    assert totals == (1, 8, 8, 0) and [(layer.filters, layer.stride_px) for layer in layers] == [(8, 2)] and layers[0].stand_in
