# SPDX-License-Identifier: MIT
"""stemvo-lab robustness: channels compared on disturbed frames."""

import dataclasses
import hashlib
import json
import pathlib

import click
import numpy as np
import tqdm
from scipy.spatial.transform import Rotation

import stemvo
from stemvo.lab import bootstrap, score, work
from stemvo.lab.disturbances import ALL, Disturbed, find
from stemvo.lab.ranking import number
from stemvo.lab.rows import Rows
from stemvo.lab.runs import open_folder, options_of, program_hash

CONTROLS = ("gray", "red", "green", "blue", "log", "census", "orb", "sift")
COLORS = {"red": 0, "green": 1, "blue": 2}
JUMP_DEG = 1.0
KEY = ("channel_hash", "drive", "drive_hash", "disturbance", "strength")
COLUMNS = (*KEY, "channel", "t_rel_percent", "r_rel_deg_per_100m", "tracked", "recovery_frames", "recovered", "jumps", "block", "dense_t_percent",
           "dense_r_deg_per_100m", "refused")


@dataclasses.dataclass(frozen=True)
class Task:
    channel: str
    options: tuple
    has_true_steps: bool
    drive: score.Drive
    disturbance: str  # `none`: the frames as they are
    strength: float


def contenders(judged, names):
    """Name -> options: all else alike but for orb and sift, the paper's pairs of frames on gray."""
    made = {"judged": judged}
    for name in names:
        model, colon, k = name.rpartition(":")
        if colon and k.isdigit() and model:
            made[name] = judged | {"stem.model": model, "stem.filter": int(k)} | ({} if model == judged.get("stem.model", "default") else {"stem.sampling_px": 0})
        elif name in CONTROLS:
            made[name] = judged | {"stem.model": name, "stem.filter": -1, "stem.sampling_px": 0}
            if name in COLORS:
                made[name] |= {"stem.model": "input_layer", "stem.filter": COLORS[name]}
            if name in ("orb", "sift"):
                made[name] |= {"stem.model": "gray", "features.method": name, "odometry.mode": "two_frame"}
        else:
            raise ValueError(f"--controls: expected some of {', '.join(CONTROLS)} or MODEL:FILTER, found '{name}'")
    return made


def outcome(task):
    """One drive under one disturbance through one channel."""
    recording = task.drive.open()
    if task.disturbance != "none":
        how = find(task.disturbance)
        recording = Disturbed(recording, how, how.strengths.index(task.strength))
    row = dict.fromkeys(COLUMNS[len(KEY) + 1 :])
    try:
        odometry = stemvo.Odometry(recording.camera, dict(task.options) | {"threads": 1})
    except ValueError as error:
        return row | {"refused": str(error)}
    states, poses = [], []
    for image, time in (recording[i] for i in range(len(recording))):
        result = odometry.process(image, time) if image is not None else None
        states.append((result.is_measured, result.is_measured and result.state != "initializing") if result else (False, False))
        poses.append(result.world_from_camera if result else poses[-1] if poses else np.eye(4))
    is_disturbed = [task.disturbance != "none" and recording.is_disturbed(i) for i in range(len(recording))]
    truth, poses = recording.ground_truth, np.stack(poses)
    scaled = stemvo.rescale_steps(poses, truth) if task.has_true_steps else poses
    metrics, dense = stemvo.evaluate(scaled, truth), stemvo.dense_errors(scaled, truth, 2**31)
    is_found = [found for _, found in states]
    return row | {name: metrics[name] for name in ("t_rel_percent", "r_rel_deg_per_100m")} | recovery(is_found, is_disturbed) | {
        "tracked": np.mean([measured for measured, _ in states]), "jumps": jumps(is_found, poses, truth), "block": dense["block"],
        "dense_t_percent": " ".join(map(repr, dense["t_percent"].tolist())), "dense_r_deg_per_100m": " ".join(map(repr, dense["r_deg_per_100m"].tolist()))}


def recovery(is_found, is_disturbed):
    """Frames from the end of a disturbance to the first that is found again, the longest of them; not recovered: the drive, or the calm
    before the next disturbance, ended before."""
    longest, recovered, lost, is_searching = None, True, 0, False
    for found, disturbed in zip(is_found, is_disturbed):
        if disturbed:
            is_searching, recovered, lost = True, recovered and lost == 0, 0
        elif is_searching:
            is_searching = not found
            lost += is_searching
            longest = max(longest or 0, lost)
            lost = lost if is_searching else 0
    return {"recovery_frames": longest, "recovered": recovered and lost == 0}


