#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Times one filter of a ConvNeXt-XLarge stem (random weights), folded, against the stem of all 256 filters.

Both through ONNX Runtime, one thread, in one run: pair after pair, the order within a pair taking turns, so
that a machine whose clock varies slows both alike. Times are the processor's: waiting for other programs does not
count, which would lengthen the longer run more. The frame has the size of one of KITTI.
"""

import _environment  # noqa: F401  starts this tool again in build/venv

import argparse
import pathlib
import statistics
import sys
import time

import numpy as np

from stems import families, fold, fold_report, frames, onnx_writer, stem, weights


def random_stem(filters, seed):
    """The shape of a ConvNeXt stem, its layer norm trained to other than ones and zeros."""
    rng = np.random.default_rng(seed)
    fed = families.PREPROCESSING["imagenet"]
    norm = stem.LayerNorm(rng.uniform(0.5, 1.5, filters), rng.normal(size=filters), 1e-6)
    return stem.Stem(stem.fold_scale(rng.normal(size=(filters, 3, 4, 4)) / 7, fed.std), rng.normal(size=filters) / 10, 4,
                     np.array(fed.mean), layer_norm=norm)


def seconds(session, image):
    """Of the processor: a session with one thread runs in this one."""
    start = time.thread_time()
    session.run(None, {onnx_writer.INPUT: image})
    return time.thread_time() - start


def paired_medians(first, second, image, pairs):
    """Median seconds of each, and the median over pairs of second / first."""
    times = []
    for index in range(-2, pairs):  # the first two warm up
        pair = (seconds(first, image), seconds(second, image)) if index % 2 else (seconds(second, image), seconds(first, image))[::-1]
        if index >= 0:
            times.append(pair)
    return (statistics.median(a for a, _ in times), statistics.median(b for _, b in times),
            statistics.median(b / a for a, b in times))


def parse_arguments(arguments):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--frames", metavar="DIR", type=pathlib.Path, help="PNG files to compare values on, and to fit truncated rows to")
    parser.add_argument("--filters", type=int, default=256, help="of the full stem (default: %(default)s)")
    parser.add_argument("--filter", type=int, default=10, help="the one folded (default: %(default)s)")
    parser.add_argument("--rows", type=int, nargs="*", default=[24, 10], help="truncated too, with --frames (default: 24 10)")
    parser.add_argument("--pairs", type=int, default=25)
    return parser.parse_args(arguments)


def bench(options):
    full_stem = random_stem(options.filters, seed=1)
    pictures = [] if options.frames is None else [frames.read(file) for file in frames.find(options.frames, 20)]
    image = pictures[0][None] if pictures else np.random.default_rng(2).uniform(0, 255, (1, 3, 376, 1241)).astype(np.float32)
    print(f"{options.filters} filters 4x4 / 4 with layer norm, {image.shape[3]}x{image.shape[2]}, one thread, processor time, medians of {options.pairs} pairs")
    full = onnx_writer.build(full_stem)
    moment = fold.second_moment(full_stem.kernel, full_stem.stride, pictures[0::2]) if pictures else None
    for rows in [None, *(options.rows if pictures else [])]:
        folded = fold.layer_norm_filter(full_stem, options.filter, rows, moment)
        model = onnx_writer.build(folded)
        whole, one, ratio = paired_medians(fold_report.session(full), fold_report.session(model), image, options.pairs)
        print(f"{'exact' if rows is None else 'truncated'}, {len(folded.weights)} rows: {1e3 * one:.2f} ms of {1e3 * whole:.2f} ms, "
              f"{ratio:.3f} of the full stem's time")
        if pictures:
            print(f"  {fold_report.difference(full, model, options.filter, pictures[1::2])}")


def main(arguments=None):
    try:
        bench(parse_arguments(arguments))
    except weights.WeightsError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
