# SPDX-License-Identifier: MIT
"""stemvo-lab compare: results and trajectory files of any program against one ground truth (docs/benchmark.md)."""

import dataclasses
import itertools
import pathlib

import click
import numpy as np
import pandas as pd

import stemvo
from stemvo.lab import bootstrap, figures, page, runs, tables

ALIGNMENTS = {"none": "Nothing is aligned: each path starts at the first true pose", "scale": "Each path is scaled to the truth (one factor)",
              "se3": "Each path is turned and moved onto the truth (6 degrees of freedom)",
              "sim3": "Each path is turned, moved and scaled onto the truth (Sim(3), 7 degrees of freedom)"}
METRICS = {"poses": "poses", "t_rel_percent": "t_rel, %", "r_rel_deg_per_100m": "r_rel, deg/100 m", "ate_rmse_m": "ATE, m",
           "average_offset_m": "offset, m", "rpe_translation_m": "RPE, m", "rpe_rotation_deg": "RPE, deg"}
SHARE, MOST_SEGMENTS = 1 / 16, 800  # of the path: segments that differences are taken of
DECIMALS = {"ATE, m": 3, "RPE, m": 4, "RPE, deg": 4, "r_rel, deg/100 m": 3}


@dataclasses.dataclass
class Path:
    """Of one program, at the poses that have a true one. poses: aligned; frames: which of the truth's poses."""

    name: str
    file: pathlib.Path
    poses: np.ndarray
    frames: np.ndarray
    metrics: dict


def trajectory_in(given):
    """The file itself, or that of a result's folder: the adjusted one is a file of its own."""
    file = given / "trajectory_tum.txt" if given.is_dir() else given
    if not file.exists():
        raise ValueError(f"{given}: expected a trajectory file or a result of `stemvo run`, found none")
    return file


def load(given, name, truth_file, align, camera_file, tolerance_s, first):
    file = trajectory_in(given)
    true_poses, true_times = stemvo.read_trajectory(truth_file, camera_file)
    poses, times = stemvo.read_trajectory(file)
    if len(poses) < 2:
        raise ValueError(f"{file}: expected 2 poses or more, found {len(poses)}")
    if true_times is not None and times is not None:
        which, frames = stemvo.pair_by_time(times, true_times, tolerance_s)
    elif first is None and len(poses) != len(true_poses):
        raise ValueError(f"{file}: expected {len(true_poses)} poses, one per line of {truth_file}, found {len(poses)}; "
                         "where times are missing --first says which true pose goes with the first")
    elif (first or 0) + len(poses) > len(true_poses):
        raise ValueError(f"--first: expected a line of {truth_file} ({len(true_poses)} poses) from which {len(poses)} follow, those of {file}, found {first}")
    else:
        which, frames = np.arange(len(poses)), np.arange(len(poses)) + (first or 0)
    if len(frames) < 2:
        raise ValueError(f"{file}: expected times of {truth_file}, found {len(frames)} within {tolerance_s} s")
    poses, truth = poses[which], true_poses[frames]
    metrics = stemvo.evaluate(poses, truth, align)
    metrics |= {"poses": len(poses), "ate_rmse_m": metrics["ate_rmse_m"][align]}
    return Path(name, file, stemvo.align(poses, truth, align=align), frames, metrics)


def common(paths, true_poses, align):
    """The paths at the poses that all of them have, aligned there anew, and the truth of these."""
    frames = set(paths[0].frames.tolist()).intersection(*(path.frames.tolist() for path in paths[1:]))
    if len(frames) < 2:
        raise ValueError(f"expected paths that share poses, found {len(frames)} in common")
    frames = np.array(sorted(frames))
    found = {path.name: stemvo.align(path.poses[np.isin(path.frames, frames)], true_poses[frames], align=align) for path in paths}
    truth = stemvo.align(true_poses[frames], true_poses[frames], align="none")
    return found, truth


