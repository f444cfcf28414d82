# SPDX-License-Identifier: MIT
"""stemvo-lab export: the weights of a pretrained network as models that stemvo loads (docs/search.md)."""

import dataclasses
import pathlib
import re
import shlex
import types

import click

from . import families, fold, graph_cut, graph_kinds, layer_list, metadata, onnx_writer, pretrained, weights
from .weights import WeightsError


@dataclasses.dataclass
class Export:
    """layers: name -> its model, and what its metadata says (filters, kernel, stride, padding, sampling)."""

    layers: dict
    network: str | None = None
    notes: tuple = ()


def _check_filter(path, layer, filters, index, option="--filter"):
    if not 0 <= index < filters:
        raise WeightsError(f"{path}: {layer}: {option}: expected 0 to {filters - 1}, found {index}")


def _stems_of(options):
    """Name -> stem of the layers asked for, the network's name, notes."""
    if options.weights.suffix == ".npz":
        stems, default, network, notes = {options.layer: weights.load(options.weights, options.padding, options.network)}, options.layer, None, ()
    else:
        size = options.size or (2, 2)
        stems, network, trained_padding = pretrained.load(options.weights, options.padding, size, options.network, options.preprocessing)
        default, notes = list(stems)[-1], ()
        if options.padding == "same" and len(set(trained_padding)) > 1:
            kinds = ["even" if side % 2 == 0 else "odd" for side in size]
            notes = (f"padding {list(trained_padding)} as TensorFlow pads pictures of {kinds[0]} width and {kinds[1]} height",)
    for name in options.layers or ():
        if name not in stems:
            raise WeightsError(f"{options.weights}: --layers: expected {', '.join(stems)} (deeper layers need the whole network as .onnx), found {name!r}")
    stems = {name: stems[name] for name in options.layers or [default]}
    for name, stem in stems.items():
        for before, after, side in zip(stem.padding[:2], stem.padding[2:], stem.kernel):
            if max(before, after) >= side:
                raise WeightsError(f"--padding: expected less than the kernel's {side} pixels, found {max(before, after)}")
        if options.filter is not None:
            _check_filter(options.weights, name, stem.filters, options.filter)
    return stems, network, notes


def _folded(options, stem):
    """One filter of a stem without the others."""
    if stem.layer_norm is None:
        return fold.one_filter(stem, options.filter)
    if any(stem.padding):
        raise WeightsError(f"{options.weights}: --fold: expected --padding none for a stem with a layer norm, found {list(stem.padding)}")
    return fold.layer_norm_filter(stem, options.filter)


def _of_stems(options):
    stems, network, notes = _stems_of(options)
    if options.fold:
        if options.filter is None or len(stems) > 1:
            raise WeightsError(f"--fold: expected --filter K and one layer, found {'no --filter' if options.filter is None else f'{len(stems)} layers'}")
        (name, stem), = stems.items()
        folded = _folded(options, stem)
        return Export({name: (onnx_writer.build(folded), folded)}, network,
                      (*notes, f"filter {options.filter}: {len(folded.weights)} rows instead of {stem.filters}"))
    return Export({name: (onnx_writer.build(stem, options.filter),
                          stem if options.filter is None else fold.one_filter(dataclasses.replace(stem, layer_norm=None), options.filter))
                   for name, stem in stems.items()}, network, notes)


def _check_network(options, model):
    """Error: another first convolution than that of the known network it should be."""
    if families.find(options.network) is None:
        return
    first = graph_kinds.first_convolution(model)
    if first is None:
        raise WeightsError(f"{options.weights}: --network: expected the first convolution of {options.network}, found none whose "
                           f"weights are in the file (leave --network out, or give another name)")
    if wrong := families.mismatch(options.network, *first):
        raise WeightsError(f"{options.weights}: --network: {wrong}")


def _of_graph(options):
    whole = graph_cut.read(options.weights)  # a broken file is said before what is missing beside it
    if not options.layers:
        raise WeightsError(f"{options.weights}: expected --layers (--list shows them), found none")
    if options.preprocessing is None:
        raise WeightsError(f"{options.weights}: expected --preprocessing, what the network is fed ({', '.join(families.PREPROCESSING)}), found none")
    if options.padding != "none" or options.fold:
        raise WeightsError(f"{options.weights}: expected no --padding and no --fold for a whole network, found one")
    with graph_cut.refusing_unsound(options.weights):
        _check_network(options, whole)
        made = [graph_cut.cut(options.weights, name, families.PREPROCESSING[options.preprocessing], options.size, options.filter) for name in options.layers]
    return Export({layer.name: (model, layer) for model, layer in made}, None, tuple(
        f"{layer.name}: {'sees the whole frame' if layer.field.whole_frame else 'padded inside'}: sampled at its stride {layer.stride} only"
        for _, layer in made if layer.sampling == "native"))


