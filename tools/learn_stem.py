#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Learns a stem from rendered drives and writes OUT/NAME.onnx, with --default-filter K that filter alone too
(OUT/NAME_filter_K.onnx: the same values at less cost). The same drives and options give the same bytes.
docs/lab/default_model.md explains it.

DRIVE: made by `stemvo synth DRIVE --depth`, with --walk or without (pictures, exact depth and poses).
"""

import _environment  # noqa: F401  starts this tool again in build/venv

import argparse
import dataclasses
import pathlib
import sys

import numpy as np

from stems import discriminant, drive, metadata, onnx_writer
from stems import stem as stem_module

FILTERS = 16
# The filters are rounded to this share of their largest weight, so that the last bits of another
# machine's linear algebra do not change the file.
ROUNDING = 2.0**-14


def parse_arguments(arguments):
    defaults, views = discriminant.Nuisance(), drive.Views()
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("drives", metavar="DRIVE", type=pathlib.Path, nargs="+")
    parser.add_argument("--out", metavar="DIR", type=pathlib.Path, required=True, help="created where missing")
    parser.add_argument("--name", default="default")
    parser.add_argument("--default-filter", type=int, metavar="K", help="used where none is asked for (default: 0, which gets no file of its own)")
    parser.add_argument("--objective", choices=("matching", "tracking"), default="matching",
                        help="tell points apart, or the smallest covariance of a tracked translation (default: %(default)s)")
    parser.add_argument("--sampling", type=int, default=2, metavar="PX",
                        help="pixels between samples of the channel that it is meant for (default: 2)")
    parser.add_argument("--kernel", type=int, default=8, metavar="PX", help="side of a filter (default: %(default)s)")
    parser.add_argument("--stride", type=int, default=2, metavar="PX", help="of the graph (default: %(default)s)")
    parser.add_argument("--zoom", type=float, default=views.zoom, help="between two views, standard deviation of its logarithm (default: %(default)s)")
    parser.add_argument("--rotation", type=float, default=views.rotation_deg,
                        help="between two views, about the optical axis, standard deviation in degrees (default: %(default)s)")
    parser.add_argument("--gain", type=float, default=defaults.gain, help="standard deviation (default: %(default)s)")
    parser.add_argument("--offset", type=float, default=defaults.offset, help="gray levels (default: %(default)s)")
    parser.add_argument("--noise", type=float, default=defaults.noise, help="gray levels (default: %(default)s)")
    parser.add_argument("--floor", type=float, default=0.0,
                        help="of a layer norm, in nuisance standard deviations; 0: none (default: %(default)s)")
    parser.add_argument("--pairs", type=int, default=20000, help="patches tried per frame (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=1)
    return parser.parse_args(arguments)


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
        raise drive.DriveError(f"{options.drives[-1]}: expected at least {100 * FILTERS} patches seen in two frames, "
                               f"found {scatter.count}")
    return scatter


def learn(scatter, nuisance, options):
    """The stem, and the discriminant ratio of each of its filters."""
    signal = scatter.signal()
    has_norm = options.floor > 0
    noise, count = scatter.noise(nuisance), FILTERS - has_norm
    filters, ratios = (discriminant.tracking_filters(scatter.slopes(), noise, count) if options.objective == "tracking"
                       else discriminant.generalised_eigenvectors(signal, noise, count))
    filters = discriminant.with_signs(filters, signal)
    step = ROUNDING * np.abs(filters).max()
    units = np.rint(filters / step)
    if has_norm:
        # It subtracts the mean over the channels. A last filter that makes all of them sum to zero
        # leaves the others as they were learned.
        units = np.vstack([units, -units.sum(axis=0)])
    filters = units * step
    # One gray plane serves gray cameras and colour ones alike. Filters with free colours mostly learn
    # differences of colours, to which a gray camera is blind.
    weights = filters.reshape(FILTERS, 1, options.kernel, options.kernel)
    # Summed as whole numbers: in no order do they leave 1e-16 where the sum is zero.
    bias = -(units.sum(axis=1) * step) * np.rint(scatter.mean().mean())
    # Samples in the middle of stride x stride pixels, as those of the image made smaller by the stride.
    padding = (max(0, options.kernel - options.stride) // 2,) * 4
    layer_norm = stem_module.LayerNorm(np.ones(FILTERS), np.zeros(FILTERS), options.floor**2) if has_norm else None
    return stem_module.Stem(weights, bias, stride=options.stride, mean=np.zeros(1), padding=padding, layer_norm=layer_norm), ratios


def alone(stem, options):
    """The default filter's model and what it is, sampled as it is meant to be: one pass, one output."""
    own = slice(options.default_filter, options.default_filter + 1)
    if stem.layer_norm is None:
        one = dataclasses.replace(stem, weights=stem.weights[own], bias=stem.bias[own])
        return onnx_writer.build(one), one
    dense = dataclasses.replace(stem, stride=options.sampling)
    return onnx_writer.build(dense, options.default_filter), dense


