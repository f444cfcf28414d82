#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Measures what docs/search.md plans with: filter-frames per core-second of `stemvo search` on layers of several
strides, and multiplications per core-second of ONNX Runtime, both on one thread by processor time.

The layers are random filters as wide as their stride (3 at stride 2), smoothed so that they see the picture's structure
rather than noise. How many motions are measured is printed too: a filter that fails early is cheap.
"""

import _environment  # noqa: F401  starts this tool again in build/venv

import argparse
import json
import pathlib
import re
import resource
import subprocess
import sys
import tempfile
import time

import numpy as np
import onnx
import onnxruntime

from stems import manifest, onnx_writer, stem

ROOT = pathlib.Path(__file__).resolve().parent.parent
STRIDES = (2, 4, 8, 16)


def random_stem(stride, filters):
    """A derivative in a random direction and a mean, with some noise."""
    rng = np.random.default_rng(stride)
    size = max(stride, 3)
    y, x = np.mgrid[:size, :size] - (size - 1) / 2
    across, along, level, noise = (rng.normal(size=(filters, 1, 1, 1)) for _ in range(4))
    weights = (across * x + along * y) / size + level / 10 + noise * rng.normal(size=(filters, 1, size, size)) / 10
    return stem.Stem(np.repeat(weights, 3, axis=1) / size**2, np.zeros(filters), stride)


def write_model(folder, stride, filters, sampling=None):
    """An .onnx and its manifest. Layers from stride 4 on are native as deeper ones of a network are, unless `sampling` says `any`, as for a stem."""
    file = folder / f"stride{stride}.onnx"
    layer = random_stem(stride, filters)
    file.write_bytes(onnx_writer.to_bytes(onnx_writer.build_layers({"layer": layer})))
    manifest.add(folder / "manifest.yaml", manifest.entry(file.stem, file, layer, network="random", layer="layer", licence="MIT",
                                                           command="search_rates.py",
                                                           sampling=sampling or ("native" if stride >= 4 else "any")))
    return file


def search_rate(options, folder, stride):
    """Filter-frames per second of processor time, MiB at most of all searches so far, mean share of tracked frames."""
    model, out = write_model(folder, stride, options.filters, options.sampling), folder / f"out{stride}"
    command = [options.program, "search", options.sequence, "--frames", f"0:{options.frames}", "--model", model, "--exhaustive", "--no-baselines",
               "--block", options.block, "--threads", "1", "--quiet", "--out", out]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([str(word) for word in command], check=True, stdout=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    result = json.loads((out / "filters.json").read_text(encoding="utf-8"))
    tracked = [row["sequences"][0]["tracked"] for row in result["filters"]]
    seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return options.filters * options.frames / seconds, after.ru_maxrss / 1024, sum(tracked) / len(tracked)


def multiplication_rate(channels=256, height=47, width=155, repeats=10):
    """Of a 3x3 convolution, per second of processor time."""
    weights = onnx.numpy_helper.from_array(np.ones((channels, channels, 3, 3), np.float32), "w")
    shape = [1, channels, height, width]
    graph = onnx.helper.make_graph([onnx.helper.make_node("Conv", ["x", "w"], ["y"], pads=[1, 1, 1, 1])], "conv",
                                   [onnx.helper.make_tensor_value_info("x", onnx.TensorProto.FLOAT, shape)],
                                   [onnx.helper.make_tensor_value_info("y", onnx.TensorProto.FLOAT, shape)], [weights])
    model = onnx.helper.make_model(graph, opset_imports=[onnx.helper.make_opsetid("", 17)], ir_version=8)
    choice = onnxruntime.SessionOptions()
    choice.intra_op_num_threads = choice.inter_op_num_threads = 1
    session = onnxruntime.InferenceSession(model.SerializeToString(), choice, providers=["CPUExecutionProvider"])
    picture = np.random.default_rng(1).normal(size=shape).astype(np.float32)
    session.run(None, {"x": picture})
    start = time.process_time()
    for _ in range(repeats):
        session.run(None, {"x": picture})
    return repeats * channels * channels * 9 * height * width / (time.process_time() - start)


def positive(text):
    if not re.fullmatch(r"[1-9]\d{0,5}", text):
        raise argparse.ArgumentTypeError(f"expected a whole number >= 1, found {text!r}")
    return int(text)


def main(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sequence", metavar="SEQUENCE_DIR", type=pathlib.Path)
    parser.add_argument("--filters", type=positive, default=16, help="of each layer (default: %(default)s)")
    parser.add_argument("--frames", type=positive, default=60, help="(default: %(default)s)")
    parser.add_argument("--block", type=positive, default=16, help="filters in flight, as of stemvo search (default: %(default)s)")
    parser.add_argument("--sampling", choices=("any", "native"), help="any: passes over shifted frames, as over a stem (default: native from stride 4 on)")
    parser.add_argument("--strides", type=positive, nargs="+", default=STRIDES, help="(default: 2 4 8 16)")
    parser.add_argument("--program", type=pathlib.Path, default=ROOT / "build/release/stemvo", help="(default: %(default)s)")
    options = parser.parse_args(arguments)
    print("stride  filter-frames per core-second  motions measured  memory so far MiB")
    try:
        with tempfile.TemporaryDirectory() as folder:
            for stride in options.strides:
                rate, memory, tracked = search_rate(options, pathlib.Path(folder), stride)
                print(f"{stride:6} {rate:30.0f} {100 * tracked:15.0f} % {memory:17.0f}", flush=True)
    except (OSError, subprocess.CalledProcessError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    print(f"convolution: {multiplication_rate() / 1e9:.0f} billion multiplications per core-second")
    return 0


if __name__ == "__main__":
    sys.exit(main())
