# SPDX-License-Identifier: MIT
"""stemvo-lab search: the order of filters, rows that are kept, interrupts, shards, on a rendered drive."""

import os
import random
import re
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from click.testing import CliRunner
from small_kitti import write_sequence
from stemvo.lab import bootstrap, ranking, score
from stemvo.lab.cli import main
from stemvo.lab.rows import Rows

FRAMES = 60


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    folder = tmp_path_factory.mktemp("drive")
    subprocess.run([os.environ["STEMVO_PROGRAM"], "synth", folder, "--frames", str(FRAMES), "--width", "310", "--height", "94"], check=True, stdout=subprocess.DEVNULL)
    return folder / "sequences/00"


def arguments(drive, out, *more):
    return ["search", str(drive), "--model", "input_layer", "--model", "default", "--filters", "0:3", "--no-ray", "--no-baselines", "--jobs", "2", "--out", str(out), *map(str, more)]


def search(drive, out, *more):
    done = CliRunner().invoke(main, arguments(drive, out, *more))
    assert done.exit_code == 0, done.output
    return (out / "filters.csv").read_text()


def test_an_interrupted_search_goes_on_to_the_same_table(drive, tmp_path):
    whole = search(drive, tmp_path / "whole")
    command = [sys.executable, "-m", "stemvo.lab.cli", *arguments(drive, tmp_path / "killed")]
    randomly, done = random.Random(1), False
    for _ in range(12):
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)
        try:
            done = process.wait(randomly.uniform(0.8, 2.5)) == 0
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
            time.sleep(0.1)
    assert search(drive, tmp_path / "killed") == whole
    lines = (tmp_path / "killed/rows.csv").read_text().splitlines()
    keys = [tuple(line.split(",")[:8]) for line in lines]
    assert len(keys) == len(set(keys)) == len((tmp_path / "whole/rows.csv").read_text().splitlines())


def test_shards_together_are_the_whole(drive, tmp_path):
    whole = search(drive, tmp_path / "whole", "--exhaustive")
    for shard in range(2):
        search(drive, tmp_path / f"part{shard}", "--exhaustive", "--shard", f"{shard}/2")
    rows = [tmp_path / f"part{shard}/rows.csv" for shard in range(2)]
    assert search(drive, tmp_path / "joined", "--exhaustive", "--rows", rows[0], "--rows", rows[1]) == whole
    assert len((tmp_path / "joined/rows.csv").read_text().splitlines()) == 1  # nothing was computed again
    again = (tmp_path / "whole/rows.csv").read_text()
    search(drive, tmp_path / "whole", "--exhaustive", "--set", "features.max_features=300")
    assert (tmp_path / "whole/rows.csv").read_text().startswith(again) and (tmp_path / "whole/rows.csv").read_text() != again


def test_held_out_drives_judge(drive, tmp_path):
    done = CliRunner().invoke(main, arguments(drive, tmp_path, "--frames", "0:40", "--held-out", drive, "--held-out-frames", "20:60"))
    assert done.exit_code == 0 and "held out: first (1): t_rel" in done.output, done.output


def test_a_drive_too_short_for_a_segment_is_said(drive, tmp_path):
    done = CliRunner().invoke(main, arguments(drive, tmp_path, "--frames", "0:8"))
    assert done.exit_code == 0 and re.search(r"^00: \d\.\d m, too short for a segment of 10 m: no t_rel and r_rel$", done.output, re.MULTILINE), done.output
    assert "None" not in done.output


@pytest.mark.parametrize(("more", "message"), [
    (["--shard", "2/2"], "--shard: expected I/N"), (["--model", "default"], "'default' again"), (["--set", "features.nothing=3"], "features.nothing"),
    (["--filters", "abc"], "--filters: expected A:B inside 0:3 for input_layer, found 'abc'"), (["--filters", "2:4"], "found '2:4'"), (["--frames", "0:1"], "expected 2 frames or more")])
