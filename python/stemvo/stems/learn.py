# SPDX-License-Identifier: MIT
"""stemvo-lab learn: a stem of rendered drives, in closed form, or one filter by gradient through the aligner (docs/lab/default_model.md)."""

import dataclasses
import pathlib
import types

import click
import numpy as np

from ..lab import warps
from . import discriminant, drive, metadata, onnx_writer, show
from . import stem as stem_module

FILTERS = 16
ROUNDING = 2.0**-14  # of the filters' largest weight: the last bits of another machine's linear algebra do not change the file
NUM_LEAVES, FRAMES = 72, 12  # self-made images, frames of a drive: what the gradient sees
NUISANCE, VIEWS = discriminant.Nuisance(), drive.Views()


def collect(drives, options):
    """Pairs of patches of every frame and the next, all drives."""
    rng = np.random.default_rng(options.seed)
    views = drive.Views(options.zoom, options.rotation)
    size = options.kernel
    scatter = discriminant.Scatter(size)
    for frames in drives:
        gray = frames.gray(0)
        for before in range(len(frames) - 1):
            next_gray = frames.gray(before + 1)
            corners = drive.corresponding_corners(frames, before, before + 1, size, options.sampling, options.pairs, rng)
            slopes = [drive.patches(slope, corners[0], size) for slope in np.gradient(gray)[::-1]] if options.objective == "tracking" else ()
            scatter.add(drive.patches(gray, corners[0], size), views.patches(next_gray, corners[1], size, rng), slopes)
            gray = next_gray
    if scatter.count < 100 * FILTERS:
        raise ValueError(f"{options.drives[-1]}: expected at least {100 * FILTERS} patches seen in two frames, found {scatter.count}")
    return scatter