def jumps(is_found, poses, truth):
    """Steps between found frames whose rotation is wrong by more than a degree."""
    turns = [Rotation.from_matrix(one[:, :3, :3]) for one in (poses, truth)]
    found, true = (one[:-1].inv() * one[1:] for one in turns)
    return int(np.sum((np.degrees((found.inv() * true).magnitude()) > JUMP_DEG) & is_found[:-1] & is_found[1:]))


@dataclasses.dataclass
class Line:
    """One disturbance at one strength: per channel a row per drive, per control (rotation, translation)."""

    disturbance: str
    group: str
    strength: float
    rows: dict
    verdicts: dict = dataclasses.field(default_factory=dict)

    def judge(self):
        judged, *controls = self.rows
        for control in controls:
            pairs = list(zip(self.rows[judged], self.rows[control]))
            refused = any(one["refused"] for pair in pairs for one in pair)  # drives that are left would be another row
            self.verdicts[control] = tuple(
                bootstrap.paired_ratio([] if refused else [bootstrap.Drive(*(np.array(one[name].split(), float) for one in pair), int(pair[0]["block"])) for pair in pairs])
                for name in ("dense_r_deg_per_100m", "dense_t_percent"))

    def mean(self, channel, name="r_rel_deg_per_100m"):
        numbers = [number(row[name]) for row in self.rows[channel]]
        return None if None in numbers else float(np.mean(numbers))


def geometric_mean(values):
    return float(np.exp(np.mean(np.log(values)))) if values else None


def summaries(lines, control):
    """Groups in the order of the lines, then all: geometric means over lines that have an interval, and how many are decided for whom."""
    groups, result = {group: [line for line in lines if line.group == group] for group in dict.fromkeys(line.group for line in lines)}, []
    for group, found in [*groups.items(), ("all", lines)]:
        rotation, translation = zip(*(line.verdicts[control] for line in found))
        means = [geometric_mean([one.ratio for one in kind if np.isfinite(one.high)]) for kind in (rotation, translation)]
        result.append({"group": group, "rows": len(found), "control": control, "rotation_ratio": means[0], "translation_ratio": means[1],
                       "decided_for_judged": sum(one.high < 1.0 for one in rotation), "decided_for_control": sum(one.low > 1.0 for one in rotation)})
    return result


def by_drive(lines, control, drives):
    judged = next(iter(lines[0].rows))
    errors = [[[number(row["r_rel_deg_per_100m"]) or 0.0 for row in line.rows[one]] for one in (judged, control)] for line in lines]
    return [{"drive": drive.road, "control": control, "rotation_ratio": geometric_mean([a / b for a, b in of_drive if a > 0 and b > 0])}
            for drive, of_drive in zip(drives, np.transpose(errors, (2, 0, 1)))]


def words(ratio):
    return f"{'*' if ratio.is_decided else ''}{ratio.ratio:.2f} {ratio.low:.2f}-{ratio.high:.2f}" if np.isfinite(ratio.high) else "-"


def cell(line, channel):
    if any(row["refused"] for row in line.rows[channel]):
        return "refused"
    error, tracked = line.mean(channel), line.mean(channel, "tracked")
    return ("-" if error is None else f"{error:.2f}") + ("" if tracked > 0.995 else f" ({tracked:.2f})")


def document(lines, drives):
    controls = list(lines[0].verdicts)
    interval = lambda one: {"ratio": one.ratio, "low": one.low, "high": one.high if np.isfinite(one.high) else None, "decided": bool(one.is_decided)}
    rows = [{"disturbance": line.disturbance, "group": line.group, "strength": line.strength, "channels": [
        {"channel": name, "t_rel_percent": line.mean(name, "t_rel_percent"), "r_rel_deg_per_100m": line.mean(name), "tracked": line.mean(name, "tracked")}
        | ({"rotation_ratio": interval(line.verdicts[name][0]), "translation_ratio": interval(line.verdicts[name][1])} if name in line.verdicts else {})
        for name in line.rows]} for line in lines]
    return {"drives": [drive.road for drive in drives], "groups": [one for control in controls for one in summaries(lines, control)],
            "by_drive": [one for control in controls for one in by_drive(lines, control, drives)], "rows": rows}


def write_results(out, lines, drives):
    import pandas

    table = pandas.DataFrame([{"disturbance": line.disturbance, "strength": line.strength} | {name: cell(line, name) for name in line.rows}
                              | {f"over {name}": words(verdict[0]) for name, verdict in line.verdicts.items()} for line in lines])
    text, found = table.to_string(index=False), document(lines, drives)
    if lines[0].verdicts:
        groups = pandas.DataFrame([{"group": one["group"], "rows": one["rows"], "control": one["control"],
                                    "ratio": f"{one['rotation_ratio']:.2f} ({one['decided_for_judged']}, {one['decided_for_control']})" if one["rotation_ratio"] else "-"}
                                   for one in found["groups"]])
        text += ("\n\nTimes a control's rotation error (rows decided for the judged channel, for the control):\n"
                 + groups.pivot_table(index=["group", "rows"], columns="control", values="ratio", aggfunc="first", sort=False).reset_index().to_string(index=False))
    flat = [{"disturbance": line.disturbance, "strength": line.strength, "channel": name, "drive": drive.road} | {key: row[key] for key in COLUMNS[len(KEY) + 1 : -4]}
            for line in lines for name, rows in line.rows.items() for drive, row in zip(drives, rows)]
    pandas.DataFrame(flat).to_csv(out / "robustness.csv", index=False)
    (out / "robustness.json").write_text(json.dumps(found, indent=1) + "\n")
    (out / "robustness.txt").write_text(text + "\n")
    return text


