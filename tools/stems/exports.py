# SPDX-License-Identifier: MIT
"""Makes the models that export_stem.py writes, one of each layer, from any kind of weights. Nothing is written here."""

import dataclasses

from stems import families, fold, graph_cut, graph_kinds, onnx_writer, pretrained, weights
from stems.weights import WeightsError


@dataclasses.dataclass
class Export:
    """layers: name -> its model, and what its metadata says (filters, kernel, stride, padding, sampling)."""

    layers: dict
    network: str | None = None
    notes: tuple = ()


def _check_padding(stem):
    for before, after, size in zip(stem.padding[:2], stem.padding[2:], stem.kernel):
        if max(before, after) >= size:
            raise WeightsError(f"--padding: expected less than the kernel's {size} pixels, found {max(before, after)}")


def _check_filter(path, layer, filters, index):
    if not 0 <= index < filters:
        raise WeightsError(f"{path}: {layer}: --filter: expected 0 to {filters - 1}, found {index}")


def _chosen(path, stems, wanted, default):
    """The layers asked for, of name -> stem."""
    if not wanted:
        return {default: stems[default]}
    for name in wanted:
        if name not in stems:
            raise WeightsError(f"{path}: --layers: expected {', '.join(stems)} (deeper layers need the whole network as .onnx), "
                               f"found {name!r}")
    return {name: stems[name] for name in wanted}


def _stems_of(options):
    """Name -> stem, the default layer, the network's name, notes."""
    if options.weights.suffix == ".npz":
        return {options.layer: weights.load(options.weights, options.padding, options.network)}, options.layer, None, ()
    size = options.size or (2, 2)
    found = pretrained.load(options.weights, options.padding, size, options.network, options.preprocessing)
    notes = ()
    if options.padding == "same" and len(set(found.trained_padding)) > 1:
        kinds = ["even" if side % 2 == 0 else "odd" for side in size]
        notes = (f"padding {list(found.trained_padding)} as TensorFlow pads pictures of {kinds[0]} width and {kinds[1]} height",)
    return {layer.name: layer.stem for layer in found.layers}, found.layers[-1].name, found.network, notes


def _fold_one(options, name, stem):
    """One filter of a stem without the others."""
    _check_filter(options.weights, name, stem.filters, options.filter)
    if stem.layer_norm is None:
        folded = fold.one_filter(stem, options.filter)
    elif any(stem.padding):
        raise WeightsError(f"{options.weights}: --fold: expected --padding none for a stem with a layer norm, found "
                           f"{list(stem.padding)}")
    else:
        folded = fold.layer_norm_filter(stem, options.filter)
    return folded, (f"filter {options.filter}: {len(folded.weights)} rows instead of {stem.filters}",)


def _of_stems(options):
    stems, default, network, notes = _stems_of(options)
    stems = _chosen(options.weights, stems, options.layers, default)
    for stem in stems.values():
        _check_padding(stem)
    single = len(stems) == 1
    if options.fold:
        if options.filter is None or not single:
            raise WeightsError("--fold: expected --filter K and one layer, found "
                               f"{'no --filter' if options.filter is None else f'{len(stems)} layers'}")
        name, stem = next(iter(stems.items()))
        folded, more = _fold_one(options, name, stem)
        return Export({name: (onnx_writer.build(folded), folded)}, network, notes + more)
    layers = {}
    for name, stem in stems.items():
        shape = stem
        if options.filter is not None:
            _check_filter(options.weights, name, stem.filters, options.filter)
            shape = fold.one_filter(dataclasses.replace(stem, layer_norm=None), options.filter)
        layers[name] = (onnx_writer.build(stem, options.filter), shape)
    return Export(layers, network, notes)


def _check_network(options, model):
    """Error: another first convolution than that of the known network it should be."""
    if families.find(options.network) is None:
        return
    first = graph_kinds.first_convolution(model)
    if first is None:
        raise WeightsError(f"{options.weights}: --network: expected the first convolution of {options.network}, found none whose "
                           f"weights are in the file (leave --network out, or give another name)")
    wrong = families.mismatch(options.network, *first)
    if wrong:
        raise WeightsError(f"{options.weights}: --network: {wrong}")


def _of_graph(options):
    whole = graph_cut.read(options.weights)  # a broken file is said before what is missing beside it
    if not options.layers:
        raise WeightsError(f"{options.weights}: expected --layers (--list shows them), found none")
    if options.preprocessing is None:
        raise WeightsError(f"{options.weights}: expected --preprocessing, what the network is fed "
                           f"({', '.join(families.PREPROCESSING)}), found none")
    if options.padding != "none" or options.fold:
        raise WeightsError(f"{options.weights}: expected no --padding and no --fold for a whole network, found one")
    layers = {}
    with graph_cut.refusing_unsound(options.weights):
        _check_network(options, whole)
        for name in options.layers:
            model, layer = graph_cut.cut(options.weights, name, families.PREPROCESSING[options.preprocessing], options.size, options.filter)
            layers[layer.name] = (model, layer)
    notes = tuple(f"{name}: {'sees the whole frame' if layer.field.whole_frame else 'padded inside'}: sampled at its "
                  f"stride {layer.stride} only" for name, (_, layer) in layers.items() if layer.sampling == "native")
    return Export(layers, None, notes)


def make(options):
    """Reads, checks, builds. Error: WeightsError, of one line."""
    return _of_graph(options) if options.weights.suffix == ".onnx" else _of_stems(options)
