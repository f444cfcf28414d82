# SPDX-License-Identifier: MIT
"""stemvo-lab paper: tables and figures of J. Imaging 2025, 11(5), 155, from weights and KITTI (docs/paper.md)."""

import dataclasses
import pathlib
import re

import click
import onnx
import pandas as pd
import tqdm

import stemvo
from stemvo.lab import figures, runs, score, tables
from stemvo.stems import export as exporter
from stemvo.stems import layer_list, metadata

SEQUENCES = ("00", "02", "05", "06", "08", "09")
TABLE_1 = {"ConvNeXtXLarge": (297, 332806, 36096, 296710), "EfficientNetV2L": (1031, 1253254, 261216, 992038),
           "NASNetLarge": (1041, 502407, 16434, 485973)}  # layers, filters, used, not used
NOT_DETECTED, LEAST_MEASURED = "Pose not detected", 0.5
SUFFIXES = (".h5", ".keras", ".safetensors", ".onnx", ".npz")


@dataclasses.dataclass(frozen=True)
class Layer:
    """One layer of a network, as a model that stemvo loads."""

    network: str
    name: str
    filters: int
    model: str
    stride_px: int = 1

    def options(self, number):
        """One filter at the layer's own stride, as the paper has it."""
        return {"stem.model": self.model, "stem.filter": number, "stem.sampling_px": self.stride_px}

    @property
    def stand_in(self):
        """What is said beside a number of it; empty: it is one of the paper's networks."""
        return "" if plain(self.network) in map(plain, TABLE_1) else f"stand-in: {self.network}"


def plain(name):
    return re.sub(r"[^a-z0-9]", "", name.lower())


def export(weights, layers, out, preprocessing=None):
    """The layers of a weights file (the stem, those named, or `all` that the paper's rule uses), and (layers, filters, used, not used) or None where a file does not tell."""
    if weights.suffix == ".onnx" and "stemvo.network" in (one.key for one in onnx.load(weights, load_external_data=False).metadata_props):
        return [_layer(weights, metadata.read(weights))], None
    rows = layer_list.read(weights)
    if layers == "all" and weights.suffix != ".npz":  # which holds one
        layers = ",".join(row.name for row in rows if row.used)
    more = [*(["--layers", layers] if layers not in (None, "all") else []), *(["--preprocessing", preprocessing] if preprocessing else [])]
    written, _ = exporter.export(exporter.options_of(weights, "--out", out / "models", *more))
    return [_layer(file, said) for file, said in written.items()], layer_list.totals(rows)


def _layer(file, said):
    return Layer(said["network"], said["layer"], int(said["filters"]), str(file), int(said["stride"]))


def weights_in(given):
    """The file, or all of a folder."""
    files = [given] if given.is_file() else sorted(file for file in given.iterdir() if file.suffix in SUFFIXES)
    if not files:
        raise ValueError(f"{given}: expected weights ({', '.join(SUFFIXES)}), found none")
    return files


def table_1(counted):
    """counted: name -> (layers of ours, totals or None)."""
    columns = ("Model", "Layers", "Filters", "Used", "Not used")
    rows = [dict(zip(columns, (f"{name} (the paper)", *numbers))) for name, numbers in TABLE_1.items()]
    for name, (layers, totals) in counted.items():
        mark = " (stand-in)" if layers[0].stand_in else " (counted)"
        known = totals or (len(layers), *[sum(layer.filters for layer in layers)] * 2, 0)
        rows.append(dict(zip(columns, (name + mark, *known))))
    return pd.DataFrame(rows)


def filters_of(layers, chosen, is_gray):
    """(label, options, note): the input's channels, and each layer's filters. A gray image has one channel, not three."""
    colors = Layer("", "input", 3, "input_layer")
    inputs = [("Input layer, gray" if is_gray else f"Input layer, {'RGB'[channel]}", colors.options(channel), "") for channel in range(1 if is_gray else 3)]
    begin, end = chosen or (0, None)
    return inputs + [(f"{layer.network} {layer.name}-{number}", layer.options(number), layer.stand_in)
                     for layer in layers for number in range(layer.filters)[begin:end]]


def table_2(layers, sequence, chosen, config, out):
    first = sequence.recording[0][0]
    rows = [{"Layer-filter": "(the true path)", **dict(zip(("E_t, m", "E_r, deg"), score.mean_motion(sequence.truth))), "t_rel, %": 0.0}]
    for label, options, note in tqdm.tqdm(filters_of(layers, chosen, first.ndim == 2), desc="Table 2", disable=None):
        method = runs.Method(label, runs.TRUE_STEPS, config | options)
        row, poses = runs.run(method, sequence, out / "runs" / sequence.name / re.sub(r"[^A-Za-z0-9.]+", "_", label))
        if poses is None:
            raise ValueError(f"{label}: {row['problem']}")
        is_detected = row["tracked_fraction"] * len(poses) >= LEAST_MEASURED * (len(poses) - 1) + 1
        motion = score.mean_motion(poses) if is_detected else (NOT_DETECTED, NOT_DETECTED)
        rows.append({"Layer-filter": label, "E_t, m": motion[0], "E_r, deg": motion[1], "t_rel, %": row["t_rel_percent"] if is_detected else None,
                     "measured, %": 100.0 * row["tracked_fraction"], "ran on": "; ".join(filter(None, (sequence.frames_text, note and "stand-in")))})
    return pd.DataFrame(rows)