def distance_along(truth):
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(truth[:, :3, 3], axis=0), axis=1))])


def by_segment(aligned, truth):
    """A row per path and length of segments: mean errors."""
    rows = []
    for name, poses in aligned.items():
        errors = pd.DataFrame(stemvo.segment_errors(poses, truth))
        rows += [{"path": name, "segment, m": float(length), "segments": len(group), "t_rel, %": group["t_percent"].mean(),
                  "r_rel, deg/100 m": group["r_deg_per_100m"].mean()} for length, group in errors.groupby("length_m")]
    return pd.DataFrame(rows, columns=["path", "segment, m", "segments", "t_rel, %", "r_rel, deg/100 m"])


def dense_errors(poses, truth):
    """Errors of segments of SHARE of the path, evenly spaced, and how many neighbours overlap."""
    every = (len(truth) - 1) // MOST_SEGMENTS + 1
    errors = stemvo.segment_errors(poses, truth, [SHARE * distance_along(truth)[-1]], every)
    block = max(-(-(errors["last"] - errors["first"]) // every), default=1)
    return errors, block


def differences(aligned, truth):
    """A row per pair: how much larger the first's errors are than the second's, in the mean, with 95 % intervals."""
    dense = {name: dense_errors(poses, truth) for name, poses in aligned.items()}
    rows = []
    for (first, (mine, block)), (second, (theirs, _)) in itertools.combinations(dense.items(), 2):
        row = {"pair": f"{first} - {second}"}
        for key, title, decimals in (("t_percent", "t_rel, %", 2), ("r_deg_per_100m", "r_rel, deg/100 m", 3)):
            found = bootstrap.difference([bootstrap.Drive(mine[key], theirs[key], block)])
            is_bounded = np.isfinite(found.low)
            row[title] = f"{found.middle:+.{decimals}f} [{found.low:+.{decimals}f}, {found.high:+.{decimals}f}]" if is_bounded else "too few shared frames"
            row[f"smaller {title.split(',')[0]}"] = (first if found.middle < 0.0 else second) if found.is_told else "not told apart"
        rows.append(row)
    return pd.DataFrame(rows)


def compare(paths, truth_file, camera_file, align):
    """Tables by name, and lines of figures by name: {title: (lines, x title, y title)}."""
    true_poses = stemvo.read_trajectory(truth_file, camera_file)[0]
    aligned, truth = common(paths, true_poses, align)
    along = distance_along(truth)
    still = stemvo.evaluate(np.tile(np.eye(4), (len(truth), 1, 1)), truth)
    rows = [{"path": path.name} | {title: path.metrics[key] for key, title in METRICS.items()} for path in paths]
    rows.append({"path": "zero motion", "poses": len(truth), "ATE, m": still["ate_rmse_m"]["none"], "offset, m": still["average_offset_m"]})
    segments = by_segment(aligned, truth)
    lines = {"Position error over distance": ({name: (along, np.linalg.norm(poses[:, :3, 3] - truth[:, :3, 3], axis=1))
                                               for name, poses in aligned.items()}, "distance, m", "position error, m")}
    for column in ("t_rel, %", "r_rel, deg/100 m"):
        by_length = {name: (group["segment, m"].to_numpy(), group[column].to_numpy())
                     for name, group in segments.groupby("path", sort=False) if len(group)}
        if by_length:
            lines[f"{column.split(',')[0]} by segment"] = (by_length, "segment, m", column)
    positions = {figures.TRUTH: truth[:, :3, 3], **{name: poses[:, :3, 3] for name, poses in aligned.items()}}
    found = {"numbers": pd.DataFrame(rows), "segments": segments}
    if len(aligned) > 1:
        found["differences"] = differences(aligned, truth)
    return found, lines, positions


def names_of(given):
    """Shortest ends of the paths that differ, without suffix."""
    parts = [path.resolve().with_suffix("").parts for path in given]
    parts = [part[:-1] if part[-1] in ("trajectory_tum", "trajectory_kitti") and len(part) > 1 else part for part in parts]
    for depth in range(1, max(map(len, parts)) + 1):
        names = ["/".join(part[-depth:]) for part in parts]
        if len(set(names)) == len(names):
            return names
    raise ValueError("expected different files, found one twice")


CAPTIONS = {"numbers": "Errors of each path", "segments": "Errors by length of the segments",
            "differences": "Differences of the mean errors of segments of a sixteenth of the path, paired, with 95 % intervals"}


def write_report(out, title, found, lines, positions, note, width):
    texts = [tables.write(table, out / name, CAPTIONS[name], [note], DECIMALS) for name, table in found.items()]
    spans = np.ptp(np.concatenate(list(positions.values())), axis=0)[figures.plane_of(np.concatenate(list(positions.values())))]
    height_in = figures.WIDTHS_IN[width] * (np.clip(spans[1] / max(spans[0], 1e-9), 0.3, 1.0) + 0.2)
    figure, axes = figures.sheet(1, width, 1, height_in)
    figures.draw_paths(axes[0], positions)
    figures.legend(figure, axes)
    figures.save(figure, out / "paths")
    for name, (curves, xlabel, ylabel) in lines.items():
        figure, axes = figures.sheet(1, width, 1, 0.62 * figures.WIDTHS_IN[width])
        figures.draw_lines(axes[0], curves, xlabel, ylabel)
        figures.legend(figure, axes)
        figures.save(figure, out / name.lower().replace(" ", "_"))
    page.write(out / "report.html", title, [
        ("Numbers", note + ".", tables.formatted(found["numbers"], DECIMALS)),
        *((CAPTIONS["differences"], tables.formatted(found["differences"], DECIMALS)) for _ in [0] if "differences" in found),
        ("Paths", figures.page_paths(positions)),
        *((name, figures.page_lines(*curves)) for name, curves in lines.items()),
        (CAPTIONS["segments"], tables.formatted(found["segments"], DECIMALS))])
    return "\n".join(texts)


@click.command()
@click.argument("given", nargs=-1, required=True, metavar="A B ..", type=click.Path(exists=True, path_type=pathlib.Path))
@click.option("--gt", required=True, type=click.Path(exists=True, dir_okay=False, path_type=pathlib.Path), help="True poses: KITTI, TUM, EuRoC")
@click.option("--out", required=True, type=click.Path(path_type=pathlib.Path), help="Folder of tables, figures and report.html")
@click.option("--align", type=click.Choice(list(ALIGNMENTS)), default="none", show_default=True, help="Of all paths, before every number")
@click.option("--names", help="Joined by commas, in the order of A B ..")
@click.option("--camera", type=click.Path(exists=True, path_type=pathlib.Path), help="With EuRoC's truth: whose T_BS counts")
@click.option("--tolerance", default=0.01, show_default=True, help="Seconds between a pose and its true one")
@click.option("--first", type=click.IntRange(0), help="Line of the truth (from 0) that all files without times begin at; times pair by themselves")
@click.option("--width", type=click.Choice(list(figures.WIDTHS_IN)), default="column", show_default=True, help="Of the figures: of a paper's")
def command(given, gt, out, align, names, camera, tolerance, first, width):
    """Results of `stemvo run`, or trajectory files of any program (KITTI, TUM, EuRoC), compared."""
    titles = names.split(",") if names else names_of(given)
    if len(titles) != len(given) or len(set(titles)) != len(titles):
        raise ValueError(f"--names: expected {len(given)} different names, found {len(titles)}")
    paths = [load(file, name, gt, align, camera, tolerance, first) for file, name in zip(given, titles)]
    found, lines, positions = compare(paths, gt, camera, align)
    runs.open_folder(out, "compare")
    click.echo(write_report(out, f"{' and '.join(titles)} against {gt.name}", found, lines, positions, ALIGNMENTS[align], width))
