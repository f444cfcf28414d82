# SPDX-License-Identifier: MIT
"""The stem of a known network (families.py) from its weights file."""

import dataclasses
import re

import numpy as np

from . import families, weight_files
from . import stem as stem_module
from .weights import WeightsError


def _padding(layout, size):
    """top, left, bottom, right as trained; size: width, height of the pictures it is for."""
    if layout.padding == "none":
        return (0, 0, 0, 0)
    if layout.padding == "symmetric":
        return ((layout.kernel - 1) // 2,) * 4
    (left, right), (top, bottom) = (stem_module.same_padding(layout.kernel, layout.stride, side) for side in size)
    return (top, left, bottom, right)


def _shape_of(layout, layer):
    """filters, planes, height, width of the convolution's kernel; None if it is none."""
    name = "kernel" if layout.source == "keras" else "weight"
    shape = layer.shapes.get(name, ())
    if len(shape) != 4:
        return None
    return (shape[3], shape[2], shape[0], shape[1]) if layout.source == "keras" else shape


def _single(file, pattern):
    found = file.find(re.compile(pattern))
    return found[0] if len(found) == 1 else found[0] if found and file.source == "keras" else None


def _layouts_of(file):
    """Layouts whose two layers are in the file, with the kernel of that family."""
    found = []
    for key, layout in families.LAYOUTS.items():
        if layout.source != file.source:
            continue
        convolution, norm = _single(file, layout.convolution), _single(file, layout.norm)
        shape = _shape_of(layout, convolution) if convolution and norm else None
        if shape and shape[1:] == (3, layout.kernel, layout.kernel) and _has_norm(layout, norm, shape[0]):
            found.append((key, layout, convolution, norm))
    return found


def _norm_arrays(layout):
    if layout.source == "keras":
        return ("gamma", "beta") + (("moving_mean", "moving_variance") if layout.norm_kind == "batch" else ())
    return ("weight", "bias") + (("running_mean", "running_var") if layout.norm_kind == "batch" else ())


def _has_norm(layout, norm, filters):
    wanted = _norm_arrays(layout)
    running = any(name in norm.shapes for name in ("moving_mean", "running_mean"))
    return all(norm.shapes.get(name) == (filters,) for name in wanted) and running == (layout.norm_kind == "batch")


def _block_names(file, layout):
    pattern = re.compile(layout.block)
    matches = (pattern.fullmatch(f"{layer.name}." if "." in layout.block and layout.source == "torch" else layer.name)
               for layer in file.layers)
    return {next(group for group in match.groups() if group) for match in matches if match}


def _is_bottleneck(file):
    return any(re.fullmatch(r"layer1\.0\.conv3|conv2_block1_3_conv", layer.name) for layer in file.layers)


def _has_normalization_layer(file):
    """Keras' EfficientNetV2-B0 to B3 have a Normalization layer; S, M, L have not."""
    return any(layer.name == "normalization" or re.fullmatch(r"normalization_\d+", layer.name) for layer in file.layers)


def _candidates(file, key, layout, filters):
    blocks = len(_block_names(file, layout))
    found = []
    for network in families.NETWORKS:
        if key not in network.layouts or network.filters != filters:
            continue
        if network.blocks and blocks and network.blocks != blocks:
            continue
        if network.bottleneck is not None and blocks and network.bottleneck != _is_bottleneck(file):
            continue
        if key == "efficientnetv2/keras" and _has_normalization_layer(file) != (network.layouts[key] == "imagenet"):
            continue
        if key == "nasnet/keras" and not blocks:
            continue
        if key in ("resnet/keras", "efficientnetv2/keras") and file.find(re.compile("separable_conv.*")):
            continue
        found.append(network)
    return found


def identify(file):
    """Layout, layers and networks of a file. Error: of none that is known."""
    layouts = _layouts_of(file)
    for key, layout, convolution, norm in layouts:
        filters = _shape_of(layout, convolution)[0]
        networks = _candidates(file, key, layout, filters)
        if networks:
            return key, layout, convolution, norm, networks
    first = [layer for layer in file.layers if layer.kind == "convolution"][:1]
    found = ", ".join(f"{layer.name} {'x'.join(map(str, shape))}" for layer in first
                      for name, shape in layer.shapes.items() if len(shape) > 1)
    blocks = f", {len(_block_names(file, layouts[0][1]))} residual blocks" if layouts else ""
    raise WeightsError(f"{file.path}: expected the weights of one of {', '.join(network.name for network in families.NETWORKS)}; found other ones: first convolution "
                       f"{found or 'none'}{blocks} in {len(file.layers)} layers (any network can be given whole as .onnx)")


def _check_network(file, networks, wanted):
    """wanted: a known network's name that the file should hold, or any other text."""
    expected = families.find(wanted)
    if expected is not None and expected not in networks:
        raise WeightsError(f"{file.path}: expected the weights of {expected.name} ({expected.filters} filters in the stem), "
                           f"found those of {' or '.join(network.name for network in networks)} "
                           f"({networks[0].filters} filters)")


def load(path, padding, size, network=None, preprocessing=None):
    """The stem's layers of a weights file by name (the convolution, and with its norm), the network ("EfficientNetV2-B0", or several joined
    by " or " that the file does not tell apart) and its own padding. padding: (top, left, bottom, right), "none" or "same" (as trained, on
    pictures of `size`, width and height). network: what the file should hold. preprocessing: another one than the table's."""
    file = weight_files.load(path)
    key, layout, convolution, norm, networks = identify(file)
    _check_network(file, networks, network)
    kinds = {item.layouts[key] for item in networks}
    if len(kinds) > 1 and preprocessing is None:
        raise WeightsError(f"{path}: {' or '.join(item.name for item in networks)}: the file does not tell them apart, and "
                           f"they are fed differently; expected --preprocessing {' or '.join(sorted(kinds))}")
    fed = families.PREPROCESSING[preprocessing or kinds.pop()]
    own = _padding(layout, size)
    chosen = (0, 0, 0, 0) if padding == "none" else own if padding == "same" else tuple(padding)
    plain = _convolution(file, layout, convolution, fed, chosen)
    return {convolution.name: plain, norm.name: _with_norm(file, layout, norm, plain)}, " or ".join(item.name for item in networks), own


def _convolution(file, layout, layer, fed, padding):
    keras = layout.source == "keras"
    weights = weight_files.read_array(file, layer, "kernel" if keras else "weight")
    weights = weights.transpose(3, 2, 0, 1) if keras else weights
    if fed.takes_bgr:
        weights = weights[:, ::-1]
    bias = weight_files.read_array(file, layer, "bias") if "bias" in layer.shapes else np.zeros(len(weights))
    return stem_module.Stem(stem_module.fold_scale(weights, fed.std), bias, layout.stride, np.array(fed.mean), padding)


def _with_norm(file, layout, norm, plain):
    arrays = [weight_files.read_array(file, norm, name) for name in _norm_arrays(layout)]
    if layout.norm_kind == "layer":
        return dataclasses.replace(plain, layer_norm=stem_module.LayerNorm(*arrays, layout.epsilon))
    if not np.all(arrays[3] > -layout.epsilon):
        raise WeightsError(f"{file.path}: {norm.name}: expected positive variances, found {arrays[3].min()}")
    weights, bias = stem_module.fold_batch_norm(plain.weights, plain.bias, *arrays, layout.epsilon)
    return dataclasses.replace(plain, weights=weights, bias=bias)