def command_line(options):
    return (f"tools/learn_stem.py {' '.join(file.name for file in options.drives)} --out models --name {options.name} "
            f"{'' if options.objective == 'matching' else f'--objective {options.objective} '}"
            f"{'' if options.default_filter is None else f'--default-filter {options.default_filter} '}--kernel {options.kernel} --stride {options.stride} "
            f"--sampling {options.sampling} --zoom {options.zoom:g} --rotation {options.rotation:g} --gain {options.gain:g} "
            f"--offset {options.offset:g} --noise {options.noise:g} --floor {options.floor:g} --pairs {options.pairs} "
            f"--seed {options.seed}")


def run(options):
    if not 0 <= (options.default_filter or 0) < FILTERS:
        raise drive.DriveError(f"--default-filter: expected 0 to {FILTERS - 1}, found {options.default_filter}")
    if not (min(options.sampling, options.pairs, options.stride) >= 1 and options.kernel >= 4 and options.noise > 0
            and min(options.floor, options.gain, options.offset, options.zoom, options.rotation) >= 0):
        raise drive.DriveError("expected --sampling, --stride and --pairs >= 1, --kernel >= 4, --noise > 0, "
                               "--floor, --gain, --offset, --zoom and --rotation >= 0")
    scatter = collect([drive.Drive(folder) for folder in options.drives], options)
    nuisance = discriminant.Nuisance(options.gain, options.offset, options.noise)
    stem, ratios = learn(scatter, nuisance, options)
    options.out.mkdir(parents=True, exist_ok=True)
    said = {"network": "stemvo, learned on rendered drives", "layer": "stem", "licence": "MIT",
            "default_filter": options.default_filter or 0, "command": command_line(options), "filters": FILTERS}
    file = options.out / f"{options.name}.onnx"
    metadata.write(file, onnx_writer.build(stem), stem, **said)
    if options.default_filter is not None and options.stride % options.sampling == 0:
        metadata.write(options.out / f"{options.name}_filter_{options.default_filter}.onnx", *alone(stem, options),
                       only_filter=options.default_filter, **said)
    return scatter, stem, ratios, file


def report(scatter, stem, ratios, file):
    print(f"{file}: {FILTERS} filters from {scatter.count} pairs of patches")
    filters = stem.weights.sum(axis=1).reshape(FILTERS, -1)
    deviation = np.sqrt(np.einsum("ki,ij,kj->k", filters, scatter.signal(), filters))
    for index in range(FILTERS):
        ratio = f"{ratios[index]:8.3f}" if index < len(ratios) else "       -"
        print(f"filter {index:2d}: discriminant ratio {ratio}, standard deviation on gray before the norm "
              f"{deviation[index]:.3f}")


def main(arguments=None):
    options = parse_arguments(arguments)
    try:
        result = run(options)
    except drive.DriveError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    except OSError as error:
        print(f"error: {error.filename}: expected to write here, found: {error.strerror}", file=sys.stderr)
        return 1
    report(*result)
    return 0


if __name__ == "__main__":
    sys.exit(main())