def table_4(methods, sequences, published, out):
    """Offsets; and the poses by (sequence, method)."""
    rows, poses = [], {}
    for sequence in tqdm.tqdm(sequences, desc="Table 4", disable=None):
        row = {"Dataset": f"KITTI {sequence.name}", "Frames": "not there" if sequence.problem else sequence.frames_text}
        for column, offsets in published.items():
            row[column] = offsets.get(sequence.name)
        for method in [] if sequence.problem else methods:
            found, path = runs.run(method, sequence, out / "runs" / sequence.name / re.sub(r"[^A-Za-z0-9.]+", "_", method.name))
            row[method.name] = found["problem"] if path is None and method.folder is None else found.get("average_offset_m")
            if path is not None:
                poses[sequence.name, method.name] = path
        row["zero motion"] = None if sequence.problem or sequence.truth is None else sequence.zero_motion["average_offset_m"]
        rows.append(row)
    return pd.DataFrame(rows), poses


def figure_1(layers, sequence, number, out):
    """The input, and one filter of each layer, as the tracker sees it."""
    image, time = sequence.recording[0]
    figure, axes = figures.sheet(1 + len(layers), columns=2, height_in=1.25 * -(-(1 + len(layers)) // 2))
    axes[0].imshow(image, cmap="gray")
    axes[0].set_title(f"(a) KITTI {sequence.name}, the input")
    for panel, (axis, layer) in enumerate(zip(axes[1:], layers), 1):
        shown = min(number, layer.filters - 1)
        odometry = stemvo.Odometry(sequence.recording, layer.options(shown) | {"stem.tracking_resolution": "native"})
        odometry.process(image, time)
        axis.imshow(odometry.channel_image(), cmap="gray")
        letter = chr(ord("a") + panel % 26) * (panel // 26 + 1)  # a to z, aa to zz
        axis.set_title(f"({letter}) {layer.network}, {layer.name}, filter {shown}", wrap=True, fontsize=7)
    for axis in axes:
        axis.set(xticks=[], yticks=[])
    figures.save(figure, out / "figure1")


def maps(sequences, poses, method, out, title):
    """Six maps of one method over the ground truth; one that is not there says so."""
    figure, axes = figures.sheet(len(sequences))
    for axis, sequence in zip(axes, sequences):
        path = poses.get((sequence.name, method))
        if path is None or sequence.truth is None:
            axis.text(0.5, 0.5, "no recording" if sequence.problem else "no trajectory", ha="center", va="center", transform=axis.transAxes)
            axis.set(title=f"KITTI {sequence.name}", xticks=[], yticks=[])
            continue
        truth = stemvo.align(sequence.truth, sequence.truth, align="none")[:, :3, 3]
        drawn = stemvo.align(path, sequence.truth, sequence.recording.ground_truth_frames, "none")[:, :3, 3]
        figures.draw_paths(axis, {figures.TRUTH: truth, method: drawn}, f"KITTI {sequence.name}, {sequence.frames_text}", runs.GROUND)
    figures.legend(figure, axes)
    figures.save(figure, out / title)


def published_offsets():
    found = {one["method"]: one["average_offset_m"] for one in runs.published()["published"]}
    return {f"{name}, published": found[method] for name, method in (("DeepVO", "DeepVO, as the paper has it"),
                                                                      ("TartanVO", "TartanVO, as the paper has it"), ("the paper", "the paper"))}


CAPTIONS = {"figure1": "Channels of the layers", "figure3": "Trajectories of ours", "figure4": "Trajectories of DeepVO", "figure5": "Trajectories of TartanVO"}


def write_document(out, names):
    """paper.tex, which LaTeX compiles, with all tables and figures; paper.md and paper.txt with the tables."""
    drawn = [name for name in CAPTIONS if (out / f"{name}.pdf").exists()]
    body = [rf"\input{{{name}.tex}}" for name in names]
    fitted = r"\includegraphics[width=\textwidth,height=0.9\textheight,keepaspectratio]"
    body += [rf"\begin{{figure*}}\centering{fitted}{{{name}.pdf}}\caption{{{CAPTIONS[name]}}}\end{{figure*}}" for name in drawn]
    (out / "paper.tex").write_text("\n".join([r"\documentclass[twocolumn]{article}", r"\usepackage{booktabs,graphicx}",
                                              r"\usepackage[margin=15mm]{geometry}", r"\begin{document}", *body, r"\end{document}"]) + "\n")
    for suffix in (".md", ".txt"):
        shown = [(out / f"{name}{suffix}").read_text() for name in names]
        shown += [f"![{CAPTIONS[name]}]({name}.svg)\n" for name in drawn if suffix == ".md"]
        (out / f"paper{suffix}").write_text("\n".join(shown))
    return (out / "paper.txt").read_text()


def reproduce(weights, kitti, out, layers, preprocessing, chosen, frames, winner, config, others):
    options = runs.options_of(None if config == "default" else config)
    counted = {file.stem: export(file, layers, out, preprocessing) for file in weights_in(weights)}
    every = [layer for made, _ in counted.values() for layer in made]
    sequences = runs.sequences_of(kitti, SEQUENCES)
    ran = [sequence for sequence in sequences if not sequence.problem and sequence.truth is not None]
    if not ran:
        raise ValueError(f"{kitti}: expected sequences {', '.join(SEQUENCES)} with true poses, found none")
    for_filters = runs.Sequence(kitti, ran[0].name, ran[0].official, min(frames, len(ran[0])))
    tables.write(table_1(counted), out / "table1", "Table 1: layers and filters", [
        "Used: plain convolutions, the rule that gives the paper's numbers on its networks. A stem's file holds one layer."])
    tables.write(table_2(every, for_filters, chosen, options, out), out / "table2", "Table 2: motion between consecutive poses", [
        f"KITTI {for_filters.name}, {for_filters.frames_text}, configuration {config}, each step of true length. E_t and E_r take no ground "
        "truth: a camera that stands scores 0; t_rel is the error."], {"measured, %": 1, "E_t, m": 3, "E_r, deg": 3})
    filter_number = min(winner, every[0].filters - 1)
    ours = f"ours, {'stand-in ' if every[0].stand_in else ''}{every[0].name}-{filter_number}"
    methods = [runs.Method(ours, runs.TRUE_STEPS, options | every[0].options(filter_number)),
               runs.Method("ORB on the gray image", runs.TRUE_STEPS, options | Layer("", "gray", 1, "gray").options(0)),
               runs.Method("stemvo's defaults", runs.TRUE_STEPS, {}),
               *(runs.Method(f"{name}, its path", runs.AS_IT_COMES, folder=folder) for name, folder in others.items() if folder)]
    offsets, poses = table_4(methods, sequences, published_offsets(), out)
    tables.write(offsets, out / "table4", "Table 4: average offset error, m", [
        f"Mean of |dx| + |dz|; ours with configuration {config} and each step of true length. A published number is of all official frames; "
        f"beside a clip it is no comparison. Ours: filter {filter_number} of {every[0].name} of {every[0].network}"
        + (", which stands in for the paper's" if every[0].stand_in else "") + ". Zero motion: a path that stays at the start."])
    figure_1(every, ran[0], winner, out)
    maps(sequences, poses, ours, out, "figure3")
    for name, title in (("DeepVO", "figure4"), ("TartanVO", "figure5")):
        if others.get(name):
            maps(sequences, poses, f"{name}, its path", out, title)
    return write_document(out, ("table1", "table2", "table4"))


@click.command()
@click.argument("weights", type=click.Path(exists=True, path_type=pathlib.Path))
@click.argument("kitti", type=click.Path(exists=True, file_okay=False, path_type=pathlib.Path))
@click.option("--out", required=True, type=click.Path(path_type=pathlib.Path), help="Folder of tables, figures, paper.tex and runs/")
@click.option("--layers", metavar="A,B,..", help="Of each network, by name, or all (default: its stem; deeper ones: of a whole .onnx)")
@click.option("--preprocessing", help="What a whole .onnx is fed: none, unit, imagenet, ..")
@click.option("--filters", metavar="A:B", help="Of each layer, in Table 2 (default: all)")
@click.option("--frames", type=click.IntRange(2), default=200, show_default=True, help="Of the first sequence, in Table 2")
@click.option("--filter", "winner", type=click.IntRange(0), default=10, show_default=True, help="Of the first layer, in Table 4 and the figures")
@click.option("--config", default="paper", show_default=True, help="paper, default or a file")
@click.option("--deepvo", type=click.Path(exists=True, file_okay=False, path_type=pathlib.Path), help="Folder of its files NN.txt: Figure 4")
@click.option("--tartanvo", type=click.Path(exists=True, file_okay=False, path_type=pathlib.Path), help="Likewise: Figure 5")
def command(weights, kitti, out, layers, preprocessing, filters, frames, winner, config, deepvo, tartanvo):
    """The paper's tables 1, 2 and 4 and figures 1, 3, 4 and 5 from WEIGHTS (a file or a folder of them) and KITTI."""
    chosen = re.fullmatch(r"(\d+):(\d+)", filters or "0:1")
    if not chosen:
        raise ValueError(f"--filters: expected A:B, found '{filters}'")
    runs.open_folder(out, "paper")
    click.echo(reproduce(weights, kitti, out, layers, preprocessing, tuple(map(int, chosen.groups())) if filters else None, frames, winner,
                         config, {"DeepVO": deepvo, "TartanVO": tartanvo}))