def kinds_help():
    return "Only these: none (the frames as they are), " + "; ".join(f"{one.name}: {one.effect} ({', '.join(f'{s:g}' for s in one.strengths)})" for one in ALL)


@click.command()
@click.argument("drives", nargs=-1, required=True, type=click.Path(exists=True, file_okay=False), metavar="DRIVE..")
@click.option("--out", required=True, type=click.Path(path_type=pathlib.Path), help="Folder of rows.csv (only grows), robustness.csv, .json, .txt.")
@click.option("--frames", help="A:B of each drive.")
@click.option("--kinds", default="", help=kinds_help())
@click.option("--controls", default="", help=f"Only these: {', '.join(CONTROLS)}, or other filters, MODEL:K")
@click.option("--config", help="Configuration of the judged channel.")
@click.option("--set", "overrides", multiple=True, metavar="KEY=VALUE", help="A key of the configuration.")
@click.option("--jobs", type=click.IntRange(1), help="Processes; default: one per core.")
@click.option("--address", help="Of a Ray cluster; else this machine alone.")
@click.option("--ray/--no-ray", default=True, help="Processes of our own in place of Ray.")
def command(drives, out, frames, kinds, controls, config, overrides, jobs, address, ray):
    """Run drives in KITTI's layout with ground truth as they are and disturbed, through the configured channel and through controls.

    Every step has its true length (--set scale.source=camera_height: metres from the road instead). The table shows r_rel in degrees per
    100 m, in brackets the share of frames with a measured motion, and how many times as large the channel's rotation error is as a control's,
    with the 95 % interval; * where it leaves out 1. Rows in OUT/rows.csv are not computed again.
    """
    values = {"scale.source": "ground_truth"} | options_of(config, overrides)
    has_true_steps = values["scale.source"] == "ground_truth"
    values |= {"scale.source": "none"} if has_true_steps else {}
    opened = [score.Drive(str(pathlib.Path(drive).resolve()), frames) for drive in dict.fromkeys(drives)]
    has_color = any((drive.open()[0][0].ndim == 3) for drive in opened)
    channels = contenders(values, list(dict.fromkeys(filter(None, controls.split(",")))) or [one for one in CONTROLS if has_color or one not in COLORS])
    for options in channels.values():
        stemvo.Odometry(opened[0].open().camera, options | {"threads": 1})  # what is refused is refused now
    asked = list(filter(None, kinds.split(",")))
    planned = [("none", "none", 0.0)] if not asked or "none" in asked else []
    for one in [find(name) for name in asked if name != "none"] if asked else ALL:
        planned += [(one.name, one.group, strength) for strength in one.strengths]
    open_folder(out, "robustness")
    rows, hashes, program = Rows(out / "rows.csv", COLUMNS, len(KEY)), {drive: drive.hash() for drive in opened}, program_hash()
    tasks = {}
    for kind, _, strength in planned:
        for drive in opened:
            for name, options in channels.items():
                of = hashlib.sha256(f"{program} {sorted(options.items())} {has_true_steps}".encode()).hexdigest()[:16]
                tasks[kind, strength, drive, name] = Task(name, tuple(options.items()), has_true_steps, drive, kind, strength), (of, drive.name, hashes[drive], kind, strength)
    missing = {task: key for task, key in tasks.values() if rows.get(key) is None}
    if missing:
        with work.workers(jobs, address, ray) as workers:
            for task, row in tqdm.tqdm(work.run(workers, outcome, missing), total=len(missing), unit=" runs", disable=None):
                rows.append([dict(zip(KEY, missing[task])) | row | {"channel": task.channel}])
                if row["refused"]:
                    click.echo(f"{task.drive.name}, {task.disturbance} {task.strength}, {task.channel}: {row['refused']}", err=True)
    lines = [Line(kind, group, strength, {name: [rows.get(tasks[kind, strength, drive, name][1]) for drive in opened] for name in channels}) for kind, group, strength in planned]
    for line in lines:
        line.judge()
    click.echo(write_results(out, lines, opened))
