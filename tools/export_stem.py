#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Turns the weights of a pretrained stem (.npz) into OUT/NAME.onnx with all its filters, and adds
it to OUT/manifest.yaml.

The graph takes RGB 0..255; the network's preprocessing and its batch norm are folded into it.

Padding: the default is none, as stemvo samples a stem more densely by running it on shifted copies
of the frame, and padding would put borders between them. "same" is what the network was trained
with (TensorFlow's on even sizes: bottom and right only), for comparing values with the network.
Four numbers are the pixels at the top, left, bottom and right.
"""

import _environment  # noqa: F401  starts this tool again in the environment of `make build`

import argparse
import pathlib
import re
import shlex
import sys

from stems import manifest, onnx_writer, weights


def parse_padding(text):
    if text in ("none", "same"):
        return text
    if not re.fullmatch(r"\d{1,3}(,\d{1,3}){3}", text):
        raise argparse.ArgumentTypeError(f"expected none, same or T,L,B,R in pixels, found {text!r}")
    return tuple(int(pixels) for pixels in text.split(","))


def parse_arguments(arguments):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("weights", metavar="WEIGHTS.npz", type=pathlib.Path)
    parser.add_argument("--out", metavar="DIR", type=pathlib.Path, required=True, help="created where missing")
    parser.add_argument("--name", help="of the model (default: of the file)")
    parser.add_argument("--padding", type=parse_padding, default="none", help="none | same | T,L,B,R (default: none)")
    parser.add_argument("--network", help="for the manifest (default: the name)")
    parser.add_argument("--layer", default="stem", help="for the manifest (default: stem)")
    parser.add_argument("--licence", default="unknown", help="of the weights, for the manifest (default: unknown)")
    parser.add_argument("--default-filter", type=int, default=0)
    return parser.parse_args(arguments)


def export(options):
    """Writes the files; returns the manifest's entry."""
    name = options.name or options.weights.stem
    if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._-]*", name):
        raise manifest.ManifestError(f"--name: expected letters, digits, `.`, `_` and `-`, found {name!r}")
    stem = weights.load(options.weights, options.padding)
    for before, after, size in zip(stem.padding[:2], stem.padding[2:], stem.kernel):
        if max(before, after) >= size:
            raise weights.WeightsError(f"--padding: expected less than the kernel's {size} pixels, "
                                       f"found {max(before, after)}")
    if not 0 <= options.default_filter < stem.filters:
        raise weights.WeightsError(f"{options.weights}: --default-filter: expected 0 to {stem.filters - 1}, "
                                   f"found {options.default_filter}")
    manifest_file = options.out / "manifest.yaml"
    manifest.load(manifest_file)  # a broken one is found before anything is written
    options.out.mkdir(parents=True, exist_ok=True)
    onnx_file = options.out / f"{name}.onnx"
    onnx_writer.write(stem, onnx_file)
    entry = manifest.entry(name, onnx_file, stem, network=options.network or name, layer=options.layer,
                           licence=options.licence, default_filter=options.default_filter,
                           command=command_line(options, name))
    manifest.add(manifest_file, entry)
    return entry


def command_line(options, name):
    """That makes the same file again: without folders, which differ from machine to machine."""
    padding = options.padding if isinstance(options.padding, str) else ",".join(map(str, options.padding))
    words = ["tools/export_stem.py", options.weights.name, "--out", ".", "--name", name, "--padding", padding]
    return shlex.join(words)


def main(arguments=None):
    options = parse_arguments(arguments)
    try:
        entry = export(options)
    except (weights.WeightsError, manifest.ManifestError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    except OSError as error:
        print(f"error: {error.filename}: expected to write here, found: {error.strerror}", file=sys.stderr)
        return 1
    print(f"{options.out / entry['file']}: {entry['filters']} filters, kernel {entry['kernel']}, "
          f"stride {entry['stride']}, padding {entry['padding']}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
