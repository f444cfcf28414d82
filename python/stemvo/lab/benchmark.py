# SPDX-License-Identifier: MIT
"""stemvo-lab benchmark: methods x sequences, beside zero motion and published numbers (docs/benchmark.md)."""

import pathlib
import sys

import click
import pandas as pd
import tqdm

import stemvo
from stemvo.lab import bootstrap, figures, page, runs, tables

COLUMNS = {"sequence": "sequence", "frames": "frames", "method": "method", "scale": "scale from", "alignment": "alignment",
           "t_rel_percent": "t_rel", "r_rel_deg_per_100m": "r_rel", "average_offset_m": "offset", "ate_rmse_m": "ATE", "note": "note"}
NUMBERS = ("t_rel_percent", "r_rel_deg_per_100m", "average_offset_m", "ate_rmse_m")
DECIMALS = {"r_rel": 3}
NOTES = ("t_rel in %, r_rel in degrees per 100 m (KITTI devkit), offset in m (mean of |dx| + |dz|), ATE in m (root mean square, after "
         "Sim(3)). Else nothing is aligned but where a row says so.",
         "Camera height: metres from the road and the camera's height above it. Per-step ground-truth scale: each step takes its true "
         "length (the paper's protocol), so direction and rotation are judged. Zero motion: what a path scores that stays at the start.")


def methods_of(configs, overrides, model, trajectories, scales):
    """Each configuration, and each folder of trajectory files, under each protocol."""
    made, label = [], f", {pathlib.Path(model).stem}" if model else ""
    for config in configs:
        options = runs.options_of(None if config == "default" else config, overrides, model)
        made += [runs.Method(pathlib.Path(config).stem + label, scale, options) for scale in scales]
    for text in trajectories:
        name, found, folder = text.partition("=")
        if not found or not pathlib.Path(folder).is_dir():
            raise ValueError(f"--trajectories: expected NAME=FOLDER of files NN.txt, found '{text}'")
        made += [runs.Method(name, scale, folder=pathlib.Path(folder))
                 for scale in (runs.AS_IT_COMES, runs.TRUE_STEPS) if runs.TRUE_STEPS in scales or scale == runs.AS_IT_COMES]
    for method in made:
        method.settings()  # a wrong key is an error now
    if repeated := {method.title for method in made if sum(other.title == method.title for other in made) > 1}:
        raise ValueError(f"expected methods of different names, found two of '{min(repeated)}'")
    return made


def folder_of(out, method, sequence):
    return out / "runs" / sequence.name / f"{method.name}_{method.scale}".replace("/", "_").replace(" ", "_").replace(",", "")


def measure_all(methods, sequences, out):
    """Rows, and the poses of each run by (sequence, title)."""
    rows, poses = [], {}
    with tqdm.tqdm(total=len(methods) * len(sequences), unit="run", disable=None) as bar:
        for sequence in sequences:
            for method in methods if not sequence.problem else methods[:1]:
                bar.set_description(f"{sequence.name}, {method.title}")
                row, found = runs.run(method, sequence, folder_of(out, method, sequence))
                if sequence.problem:
                    row |= {"method": "-", "scale": "-"}
                rows.append(row | {"frames": sequence.frames_text})
                if found is not None:
                    poses[sequence.name, method.title] = found
                bar.update()
            rows += baseline_rows(sequence)
    return pd.DataFrame(rows).reindex(columns=[*dict.fromkeys([*COLUMNS, "state", "problem", "tracked_fraction", *runs.METRICS])]), poses


def baseline_rows(sequence):
    """Zero motion, and the published numbers where all official frames ran."""
    rows = [] if sequence.zero_motion is None else [
        {"method": "zero motion", "scale": "-", "alignment": "none", "average_offset_m": sequence.zero_motion["average_offset_m"]}]
    for one in runs.published()["published"] if sequence.is_complete else []:
        numbers = {key: one[key].get(sequence.name) for key in NUMBERS}
        if any(number is not None for number in numbers.values()):
            rows.append(numbers | {"method": one["method"], "scale": one["scale_source"], "alignment": one["alignment"], "note": f"published: {one['source']}"})
    return [{"sequence": sequence.name, "frames": sequence.frames_text, "state": "known"} | row for row in rows]


def with_notes(rows):
    measured = rows["tracked_fraction"].map(lambda share: "" if pd.isna(share) else f"{100.0 * share:.1f} % of the frames measured")
    return rows.assign(note=rows["note"].astype(object).fillna(rows["problem"].astype(object).fillna(measured)))


def overview(rows):
    """A row per method, a column per sequence: t_rel / r_rel / offset."""
    ran = rows[rows["method"] != "-"]
    texts = [" / ".join(tables.cell(row[key]) for key in NUMBERS[:3]) if row["state"] in ("done", "known") else row["state"]
             for _, row in ran.iterrows()]
    wide = ran.assign(text=texts, row=(ran["method"] + ", " + ran["scale"]).str.removesuffix(", -"), column=ran["sequence"] + ": " + ran["frames"])
    wide = wide[~wide["note"].astype(object).fillna("").str.startswith("published")].pivot_table("text", "row", "column", "first", sort=False)
    return wide.rename_axis(index="t_rel / r_rel / offset", columns=None).reset_index()


