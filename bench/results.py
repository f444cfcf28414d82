# SPDX-License-Identifier: MIT
"""From measured rounds to the numbers of every row."""

import dataclasses
import json
import shlex
import statistics
import subprocess

from sequence import frame_range

PER_STEP, ROAD = "per-step ground-truth scale", "metres from the road"


@dataclasses.dataclass(frozen=True)
class Spread:
    median: float
    low: float
    high: float


def spread(values):
    """Median, least and greatest."""
    return Spread(statistics.median(values), min(values), max(values))


def ratios(times, reference):
    """A row's times over the reference's of the same round."""
    if len(times) != len(reference):
        raise ValueError(f"expected as many times as references, found {len(times)} and {len(reference)}")
    return [mine / other for mine, other in zip(times, reference)]


def error_percent(contest, row):
    """t_rel by `stemvo evaluate`, nothing aligned; None without ground truth, or where no segment fits."""
    if not contest.truth.exists():
        return None
    begin, _ = frame_range(contest.options.frames)
    lines = contest.truth.read_text(encoding="utf-8").splitlines()[begin:begin + contest.frames[row.name]]
    truth = contest.scratch / "truth.txt"
    truth.write_text("\n".join(lines) + "\n", encoding="utf-8")
    done = subprocess.run([contest.options.program, "evaluate", "--gt", truth, contest.trajectory(row), "--json"], check=True, stdout=subprocess.PIPE)
    return json.loads(done.stdout)["estimates"][0]["t_rel_percent"]


def lengths(contest, row):
    """Where the lengths of the row's steps come from: of stemvo's, what the run itself says (`scale_source`)."""
    if row.is_peer:
        return PER_STEP if contest.truth.exists() else "every step 1"
    metrics = contest.out(row) / "metrics.json"
    source = json.loads(metrics.read_text(encoding="utf-8")).get("scale_source") if metrics.exists() else None
    return {"camera_height": ROAD, "ground_truth": PER_STEP, None: "unknown"}.get(source, source)


def result(contest, row, reference):
    frames, samples = contest.frames[row.name], contest.samples[row.name]
    walls = [sample.wall_s for sample in samples]
    return {
        "name": row.name,
        "command": shlex.join(map(str, contest.command(row))),
        "fps": dataclasses.asdict(spread([frames / wall for wall in walls])),
        "time_over_first": dataclasses.asdict(spread(ratios(walls, reference))),
        "cpu_ms_per_frame": dataclasses.asdict(spread([1e3 * sample.cpu_s / frames for sample in samples])),
        "peak_mib": max(sample.peak_mib for sample in samples),
        "t_rel_percent": error_percent(contest, row),
        "t_rel_lengths": lengths(contest, row),
        "wall_s": walls,
    }


def of_rows(contest):
    """One result per row, in the rows' order; times are over the first row's of the same round."""
    reference = [sample.wall_s for sample in contest.samples[contest.rows[0].name]]
    return [result(contest, row, reference) for row in contest.rows]
