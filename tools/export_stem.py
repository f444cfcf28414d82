#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Turns the weights of a pretrained network into OUT/NAME.onnx, of several layers into OUT/NAME_LAYER.onnx each.

WEIGHTS is one of
  .h5 .keras             Keras: ConvNeXt, EfficientNetV2, NASNet, ResNet; the stem
  .safetensors           PyTorch (timm, torchvision, the authors'): the same; the stem
  .onnx                  any whole network, cut at the tensors named by --layers
  .npz                   arrays of a stem (tools/stems/weights.py lists the keys)

The graph takes RGB 0..255; preprocessing and batch norm are inside it. The file says its kernel, stride and padding in its
metadata, which stemvo needs.

Padding: the default is none, as stemvo samples a stem more densely by running it on shifted copies
of the frame, and padding would put borders between them. "same" is what the network was trained
with (TensorFlow's depends on the picture's size, --size; without it: even), for comparing values
with the network. Four numbers are the pixels at the top, left, bottom and right.
docs/search.md has examples.
"""

import _environment  # noqa: F401  starts this tool again in build/venv

import argparse
import pathlib
import re
import shlex
import sys

from stems import exports, families, layer_list, metadata, weights


def parse_padding(text):
    if text in ("none", "same"):
        return text
    if not re.fullmatch(r"\d{1,3}(,\d{1,3}){3}", text):
        raise argparse.ArgumentTypeError(f"expected none, same or T,L,B,R in pixels, found {text!r}")
    return tuple(int(pixels) for pixels in text.split(","))


def parse_size(text):
    match = re.fullmatch(r"([1-9]\d{0,4})x([1-9]\d{0,4})", text)
    if not match:
        raise argparse.ArgumentTypeError(f"expected WIDTHxHEIGHT in pixels, found {text!r}")
    return int(match[1]), int(match[2])


def parse_layers(text):
    names = text.split(",")
    if not all(names) or len(set(names)) != len(names):
        raise argparse.ArgumentTypeError(f"expected different names joined by commas, found {text!r}")
    return names


def parse_arguments(arguments):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("weights", metavar="WEIGHTS", type=pathlib.Path)
    parser.add_argument("--out", metavar="DIR", type=pathlib.Path, help="created where missing")
    parser.add_argument("--list", action="store_true", help="print the layers, write nothing")
    parser.add_argument("--layers", type=parse_layers, metavar="A,B,..", help="to export, by name (default: the stem behind its norm)")
    parser.add_argument("--filter", type=int, metavar="K", help="export this filter only")
    parser.add_argument("--fold", action="store_true", help="with --filter: a layer norm without all the other filters")
    parser.add_argument("--size", type=parse_size, metavar="WxH", help="of the pictures that \"same\" padding is for")
    parser.add_argument("--preprocessing", choices=sorted(families.PREPROCESSING), help="what the network is fed (.onnx: needed)")
    parser.add_argument("--name", help="of the model (default: of the file)")
    parser.add_argument("--padding", type=parse_padding, default="none", help="none | same | T,L,B,R (default: none)")
    parser.add_argument("--network", help="for the metadata (default: as found, else the name); a known one is held "
                        "against the file (of .npz and .onnx: against the first convolution)")
    parser.add_argument("--layer", default="stem", help="of an .npz, for the metadata (default: stem)")
    parser.add_argument("--licence", default="unknown", help="of the weights, for the metadata (default: unknown)")
    parser.add_argument("--default-filter", type=int, default=0)
    options = parser.parse_args(arguments)
    if not options.list and options.out is None:
        parser.error("the following arguments are required: --out (or --list)")
    return options


def export(options):
    """Writes the files; returns what each says of itself, and what is to be said of them."""
    name = options.name or options.weights.stem + ("" if options.filter is None else f"_filter{options.filter}")
    if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._-]*", name):
        raise metadata.MetadataError(f"--name: expected letters, digits, `.`, `_` and `-`, found {name!r}")
    made = exports.make(options)
    for layer, (_, shape) in made.layers.items():
        if not 0 <= options.default_filter < shape.filters:
            raise weights.WeightsError(f"{options.weights}: {layer}: --default-filter: expected 0 to {shape.filters - 1}, "
                                       f"found {options.default_filter}")
    options.out.mkdir(parents=True, exist_ok=True)
    written = {}
    for layer, (model, shape) in made.layers.items():
        file = options.out / f"{file_name(name, layer, made.layers)}.onnx"
        written[file] = metadata.write(file, model, shape, network=options.network or made.network or name, layer=layer,
                                       licence=options.licence, default_filter=options.default_filter,
                                       command=command_line(options, name), sampling=getattr(shape, "sampling", "any"))
    return written, made.notes


def file_name(name, layer, layers):
    """Of one of a model's layers, without what a file's name cannot hold."""
    if len(layers) == 1:
        return name
    plain = [re.sub(r"[^A-Za-z0-9._-]+", "_", other).strip("_") for other in layers]
    own = plain[list(layers).index(layer)]
    return f"{name}_{own}" if plain.count(own) == 1 else f"{name}_{own}_{list(layers).index(layer)}"


def command_line(options, name):
    """That makes the same file again: without folders, which differ from machine to machine."""
    padding = options.padding if isinstance(options.padding, str) else ",".join(map(str, options.padding))
    words = ["tools/export_stem.py", options.weights.name, "--out", ".", "--name", name, "--padding", padding]
    for option, value in (("--layers", ",".join(options.layers or [])), ("--filter", options.filter),
                          ("--size", options.size and "x".join(map(str, options.size))),
                          ("--preprocessing", options.preprocessing)):
        if value not in (None, "", False):
            words += [option, str(value)]
    return shlex.join(words + ["--fold"] * options.fold)


def list_layers(options):
    suffix = options.weights.suffix
    if suffix == ".onnx":
        return layer_list.of_graph(options.weights, options.size)
    return layer_list.of_arrays(options.weights) if suffix == ".npz" else layer_list.of_weights(options.weights)


def main(arguments=None):
    options = parse_arguments(arguments)
    try:
        if options.list:
            print(layer_list.text(list_layers(options)))
            return 0
        written, notes = export(options)
    except (weights.WeightsError, metadata.MetadataError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    except OSError as error:
        print(f"error: {error.filename}: expected to write here, found: {error.strerror}", file=sys.stderr)
        return 1
    for file, said in written.items():
        print(f"{file}: {said['network']}, {said['layer']}: {said['filters']} filters, kernel {said['kernel']}, "
              f"stride {said['stride']}, padding {said['padding']}")
    for note in notes:
        print(f"  {note}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