def test_bad_input_is_one_line(drive, tmp_path, more, message):
    done = CliRunner().invoke(main, arguments(drive, tmp_path, *more))
    assert done.exit_code == 1 and message in done.output and len(done.output.splitlines()) == 1, done.output


@pytest.mark.parametrize("option", [("--jobs", 0), ("--jobs", -1), ("--plan", -5)])
def test_counts_are_above_zero(drive, tmp_path, option):
    done = CliRunner().invoke(main, arguments(drive, tmp_path, *option))
    assert done.exit_code == 2 and f"Invalid value for '{option[0]}'" in done.output


def test_other_images_are_another_drive(tmp_path):
    folder = write_sequence(tmp_path, "00")
    before = score.Drive(str(folder)).hash()
    (folder / "image_0/000003.png").write_bytes((folder / "image_0/000002.png").read_bytes())
    assert score.Drive(str(folder)).hash() != before


def test_plan(drive, tmp_path):
    done = CliRunner().invoke(main, arguments(drive, tmp_path, "--plan", 313746))
    assert done.exit_code == 0 and f"313746 filters x {FRAMES} frames" in done.output and "core-hours" in done.output


def test_a_torn_line_is_cut_off_and_a_second_writer_refused(tmp_path):
    file, columns = tmp_path / "rows.csv", ("key", "text", "value")
    rows = Rows(file, columns, 1)
    rows.append([{"key": 1, "text": "a,\"b\"", "value": None}, {"key": 2, "text": "line", "value": 0.1}])
    with pytest.raises(ValueError, match="only writer"):
        Rows(file, columns, 1)
    rows._stream.close()
    file.write_bytes(file.read_bytes() + b"3,torn")
    rows = Rows(file, columns, 1)
    assert rows.get((1,)) == {"key": "1", "text": 'a,"b"', "value": ""} and rows.get((3,)) is None
    rows.append([{"key": 3, "text": "whole", "value": 1}])
    assert file.read_text().splitlines()[-1] == "3,whole,1"


def test_intervals_hold_the_true_ratio():
    """Running means over 8 neighbours of exponential errors; the true ratio is 1.2."""
    random_numbers, inside, decided = np.random.default_rng(3), 0, 0
    for _ in range(100):
        a, b = (np.convolve(random_numbers.exponential(size=87), np.ones(8) / 8, "valid") for _ in range(2))
        found = bootstrap.paired_ratio([bootstrap.Drive(1.2 * a, b, 8)])
        inside += found.low <= 1.2 <= found.high
        decided += bootstrap.paired_ratio([bootstrap.Drive(3.0 * a, b, 8)]).is_decided
    assert inside >= 90 and decided >= 90
    assert bootstrap.Ratio(1.3, 1.1, 1.6).is_above(1) and not bootstrap.Ratio(1.3, 1.1, 1.6).is_above(1000) and not bootstrap.Ratio(1.3, 0.0, np.inf).is_above(1)
    assert bootstrap.paired_ratio([]) == (1.0, 0.0, np.inf)
    few = bootstrap.paired_ratio([bootstrap.Drive(np.ones(20), np.full(20, 2.0), 8)])
    assert few == (0.5, 0.0, np.inf)


def test_the_best_and_its_equals():
    random_numbers = np.random.default_rng(5)
    base = np.convolve(random_numbers.exponential(size=207), np.ones(8) / 8, "valid")
    noise = [np.convolve(random_numbers.normal(1.0, 0.02, size=207), np.ones(8) / 8, "valid") for _ in range(3)]
    numbers = (1.0,) * len(ranking.NUMBERS)
    told = ranking.compare({name: [ranking.Score("00", name != "lost", errors, 8, numbers)] for name, errors in
                            {"best": base, "equal": base * noise[0] * 1.001, "worse": base * noise[1] * 1.3, "lost": base}.items()})
    assert [told[name].status for name in ("best", "equal", "worse", "lost")] == ["ranked"] * 3 + ["not detected"]
    assert told["best"].is_equal and told["equal"].is_equal and not told["worse"].is_equal