def export(options):
    """Writes the files; returns what each says of itself, and what is to be said of them. Error: WeightsError, of one line."""
    name = options.name or options.weights.stem + ("" if options.filter is None else f"_filter{options.filter}")
    if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._-]*", name):
        raise WeightsError(f"--name: expected letters, digits, `.`, `_` and `-`, found {name!r}")
    made = _of_graph(options) if options.weights.suffix == ".onnx" else _of_stems(options)
    for layer, (_, shape) in made.layers.items():
        _check_filter(options.weights, layer, shape.filters, options.default_filter, "--default-filter")
    options.out.mkdir(parents=True, exist_ok=True)
    written = {}
    for layer, (model, shape) in made.layers.items():
        file = options.out / f"{file_name(name, layer, made.layers)}.onnx"
        written[file] = metadata.write(file, model, shape, network=options.network or made.network or name, layer=layer,
                                       licence=options.licence, default_filter=options.default_filter,
                                       command=command_line(options, name), sampling=getattr(shape, "sampling", "any"))
    return written, made.notes


def file_name(name, layer, layers):
    """One of a model's layers, without the letters that a file's name cannot hold."""
    if len(layers) == 1:
        return name
    plain = [re.sub(r"[^A-Za-z0-9._-]+", "_", other).strip("_") for other in layers]
    own = plain[list(layers).index(layer)]
    return f"{name}_{own}" if plain.count(own) == 1 else f"{name}_{own}_{list(layers).index(layer)}"


def command_line(options, name):
    """The command that makes the same file again, without folders, which differ from machine to machine."""
    padding = options.padding if isinstance(options.padding, str) else ",".join(map(str, options.padding))
    words = ["stemvo-lab", "export", options.weights.name, "--out", ".", "--name", name, "--padding", padding]
    for option, value in (("--layers", ",".join(options.layers or [])), ("--filter", options.filter),
                          ("--size", options.size and "x".join(map(str, options.size))), ("--preprocessing", options.preprocessing)):
        if value not in (None, ""):
            words += [option, str(value)]
    return shlex.join(words + ["--fold"] * options.fold)


def _padding(context, parameter, text):
    if text not in ("none", "same") and not re.fullmatch(r"\d{1,3}(,\d{1,3}){3}", text):
        raise click.BadParameter(f"expected none, same or T,L,B,R in pixels, found {text!r}")
    return text if text in ("none", "same") else tuple(map(int, text.split(",")))


def _size(context, parameter, text):
    if text and not re.fullmatch(r"[1-9]\d{0,4}x[1-9]\d{0,4}", text):
        raise click.BadParameter(f"expected WIDTHxHEIGHT in pixels, found {text!r}")
    return tuple(map(int, text.split("x"))) if text else None


def _layers(context, parameter, text):
    names = text.split(",") if text is not None else None
    if names and (not all(names) or len(set(names)) != len(names)):
        raise click.BadParameter(f"expected different names joined by commas, found {text!r}")
    return names


@click.command()
@click.argument("weights", type=click.Path(path_type=pathlib.Path))
@click.option("--out", type=click.Path(path_type=pathlib.Path), help="Folder, created where missing")
@click.option("--list", "is_list", is_flag=True, help="Print the layers, write nothing")
@click.option("--layers", callback=_layers, metavar="A,B,..", help="To export, by name (default: the stem behind its norm)")
@click.option("--filter", type=int, metavar="K", help="Export this filter only")
@click.option("--fold", is_flag=True, help="With --filter: a layer norm without all the other filters")
@click.option("--size", callback=_size, metavar="WxH", help='Of the pictures that "same" padding is for')
@click.option("--preprocessing", type=click.Choice(sorted(families.PREPROCESSING)), help="What the network is fed (.onnx: needed)")
@click.option("--name", help="Of the model (default: of the file)")
@click.option("--padding", callback=_padding, default="none", show_default=True, help="none | same | T,L,B,R")
@click.option("--network", help="For the metadata (default: as found, else the name); a known one is held against the file (of .npz and .onnx: "
              "against the first convolution)")
@click.option("--layer", default="stem", show_default=True, help="Of an .npz, for the metadata")
@click.option("--licence", default="unknown", show_default=True, help="Of the weights, for the metadata")
@click.option("--default-filter", default=0)
def command(**options):
    """Turn the weights of a pretrained network into OUT/NAME.onnx, of several layers into OUT/NAME_LAYER.onnx each.

    WEIGHTS: .h5 or .keras of Keras, .safetensors of PyTorch (ConvNeXt, EfficientNetV2, NASNet, ResNet): the stem; .onnx: any whole network,
    cut at --layers; .npz: the arrays of a stem. Files take RGB 0..255; preprocessing and batch norm are inside.

    Padding: none by default, as stemvo samples a stem more densely by running it on shifted copies of the frame, and padding would put
    borders between them. "same" is what the network was trained with (TensorFlow's depends on --size; without it: even), for comparing
    values. Four numbers are the pixels at the top, left, bottom and right."""
    options = types.SimpleNamespace(**options)
    if options.is_list:
        return click.echo(layer_list.text(layer_list.read(options.weights, options.size)))
    if options.out is None:
        raise click.UsageError("expected --out (or --list), found none")
    written, notes = export(options)
    for file, said in written.items():
        click.echo(f"{file}: {said['network']}, {said['layer']}: {said['filters']} filters, kernel {said['kernel']}, stride {said['stride']}, "
                   f"padding {said['padding']}")
    for note in notes:
        click.echo(f"  {note}")


def options_of(*arguments):
    """As the command has them."""
    return types.SimpleNamespace(**command.make_context("export", list(map(str, arguments))).params)
