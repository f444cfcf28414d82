# SPDX-License-Identifier: MIT
"""stemvo-lab search: which filter of a network tracks best (the paper's Table 2)."""

import collections
import dataclasses
import hashlib
import os
import pathlib
import re
import time

import click
import numpy as np
import tqdm

import stemvo
from stemvo import _core
from stemvo.lab import ranking, score, work
from stemvo.lab.rows import Rows
from stemvo.lab.runs import open_folder, options_of, program_hash

# A run's odometry made cheap: pairs of frames, fewer points, steps of the true length.
DEFAULTS = {"odometry.mode": "two_frame", "scale.source": "ground_truth", "features.max_features": 400, "features.klt_window": 23,
            "two_view.estimator": "ransac", "two_view.max_iterations": 200, "two_view.confidence": 0.99}
KEY = ("model_hash", "layer", "filter", "features", "drive", "drive_hash", "frames", "configuration")
COLUMNS = (*KEY, "model", *score.ERRORS, "inliers", "tracked", "detected", "reason")
SHARES = (0.25, 0.5, 0.75, 1.0)  # of the frames, after which filters are told apart
MOST_IN_BLOCK = 48  # filters that share a pass, some 2 MB each


@dataclasses.dataclass(frozen=True)
class Layer:
    model: str
    name: str
    hash: str
    layer: str
    num_filters: int
    options: tuple
    features: str
    configuration: str  # hash of all that is no model and no filter
    is_baseline: bool = False

    def block(self, filters, drive):
        return score.Block(self.model, filters, drive, self.options)


def layer_of(model, config, overrides, is_baseline=False, **more):
    values = ({} if config else DEFAULTS) | options_of(config, overrides, model) | {"scale.source": "ground_truth"}
    dropped = ("stem.model", "stem.filter", *["stem.sampling_px"] * is_baseline)
    stride, is_native = _core.model_stride(model)
    if stride > 2 and stride % 2 == 0 and not is_native and not values.get("stem.sampling_px"):
        more["stem.sampling_px"] = stride // 2  # shifted passes of a coarse layer cost more than more of them tell
    values = {key: value for key, value in values.items() if key not in dropped} | more
    settings = stemvo.Options(values | {"threads": 1})
    stem = stemvo.Stem(stemvo.Options(values | {"stem.model": model}))
    return Layer(model, pathlib.Path(model).stem if model.endswith(".onnx") else model, hashlib.sha256(_core.model_bytes(model)).hexdigest()[:16], stem.layer or "input",
                 stem.num_filters, tuple(values.items()), values.get("features.method", "patch"),
                 hashlib.sha256((program_hash() + str(settings)).encode()).hexdigest()[:16], is_baseline)


def layers_of(models, config, overrides, baselines):
    layers = [layer_of(str(pathlib.Path(model).resolve()) if model.endswith(".onnx") else model, config, overrides) for model in models]
    if baselines:
        layers += [layer_of("gray", config, overrides, True, **{"features.method": "orb"}), layer_of("input_layer", config, overrides, True)]
    if twice := [name for name, count in collections.Counter((one.name, one.features) for one in layers).items() if count > 1]:
        raise ValueError(f"--model: expected each name once, found '{twice[0][0]}' again")
    return layers


def filters_of(layer, text):
    """A:B, A: or :B."""
    ends = re.fullmatch(r"(\d*):(\d*)", text)
    first, last = (int(ends[1] or 0), int(ends[2] or layer.num_filters)) if ends else (0, 0)
    if not first < last <= layer.num_filters:
        raise ValueError(f"--filters: expected A:B inside 0:{layer.num_filters} for {layer.name}, found '{text}'")
    return range(first, last)