def learn(scatter, nuisance, options):
    """The stem, and the discriminant ratio of each of its filters."""
    signal = scatter.signal()
    has_norm = options.floor > 0
    noise, count = scatter.noise(nuisance), FILTERS - has_norm
    filters, ratios = (discriminant.tracking_filters(scatter.slopes(), noise, count) if options.objective == "tracking"
                       else discriminant.generalised_eigenvectors(signal, noise, count))
    units, step = whole(discriminant.with_signs(filters, signal))
    if has_norm:
        # It subtracts the mean over the channels. A last filter that makes all of them sum to zero
        # leaves the others as they were learned.
        units = np.vstack([units, -units.sum(axis=0)])
    # One gray plane serves gray cameras and colour ones alike. Filters with free colours mostly learn
    # differences of colours, to which a gray camera is blind.
    weights = (units * step).reshape(FILTERS, 1, options.kernel, options.kernel)
    # Summed as whole numbers: in no order do they leave 1e-16 where the sum is zero.
    bias = -(units.sum(axis=1) * step) * np.rint(scatter.mean().mean())
    # Samples in the middle of stride x stride pixels, as those of the image made smaller by the stride.
    padding = (max(0, options.kernel - options.stride) // 2,) * 4
    layer_norm = stem_module.LayerNorm(np.ones(FILTERS), np.zeros(FILTERS), options.floor**2) if has_norm else None
    return stem_module.Stem(weights, bias, stride=options.stride, mean=np.zeros(1), padding=padding, repeats_border=True, layer_norm=layer_norm), ratios


def put_first(stem, file):
    """The filter 0 of another model, which may hold it several times, moved down."""
    kernel = stem.weights.shape[-1]
    weights = show.read_weights(file)[0][0, :, :kernel, :kernel]
    if weights.shape != stem.weights[0].shape:
        raise ValueError(f"{file}: expected `weights` of {kernel}x{kernel} on one plane, found {weights.shape}")
    stem.weights[0], stem.bias[0] = weights, 0.0


def whole(filters):
    """Weights in whole steps, and the step."""
    step = ROUNDING * np.abs(filters).max()
    return np.rint(filters / step), step


def alone(stem, options):
    """The default filter's model and what it is, sampled as it is meant to be: one pass, one output."""
    own = slice(options.default_filter, options.default_filter + 1)
    if stem.layer_norm is None:
        one = dataclasses.replace(stem, weights=stem.weights[own], bias=stem.bias[own])
        return onnx_writer.build(one), one
    dense = dataclasses.replace(stem, stride=options.sampling)
    return onnx_writer.build(dense, options.default_filter), dense


def in_closed_form(options, file, said):
    scatter = collect([drive.Drive(folder) for folder in options.drives], options)
    stem, ratios = learn(scatter, discriminant.Nuisance(options.gain, options.offset, options.noise), options)
    if options.first is not None:
        put_first(stem, options.first)
    said |= {"network": "stemvo, learned on rendered drives", "default_filter": options.default_filter or 0, "filters": FILTERS}
    metadata.write(file, onnx_writer.build(stem), stem, **said)
    if options.default_filter is not None and options.stride % options.sampling == 0:
        metadata.write(file.with_name(f"{options.name}_filter_{options.default_filter}.onnx"), *alone(stem, options),
                       only_filter=options.default_filter, **said)
    click.echo(f"{file}: {FILTERS} filters from {scatter.count} pairs of patches")
    filters = stem.weights.sum(axis=1).reshape(FILTERS, -1)
    deviation = np.sqrt(np.einsum("ki,ij,kj->k", filters, scatter.signal(), filters))
    for index in range(FILTERS):
        ratio = f"{ratios[index]:8.3f}" if index < len(ratios) else "       -"
        click.echo(f"filter {index:2d}: discriminant ratio {ratio}, standard deviation on gray before the norm {deviation[index]:.3f}")


def by_gradient(options, file, said):
    from . import descent, teaching

    rng = np.random.default_rng(options.seed)
    recordings = [folder / "sequences/00" if (folder / "sequences/00").exists() else folder for folder in options.drives]
    frames = [frame for recording in recordings for frame in warps.frames_of(str(recording), FRAMES)]
    crops = teaching.collect([*frames, *(teaching.dead_leaves((376, 620), rng) for _ in range(NUM_LEAVES))], options.seed)
    click.echo(f"{len(crops.before)} corners")
    costs = []
    for number, (weights, value) in enumerate(descent.learn(crops, options.steps, options.seed), 1):
        costs.append(value)
        if number % 50 == 0 or number == options.steps:
            click.echo(f"step {number}: {np.mean(costs[-50:]):.3f}")
    units, step = whole(weights)
    stem = stem_module.Stem((units * step)[None, None], np.zeros(1), descent.STRIDE, np.zeros(1))
    metadata.write(file, onnx_writer.build(stem), stem, network="stemvo, learned through the aligner", **said)
    click.echo(file)


def _shown(value):
    return f"{value:g}" if isinstance(value, float) else getattr(value, "name", value)


def command_line(options):
    """The command that makes the same file again, without folders, which differ from machine to machine."""
    shown = {one.name: getattr(options, one.name) for one in command.params if one.name not in ("drives", "out")}
    return " ".join(["stemvo-lab learn", *(file.name for file in options.drives), "--out models",
                     *(f"--{key.replace('_', '-')} {_shown(value)}" for key, value in shown.items() if value is not None)])


@click.command()
@click.argument("drives", nargs=-1, required=True, metavar="DRIVE..", type=click.Path(path_type=pathlib.Path))
@click.option("--out", type=click.Path(file_okay=False, path_type=pathlib.Path), required=True, help="Folder, created where missing")
@click.option("--name", default="default", show_default=True, help="Of the model: OUT/NAME.onnx")
@click.option("--objective", type=click.Choice(["matching", "tracking", "landing"]), default="matching", show_default=True,
              help="Tell points apart; the smallest covariance of a tracked translation; or land corners where they are")
@click.option("--default-filter", type=click.IntRange(0, FILTERS - 1), metavar="K", help="Used where none is asked for (default: 0, which gets no file)")
@click.option("--first", metavar="MODEL", type=click.Path(path_type=pathlib.Path), help="Its filter 0 takes the place of the first (made by --objective landing)")
@click.option("--kernel", type=click.IntRange(4), default=8, show_default=True, metavar="PX", help="Side of a filter")
@click.option("--stride", type=click.IntRange(1), default=2, show_default=True, metavar="PX", help="Of the graph")
@click.option("--sampling", type=click.IntRange(1), default=2, show_default=True, metavar="PX", help="Between samples of the channel that it is meant for")
@click.option("--zoom", type=click.FloatRange(0), default=VIEWS.zoom, show_default=True, help="Between two views, deviation of its logarithm")
@click.option("--rotation", type=click.FloatRange(0), default=VIEWS.rotation_deg, show_default=True, help="Between two views, deviation in degrees")
@click.option("--gain", type=click.FloatRange(0), default=NUISANCE.gain, show_default=True, help="Standard deviation")
@click.option("--offset", type=click.FloatRange(0), default=NUISANCE.offset, show_default=True, help="Gray levels")
@click.option("--noise", type=click.FloatRange(0, min_open=True), default=NUISANCE.noise, show_default=True, help="Gray levels")
@click.option("--floor", type=click.FloatRange(0), default=0.0, show_default=True, help="Of a layer norm, in nuisance deviations; 0: none")
@click.option("--pairs", type=click.IntRange(1), default=20000, show_default=True, help="Patches tried per frame")
@click.option("--steps", type=click.IntRange(1), default=200, show_default=True, help="Of the gradient (landing)")
@click.option("--seed", default=1, show_default=True)
def command(**options):
    """Learn a stem from DRIVEs made by `stemvo synth DRIVE --depth`, with --walk or without, and write OUT/NAME.onnx; with --default-filter K
    that filter alone too (OUT/NAME_filter_K.onnx: the same values at less cost). The same drives and options give the same bytes.

    --objective landing: one filter of 8x8 by gradient through the odometry's aligner, from frames of the drives and self-made images,
    warped and disturbed as in `stemvo-lab warps`; symmetric along x, y and the diagonals; only --steps, --seed and --name count."""
    options = types.SimpleNamespace(**options)
    file = options.out / f"{options.name}.onnx"
    options.out.mkdir(parents=True, exist_ok=True)
    (by_gradient if options.objective == "landing" else in_closed_form)(options, file, {"layer": "stem", "licence": "MIT", "command": command_line(options)})
