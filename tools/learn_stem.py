#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Learns the default stem from a rendered drive and writes OUT/NAME.onnx, its default filter alone
(OUT/NAME_filter_K.onnx: the same values at less cost) and their entry in OUT/manifest.yaml. The same drive and options give the same bytes. docs/default_model.md explains it.

DRIVE: made by `stemvo synth DRIVE --depth` (pictures, exact depth and poses).
"""

import _environment  # noqa: F401  starts this tool again in the environment of `make build`

import argparse
import dataclasses
import pathlib
import sys

import numpy as np

from stems import discriminant, drive, manifest, onnx_writer
from stems import stem as stem_module

KERNEL = 4  # as ConvNeXt's stem: 4x4 pixels, every 4 pixels
FILTERS = 16
# The filters are rounded to this share of their largest weight, so that the last bits of another
# machine's linear algebra do not change the file.
ROUNDING = 2.0**-14


def parse_arguments(arguments):
    defaults = discriminant.Nuisance()
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("drive", metavar="DRIVE", type=pathlib.Path)
    parser.add_argument("--out", metavar="DIR", type=pathlib.Path, required=True, help="created where missing")
    parser.add_argument("--name", default="default")
    parser.add_argument("--default-filter", type=int, default=2, help="for the manifest (default: %(default)s)")
    parser.add_argument("--sampling", type=int, default=2, metavar="PX",
                        help="pixels between samples of the channel that it is meant for (default: 2)")
    parser.add_argument("--gain", type=float, default=defaults.gain, help="standard deviation (default: %(default)s)")
    parser.add_argument("--offset", type=float, default=defaults.offset, help="gray levels (default: %(default)s)")
    parser.add_argument("--noise", type=float, default=defaults.noise, help="gray levels (default: %(default)s)")
    parser.add_argument("--floor", type=float, default=3.0,
                        help="of the layer norm, in nuisance standard deviations (default: %(default)s)")
    parser.add_argument("--pairs", type=int, default=20000, help="patches tried per frame (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=1)
    return parser.parse_args(arguments)


def collect(frames, options):
    """Pairs of patches of every frame and the next."""
    rng = np.random.default_rng(options.seed)
    scatter = discriminant.Scatter(KERNEL)
    gray = frames.gray(0)
    for before in range(len(frames) - 1):
        next_gray = frames.gray(before + 1)
        corners = drive.corresponding_corners(frames, before, before + 1, KERNEL, options.sampling, options.pairs, rng)
        scatter.add(drive.patches(gray, corners[0], KERNEL), drive.patches(next_gray, corners[1], KERNEL))
        gray = next_gray
    if scatter.count < 100 * FILTERS:
        raise drive.DriveError(f"{options.drive}: expected at least {100 * FILTERS} patches seen in two frames, "
                               f"found {scatter.count}")
    return scatter


def learn(scatter, nuisance, floor):
    """The stem, and the discriminant ratio of each of its filters."""
    signal = scatter.signal()
    filters, ratios = discriminant.generalised_eigenvectors(signal, scatter.noise(nuisance), FILTERS - 1)
    filters = discriminant.with_signs(filters, signal)
    step = ROUNDING * np.abs(filters).max()
    filters = np.rint(filters / step)
    # The layer norm subtracts the mean over the channels. A last filter that makes all of them sum to
    # zero leaves the others as they were learned.
    filters = np.vstack([filters, -filters.sum(axis=0)]) * step
    # One gray plane serves gray cameras and colour ones alike. Filters with free colours mostly learn
    # differences of colours, to which a gray camera is blind.
    weights = filters.reshape(FILTERS, 1, KERNEL, KERNEL)
    bias = -filters.sum(axis=1) * np.rint(scatter.mean().mean())
    layer_norm = stem_module.LayerNorm(np.ones(FILTERS), np.zeros(FILTERS), floor**2)
    return stem_module.Stem(weights, bias, stride=KERNEL, mean=np.zeros(1), layer_norm=layer_norm), ratios


def write_folded(stem, options):
    """The default filter alone, sampled as it is meant to be: one pass, one output."""
    file = options.out / f"{options.name}_filter_{options.default_filter}.onnx"
    onnx_writer.write(dataclasses.replace(stem, stride=options.sampling), file, pick=options.default_filter)
    return manifest.folded(file, options.default_filter, options.sampling)


def command_line(options):
    return (f"tools/learn_stem.py DRIVE --out models --name {options.name} --default-filter {options.default_filter} "
            f"--sampling {options.sampling} --gain {options.gain:g} --offset {options.offset:g} "
            f"--noise {options.noise:g} --floor {options.floor:g} --pairs {options.pairs} --seed {options.seed}")


def run(options):
    if not 0 <= options.default_filter < FILTERS:
        raise drive.DriveError(f"--default-filter: expected 0 to {FILTERS - 1}, found {options.default_filter}")
    if not (options.sampling >= 1 and options.pairs >= 1 and options.floor > 0 and options.noise > 0
            and options.gain >= 0 and options.offset >= 0):
        raise drive.DriveError("expected --sampling and --pairs >= 1, --floor and --noise > 0, --gain and --offset >= 0")
    scatter = collect(drive.Drive(options.drive), options)
    nuisance = discriminant.Nuisance(options.gain, options.offset, options.noise)
    stem, ratios = learn(scatter, nuisance, options.floor)
    options.out.mkdir(parents=True, exist_ok=True)
    onnx_file = options.out / f"{options.name}.onnx"
    onnx_writer.write(stem, onnx_file)
    entry = manifest.entry(options.name, onnx_file, stem, network="stemvo, learned on a rendered drive",
                           layer="stem", licence="MIT", default_filter=options.default_filter,
                           command=command_line(options))
    if KERNEL % options.sampling == 0:
        entry["folded"] = write_folded(stem, options)
    manifest.add(options.out / "manifest.yaml", entry)
    return scatter, stem, ratios, entry


def report(scatter, stem, ratios, entry):
    print(f"{entry['file']}: {entry['filters']} filters from {scatter.count} pairs of patches, sha256 {entry['sha256']}")
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
    except (drive.DriveError, manifest.ManifestError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    except OSError as error:
        print(f"error: {error.filename}: expected to write here, found: {error.strerror}", file=sys.stderr)
        return 1
    report(*result)
    return 0


if __name__ == "__main__":
    sys.exit(main())
