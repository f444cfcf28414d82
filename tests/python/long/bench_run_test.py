# SPDX-License-Identifier: MIT
"""The benchmark of whole programs (bench/run.py): statistics, errors, turns, and the peer, on a tiny rendered drive and on 03."""

import json
import os
import pathlib
import re
import subprocess
import sys

import pytest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[3] / "bench"))

import places  # noqa: E402
import results  # noqa: E402
import run  # noqa: E402

PROGRAM = os.environ.get("STEMVO_PROGRAM", "")
DATA = os.environ.get("STEMVO_SHARED_DATA")
NO_PEERS = "build/venv-peers is missing (tools/setup.sh peers)"


def test_ratios_are_within_a_round():
    # A machine that is half as fast in the second round changes no ratio.
    assert results.ratios([3.0, 6.0], [1.0, 2.0]) == [3.0, 3.0]
    with pytest.raises(ValueError):
        results.ratios([1.0], [1.0, 2.0])


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    folder = tmp_path_factory.mktemp("drive")
    subprocess.run([PROGRAM, "synth", folder, "--frames", "30", "--width", "620", "--height", "188"], check=True, capture_output=True)
    return folder / "sequences/00"


@pytest.fixture
def bench(tmp_path, monkeypatch, capsys):
    """What a run says, on both streams, and its rows."""
    monkeypatch.setattr(places, "WORK", tmp_path / "work")

    def call(sequence, *arguments):
        assert run.main([str(sequence), "--program", PROGRAM, "--json", str(tmp_path / "a.json"), *arguments]) == 0
        said, progress = capsys.readouterr()
        return said, progress, json.loads((tmp_path / "a.json").read_text())

    return call


def test_in_turn(bench, drive):
    said, progress, found = bench(drive, "--only", "defaults,folded stem,gray", "--rounds", "2", "--frames", "5:25")
    order = [line.split(":")[1].strip() for line in progress.splitlines() if line.startswith("round")]
    assert order == ["defaults", "folded stem", "gray", "folded stem", "gray", "defaults"]
    assert [row["name"] for row in found["rows"]] == ["defaults", "folded stem", "gray"]
    for row in found["rows"]:
        assert len(row["wall_s"]) == 2 and row["fps"]["low"] <= row["fps"]["median"]
        assert row["fps"]["high"] == pytest.approx(20 / min(row["wall_s"]), abs=0.5e-6, rel=0)
        assert row["peak_mib"] > 20 and row["t_rel_percent"] < 10 and row["t_rel_lengths"] == "metres from the road"
    assert found["rows"][0]["time_over_first"] == {"median": 1.0, "low": 1.0, "high": 1.0}
    assert all(f"{key}: " in said for key in ("machine", "commit", "stemvo", "rounds", "load_before", "busy")) and "time, defaults = 1" in said
    assert re.search(r"\nfolded stem +[\d.]+ +[\d.]+-[\d.]+ ", said) and found["busy"] == ("BUSY MACHINE" in said)


@pytest.mark.skipif(not places.PEER_PYTHON.exists(), reason=NO_PEERS)
def test_the_peer_is_a_working_odometry(bench, drive):
    peer = bench(drive, "--only", "defaults,opencv orb", "--rounds", "1")[2]["rows"][1]
    assert 0 < peer["t_rel_percent"] < 25, "a wrong direction or composition is far above"
    assert peer["t_rel_lengths"] == "per-step ground-truth scale"


def is_debug_build():
    cache = pathlib.Path(PROGRAM).parent / "CMakeCache.txt"
    return cache.exists() and "CMAKE_BUILD_TYPE:STRING=Debug" in cache.read_text(encoding="utf-8")


@pytest.mark.skipif(is_debug_build(), reason="a debug build, which nobody times")
@pytest.mark.skipif(not DATA, reason="STEMVO_SHARED_DATA is not set")
@pytest.mark.skipif(not places.PEER_PYTHON.exists(), reason=NO_PEERS)
def test_less_processor_time_than_orb_and_brute_force(bench):
    # About 2.0 on 03; processor time because other programs lengthen it little.
    found = bench(f"{DATA}/kitti/sequences/03", "--frames", "0:60", "--rounds", "1", "--only", "defaults,opencv orb")[2]
    ours, peer = (row["cpu_ms_per_frame"]["median"] for row in found["rows"])
    print(f"processor time of a frame: opencv orb {peer:.1f} ms, defaults {ours:.1f} ms, ratio {peer / ours:.2f}", file=sys.stderr)
    assert peer / ours >= 1.2