def told_best(methods, sequences, poses):
    """One line per protocol: who has the smallest t_rel, where it is told from every other row."""
    lines = []
    for scale in dict.fromkeys(method.scale for method in methods):
        errors = {method.name: [_dense(poses.get((sequence.name, method.title)), sequence) for sequence in sequences]
                  for method in methods if method.scale == scale}
        if len(errors) > 1:
            best = bootstrap.best_of(errors)
            lines.append(f"Smallest t_rel, {scale}: " + (f"{best}, told from every other method (paired moving-block bootstrap, 95 %)." if best
                                                         else "none is told from every other method (paired moving-block bootstrap, 95 %)."))
    return lines


def _dense(poses, sequence):
    if poses is None or sequence.truth is None:
        return None
    found = stemvo.dense_errors(poses[sequence.recording.ground_truth_frames], sequence.truth)
    return found["t_percent"], found["block"]


def positions_of(sequence, methods, poses):
    """Of the truth and of each method that ran, moved to start at the first true pose."""
    if sequence.truth is None:
        return {method.title: poses[sequence.name, method.title][:, :3, 3] for method in methods if (sequence.name, method.title) in poses}
    frames = sequence.recording.ground_truth_frames
    found = {figures.TRUTH: stemvo.align(sequence.truth, sequence.truth, align="none")[:, :3, 3]}
    return found | {method.title: stemvo.align(poses[sequence.name, method.title], sequence.truth, frames, "none")[:, :3, 3]
                    for method in methods if (sequence.name, method.title) in poses}


def bars_of(rows, key):
    known = rows[rows[key].notna()]
    return {name: ((group["sequence"] + ", " + group["frames"]).tolist(), group[key].tolist())
            for name, group in known.groupby((known["method"] + ", " + known["scale"]).str.removesuffix(", -"), sort=False)}


def write_report(out, rows, notes, methods, sequences, poses):
    shown = with_notes(rows)[list(COLUMNS)].rename(columns=COLUMNS)
    text = tables.write(shown, out / "benchmark", f"Benchmark, stemvo {stemvo.__version__}", notes, DECIMALS)
    tables.write(overview(rows), out / "overview", "All sequences", notes)
    drawn = {sequence.name: positions_of(sequence, methods, poses) for sequence in sequences if not sequence.problem}
    drawn = {name: paths for name, paths in drawn.items() if any(one != figures.TRUTH for one in paths)}
    if drawn:
        figure, axes = figures.sheet(len(drawn))
        for axis, (name, paths) in zip(axes, drawn.items()):
            figures.draw_paths(axis, paths, name, runs.GROUND)
        figures.legend(figure, axes)
        figures.save(figure, out / "paths")
    sections = [(title, figures.page_bars(bars_of(rows, key), title)) for key, title in
                (("t_rel_percent", "t_rel, %"), ("r_rel_deg_per_100m", "r_rel, deg/100 m"), ("average_offset_m", "offset, m"))
                if rows[key].notna().any()]
    sections += [(f"{name}: from above", "Nothing is aligned afterwards.", figures.page_paths(paths, runs.GROUND)) for name, paths in drawn.items()]
    sections += [("All numbers", tables.formatted(shown, DECIMALS), *notes),
                 *((f"Configuration: {method.title}", str(method.settings())) for method in methods if method.folder is None)]
    page.write(out / "report.html", f"Benchmark, stemvo {stemvo.__version__}", sections)
    return text


@click.command()
@click.argument("kitti", type=click.Path(path_type=pathlib.Path))
@click.option("--out", required=True, type=click.Path(path_type=pathlib.Path), help="Folder of tables, figures, report.html and runs/")
@click.option("--sequences", default="", help="Only these, e.g. 00,02; default: all")
@click.option("--config", "configs", multiple=True, help="default, paper or a file; each is a method. Default: default and paper")
@click.option("--set", "overrides", multiple=True, metavar="KEY=VALUE", help="In every configuration")
@click.option("--model", help="In every configuration: a name or an .onnx file")
@click.option("--trajectories", multiple=True, metavar="NAME=FOLDER", help="Another program's files NN.txt (KITTI, TUM or EuRoC)")
@click.option("--scale", type=click.Choice(["both", "road", "steps"]), default="both", help="Metres from the road, or true step lengths")
@click.option("--frames", type=click.IntRange(2), help="Only so many of each sequence")
def command(kitti, out, sequences, configs, overrides, model, trajectories, scale, frames):
    """Methods on the sequences of KITTI (sequences/NN, poses/NN.txt). The same command again repeats only what changed."""
    scales = {"both": (runs.ROAD, runs.TRUE_STEPS), "road": (runs.ROAD,), "steps": (runs.TRUE_STEPS,)}[scale]
    methods = methods_of(configs or (() if trajectories and not (overrides or model) else ("default", "paper")),
                         overrides, model, trajectories, scales)
    found = runs.sequences_of(kitti, [name for name in sequences.split(",") if name], frames)
    runs.open_folder(out, "benchmark")
    rows, poses = measure_all(methods, found, out)
    click.echo(write_report(out, rows, [*NOTES, *told_best(methods, found, poses)], methods, found, poses))
    failed = rows[rows["state"] == "failed"]
    for _, row in failed.iterrows():
        click.echo(f"error: {row['sequence']}, {row['method']}, {row['scale']}: {row['problem']}", err=True)
    sys.exit(1 if len(failed) else 0)