def part_of(candidates, shard):
    """Every N-th from the I-th on: I/N."""
    first, _, count = shard.partition("/")
    if not (first.isdigit() and count.isdigit() and int(first) < int(count)):
        raise ValueError(f"--shard: expected I/N with I from 0 to N - 1, found '{shard}'")
    share = -(-len(candidates) // int(count))
    return candidates[int(first) * share : (int(first) + 1) * share]


class Search:
    """Candidates are (layer, filter). Rows that are there are not computed again."""

    def __init__(self, drives, rows, candidates, workers, progress):
        self.drives, self.rows, self.candidates, self.workers, self.progress = drives, rows, candidates, workers, progress
        self._hashes = {drive: drive.hash() for drive in drives}
        self._lengths = {drive: len(drive.open()) for drive in drives}
        self._kept, self._blocks = {}, {}
        for drive in drives:
            for layer in dict.fromkeys(layer for layer, _ in candidates):
                filters = [k for one, k in candidates if one is layer]
                size = min(MOST_IN_BLOCK, -(-len(filters) // len(workers.workers)))
                for at in range(0, len(filters), size):
                    block = layer.block(tuple(filters[at : at + size]), drive)
                    self._blocks |= {(layer, k, drive): block for k in block.filters}

    def end(self, drive, share):
        return max(min(2, self._lengths[drive]), int(share * self._lengths[drive]))

    def key(self, candidate, drive, share):
        layer, k = candidate
        begin = int((drive.frames or "0").partition(":")[0] or 0)
        return (layer.hash, layer.layer, k, layer.features, drive.name, self._hashes[drive], f"{begin}:{begin + self.end(drive, share)}", layer.configuration)

    def row(self, candidate, drive, share=1.0):
        return self.rows.get(self.key(candidate, drive, share))

    def run(self, candidates, drives, share):
        tasks = collections.defaultdict(list)
        for layer, k in candidates:
            for drive in drives:
                if self.row((layer, k), drive, share) is None:
                    tasks[self._blocks[layer, k, drive]].append((layer, k))
        todo = [(block, tuple(k for _, k in found), self.end(block.drive, share)) for block, found in tasks.items()]
        todo.sort(key=lambda task: -len(task[1]) * task[2])  # a long one begun last would run alone
        for (block, filters, end), scored in work.run(self.workers, score.score, todo, lambda task: task[0], self._kept):
            layers = dict((k, layer) for layer, k in tasks[block])
            self.rows.append([dict(zip(KEY, self.key((layers[k], k), block.drive, share))) | row | {"model": layers[k].name} for k, row in scored.items()])
            self.progress(len(filters) * end)

    def race(self, shares):
        """What is significantly worse than the best after a share of the frames does not go on; baselines do. Held-out drives see those
        that ran to the end."""
        ranking_drives = [drive for drive in self.drives if not drive.held_out]
        alive = self.candidates
        for share in shares:
            self.run(alive, ranking_drives, share)
            if share < 1.0:
                told = ranking.compare({one: self.scores(one, share) for one in alive if not one[0].is_baseline})
                alive = [one for one in alive if one[0].is_baseline or (told[one].status == "ranked" and not told[one].ratio.is_above(len(told)))]
        self.run(alive, [drive for drive in self.drives if drive.held_out], 1.0)

    def scores(self, candidate, share, held_out=False):
        return [ranking.Score.of(drive.road, self.row(candidate, drive, share)) for drive in self.drives if drive.held_out == held_out]

    def table(self, shares):
        """A row per candidate, by its last share, in the order of the ranking."""
        last = {}
        for one in self.candidates:
            done = [share for share in shares if all(self.row(one, drive, share) for drive in self.drives if not drive.held_out)]
            if done:
                last[one] = done[-1]
        told = ranking.compare({one: self.scores(one, share) for one, share in last.items() if share == 1.0})
        table = []
        for one, share in last.items():
            rows = {drive: self.row(one, drive, share) for drive in self.drives}
            means = ranking.mean(self.scores(one, share))
            row = {"model": one[0].name, "layer": one[0].layer, "filter": one[1], "features": one[0].features, "baseline": one[0].is_baseline,
                   "status": told[one].status if one in told else "stopped", **means,
                   "frames": sum(self.end(drive, share) for drive in self.drives if not drive.held_out),
                   "reason": next((row["reason"] for row in rows.values() if row and row["reason"]), "")}
            if one in told and told[one].status == "ranked":
                row |= {"over_best": told[one].ratio.ratio, "over_best_low": told[one].ratio.low, "over_best_high": told[one].ratio.high, "equal": told[one].is_equal}
            for drive, found in rows.items():
                if found and len(rows) > 1:
                    row[("held_out_" if drive.held_out else "") + f"t_rel_percent_{drive.name}"] = ranking.number(found["t_rel_percent"])
            table.append(row)
        return sorted(table, key=ranking.order)


def judged(table, drives):
    """What held-out drives say of the first row, of the group of equals and of the baselines."""
    names = [f"held_out_t_rel_percent_{drive.name}" for drive in drives if drive.held_out]
    groups = {"first": [row for row in table if row["status"] == "ranked" and not row["baseline"]][:1],
              "equals": [row for row in table if row.get("equal") and not row["baseline"]], "baselines": [row for row in table if row["baseline"]]}
    lines = []
    for name, rows in groups.items() if names else ():
        errors = [np.mean([row[key] for key in names]) for row in rows if all(row.get(key) is not None for key in names)]
        if errors:
            lines.append(f"held out: {name} ({len(errors)}): t_rel {np.mean(errors):.3f} %" + (f", {min(errors):.3f} to {max(errors):.3f}" if len(errors) > 1 else ""))
    return lines


def too_short(drives):
    """A line per road that no segment of t_rel fits into."""
    told = {(drive.road, drive.frames): stemvo.evaluate(truth, truth) for drive in drives for truth in [drive.open().ground_truth]}
    return [f"{road}: {one['path_length_m']:.1f} m, too short for a segment of {one['segment_lengths_m'][0]:g} m: no t_rel and r_rel"
            for (road, _), one in told.items() if one["segments"] == 0]


def plan(count, layers, drives, jobs):
    """Cost of so many filters over these drives, by the speed of a few here."""
    drive, layer = drives[0], layers[0]
    filters, frames = tuple(range(min(8, layer.num_filters))), min(20, len(drive.open()))
    _core.set_num_threads(1)
    score.score((layer.block(filters, drive), filters, 2))
    begin = time.process_time()
    score.score((layer.block(filters, drive), filters, frames))
    rate = len(filters) * (frames - 2) / (time.process_time() - begin)
    total = sum(len(one.open()) for one in drives)
    hours = count * total / rate / 3600
    return (f"{count} filters x {total} frames: {hours:.0f} core-hours at {rate:.0f} filter-frames a second and core, {hours / jobs:.0f} hours on {jobs} cores;\n"
            f"1000 shards (--shard 0/1000 .. 999/1000, rows read with --rows) take {hours / 1000:.2f} core-hours each")


def write_results(out, table):
    import pandas

    frame = pandas.DataFrame(table).fillna(np.nan)
    frame.to_csv(out / "filters.csv", index=False, float_format="%.4f")
    shown = [name for name in ("model", "layer", "filter", "features", "status", "t_rel_percent", "r_rel_deg_per_100m", "over_best", "over_best_low", "over_best_high", "tracked") if name in frame]
    text = frame[shown].head(40).to_string(index=False, float_format="%.3f", na_rep="-")
    (out / "filters.txt").write_text(text + "\n")
    ranking.draw(out / "filters", table)
    return text


@click.command()
@click.argument("drives", nargs=-1, required=True, type=click.Path(exists=True, file_okay=False), metavar="DRIVE..")
@click.option("--model", "models", multiple=True, default=["default"], show_default=True, help="Networks, as stem.model takes them.")
@click.option("--out", required=True, type=click.Path(path_type=pathlib.Path), help="Folder of rows.csv (only grows), filters.csv, .txt, .svg.")
@click.option("--frames", help="A:B of each drive.")
@click.option("--held-out", multiple=True, type=click.Path(exists=True, file_okay=False), help="A drive that judges and never ranks.")
@click.option("--held-out-frames", help="A:B of these.")
@click.option("--kinds", default="", help="Each drive ranks also under these disturbances (stemvo-lab robustness), KIND,..")
@click.option("--filters", help="A:B, A: or :B, which each model must have.")
@click.option("--shard", default="0/1", help="I/N: the I-th of N parts of the filters.")
@click.option("--exhaustive", is_flag=True, help="No filter is stopped early.")
@click.option("--baselines/--no-baselines", default=True, help="ORB on gray, and the input's R, G and B.")
@click.option("--config", help="Configuration in place of the search's own cheap one.")
@click.option("--set", "overrides", multiple=True, metavar="KEY=VALUE", help="A key of the configuration.")
@click.option("--rows", "others", multiple=True, type=click.Path(exists=True, dir_okay=False), help="rows.csv of another search: its rows count too.")
@click.option("--plan", "planned", type=click.IntRange(1), help="Only say what so many filters would take.")
@click.option("--jobs", type=click.IntRange(1), help="Processes; default: one per core.")
@click.option("--address", help="Of a Ray cluster; else this machine alone.")
@click.option("--ray/--no-ray", default=True, help="Processes of our own in place of Ray.")
def command(drives, models, out, frames, held_out, held_out_frames, kinds, filters, shard, exhaustive, baselines, config, overrides, others, planned, jobs,
            address, ray):
    """Run an odometry on every filter of a network over drives in KITTI's layout with ground truth, and rank the filters.

    A row (filter, drive, frames, configuration) that is in OUT/rows.csv is not computed again: the same command goes on after an interrupt,
    and adds drives, models or filters. After a quarter, half and three quarters of the frames, filters that are worse than the best at 95 %
    by a paired moving-block bootstrap are stopped.
    """
    seen = [score.Drive(str(pathlib.Path(drive).resolve()), frames, kind or None) for kind in ["", *filter(None, kinds.split(","))] for drive in drives]
    seen += [score.Drive(str(pathlib.Path(drive).resolve()), held_out_frames, held_out=True) for drive in held_out]
    if twice := [name for name, count in collections.Counter((drive.name, drive.held_out) for drive in seen).items() if count > 1]:
        raise ValueError(f"DRIVE: expected each name once, found {twice[0][0]} twice")
    layers = layers_of(models, config, overrides, baselines)
    if planned:
        return click.echo(plan(planned, layers, seen, jobs or len(os.sched_getaffinity(0))))
    candidates = part_of([(layer, k) for layer in layers if not layer.is_baseline for k in filters_of(layer, filters or ":")], shard)
    candidates += [(layer, k) for layer in layers if layer.is_baseline for k in range(layer.num_filters)]
    open_folder(out, "search")
    rows, shares = Rows(out / "rows.csv", COLUMNS, len(KEY), others), SHARES[-1:] if exhaustive else SHARES
    with work.workers(jobs, address, ray) as workers, tqdm.tqdm(unit=" filter-frames", disable=None) as bar:
        search = Search(seen, rows, candidates, workers, bar.update)
        search.race(shares)
    table = search.table(shares)
    click.echo(write_results(out, table))
    for line in (*judged(table, seen), *too_short(seen)):
        click.echo(line)
