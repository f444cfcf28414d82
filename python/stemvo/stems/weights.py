# SPDX-License-Identifier: MIT
"""Reads the weights of a pretrained stem from an .npz file.

Keys (float32; C filters): conv_w Cx3xkhxkw, RGB; stride; and, where the network has them,
conv_b C; bn_gamma, bn_beta, bn_mean, bn_var C with bn_eps; ln_gamma, ln_beta C with ln_eps;
padding (pixels on each side); input_mean, input_std 3 for pixels in 0..1, or input_scale,
input_offset (scale * pixel + offset, pixels in 0..1).
"""

import zipfile

import numpy as np

from . import families
from . import stem as stem_module

_BATCH_NORM = ("bn_gamma", "bn_beta", "bn_mean", "bn_var", "bn_eps")
_LAYER_NORM = ("ln_gamma", "ln_beta", "ln_eps")
_REQUIRED = ("conv_w", "stride")
_KNOWN = (*_REQUIRED, "conv_b", *_BATCH_NORM, *_LAYER_NORM, "padding", "input_mean", "input_std",
          "input_scale", "input_offset")


class WeightsError(ValueError):
    """One line for the user."""


def _read_arrays(path):
    if not zipfile.is_zipfile(path):
        raise WeightsError(f"{path}: expected an .npz file of arrays, found {'another kind of file' if path.exists() else 'nothing'}")
    try:
        with np.load(path, allow_pickle=False) as file:
            return {key: np.asarray(file[key]) for key in file.files}
    except Exception as error:  # noqa: BLE001  NumPy raises many kinds on damaged archives
        raise WeightsError(f"{path}: expected an .npz file of arrays, found: {' '.join(str(error).split())}") from error


def _require_keys(path, arrays, keys):
    missing = [key for key in keys if key not in arrays]
    if missing:
        raise WeightsError(f"{path}: expected the keys {', '.join(keys)}; missing {', '.join(missing)}; "
                           f"found {', '.join(sorted(arrays)) or 'none'}")


def _require_shape(path, arrays, key, shape):
    """shape: sizes, None where any size will do."""
    array = arrays[key]
    fits = array.ndim == len(shape) and all(want in (None, got) for want, got in zip(shape, array.shape))
    if not fits or not np.issubdtype(array.dtype, np.number) or array.size == 0:
        wanted = "x".join("n" if size is None else str(size) for size in shape) or "one number"
        found = "x".join(map(str, array.shape)) or "one number"
        raise WeightsError(f"{path}: {key}: expected numbers, {wanted}; found {array.dtype}, {found}")
    if not np.all(np.isfinite(array)):
        raise WeightsError(f"{path}: {key}: expected finite numbers, found NaN or infinity")


def _check(path, arrays):
    _require_keys(path, arrays, _REQUIRED)
    unknown = sorted(set(arrays) - set(_KNOWN))
    if unknown:
        raise WeightsError(f"{path}: expected only the keys {', '.join(_KNOWN)}; found {', '.join(unknown)}")
    for group in (_BATCH_NORM, _LAYER_NORM, ("input_mean", "input_std"), ("input_scale", "input_offset")):
        if any(key in arrays for key in group):
            _require_keys(path, arrays, group)
    _require_shape(path, arrays, "conv_w", (None, 3, None, None))
    filters = arrays["conv_w"].shape[0]
    numbers = ("stride", "padding", "bn_eps", "ln_eps", "input_scale", "input_offset")
    for key in set(arrays) - {"conv_w"}:
        colours = key in ("input_mean", "input_std")
        _require_shape(path, arrays, key, () if key in numbers else (3,) if colours else (filters,))
    if not arrays["stride"] >= 1 or arrays["stride"] != int(arrays["stride"]):
        raise WeightsError(f"{path}: stride: expected a whole number >= 1, found {arrays['stride']}")
    if "padding" in arrays and (arrays["padding"] < 0 or arrays["padding"] != int(arrays["padding"])):
        raise WeightsError(f"{path}: padding: expected a whole number >= 0, found {arrays['padding']}")
    for key, least in (("input_std", 0.0), ("bn_var", -1e-12), ("input_scale", 0.0)):
        if key in arrays and not np.all(arrays[key] > least):
            raise WeightsError(f"{path}: {key}: expected positive numbers, found {np.min(arrays[key])}")


def _preprocessing(arrays):
    """mean, std per colour, in gray levels."""
    if "input_scale" in arrays:
        std = 255.0 / np.float64(arrays["input_scale"])
        return np.full(3, -np.float64(arrays["input_offset"]) * std), np.full(3, std)
    if "input_mean" in arrays:
        return 255.0 * arrays["input_mean"].astype(np.float64), 255.0 * arrays["input_std"].astype(np.float64)
    return np.zeros(3), np.ones(3)


def own_padding(arrays):
    """top, left, bottom, right as the network was trained: its own number, or TensorFlow's "same"
    on an even size (the odd pixel at the bottom and the right)."""
    if "padding" in arrays:
        return (int(arrays["padding"]),) * 4
    stride = int(arrays["stride"])
    (top, bottom), (left, right) = (stem_module.same_padding(size, stride, stride) for size in arrays["conv_w"].shape[2:])
    return top, left, bottom, right


def load(path, padding, network=None):
    """The stem in a file. padding: (top, left, bottom, right), "none" or "same" (as trained). network: what the file
    should hold; a known one is held against the arrays."""
    arrays = _read_arrays(path)
    _check(path, arrays)
    filters, _, *kernel = arrays["conv_w"].shape
    if wrong := families.mismatch(network, filters, kernel, int(arrays["stride"]), "batch" if "bn_eps" in arrays else "layer" if "ln_eps" in arrays else None):
        raise WeightsError(f"{path}: --network: {wrong}")
    mean, std = _preprocessing(arrays)
    weights = stem_module.fold_scale(arrays["conv_w"].astype(np.float64), std)
    bias = arrays.get("conv_b", np.zeros(weights.shape[0])).astype(np.float64)
    if "bn_eps" in arrays:
        batch_norm = [arrays[key].astype(np.float64) for key in _BATCH_NORM]
        weights, bias = stem_module.fold_batch_norm(weights, bias, *batch_norm)
    layer_norm = None
    if "ln_eps" in arrays:
        layer_norm = stem_module.LayerNorm(*(arrays[key].astype(np.float64) for key in _LAYER_NORM))
    padding = (0, 0, 0, 0) if padding == "none" else own_padding(arrays) if padding == "same" else tuple(padding)
    return stem_module.Stem(weights, bias, int(arrays["stride"]), mean, padding, layer_norm)
