# SPDX-License-Identifier: MIT
"""stemvo-lab export on files with the structure of Keras' and PyTorch's: values, names, errors."""

import exporting
import h5py
import numpy as np
import pytest
import safetensors.numpy
from exporting import IMAGENET, files, plain_stem, random_arrays, run_onnx  # noqa: F401

HALF = {"input_scale": np.float64(2), "input_offset": np.float64(-1)}
KERAS128 = {"input_scale": np.float64(255 / 128), "input_offset": np.float64(-1)}


def keras_arrays(stem):
    convolution = [stem["conv_w"].transpose(2, 3, 1, 0)] + ([stem["conv_b"]] if "conv_b" in stem else [])
    names = [f"{norm}_{name}" for norm in ("bn", "ln") for name in ("gamma", "beta", "mean", "var")]
    return convolution, [stem[name] for name in names if name in stem]


def torch_arrays(stem, convolution, normalization):
    names = {"gamma": "weight", "beta": "bias", "mean": "running_mean", "var": "running_var"}
    found = {f"{convolution}.weight": stem["conv_w"]} | ({f"{convolution}.bias": stem["conv_b"]} if "conv_b" in stem else {})
    return found | {f"{normalization}.{new}": stem[f"{norm}_{old}"] for norm in ("bn", "ln") for old, new in names.items() if f"{norm}_{old}" in stem}


def blocks(names):
    return {f"{name}.weight": np.zeros((1, 1, 1, 1), np.float32) for name in names}


def efficientnet_blocks(counts):
    return blocks(f"blocks.{stage}.{block}.conv_pw" for stage, count in enumerate(counts) for block in range(count))


RESNET18 = blocks(f"layer{stage}.{block}.conv{i}" for stage in range(1, 5) for block in range(2) for i in (1, 2))
CONVNEXT_TINY = [f"convnext_tiny_stage_{s}_block_{b}_layer_scale" for s, n in enumerate((3, 3, 9, 3)) for b in range(n)]


def resnet(files):
    stem = random_arrays((7, 7), 2, norm="batch", filters=64, epsilon=1e-5)
    path = files.folder / "resnet18.safetensors"
    safetensors.numpy.save_file(torch_arrays(stem, "conv1", "bn1") | RESNET18, path)
    return path, stem


def convnext(files, name, group=None, cut=None):
    stem = random_arrays((4, 4), 4, norm="layer", filters=96)
    convolution, norm = keras_arrays(stem)
    outer, path = "convnext_tiny_stem", files.folder / name
    layers = {(outer, f"{outer}_conv"): dict(zip(("kernel", "bias"), convolution)),
              (outer, f"{outer}_layernorm"): dict(zip(("gamma", "beta"), norm))}
    exporting.keras_named(path, layers, ["input_1", "convnext_tiny_prestem_normalization", outer, *CONVNEXT_TINY], group, cut)
    return path, stem

@pytest.mark.parametrize(("group", "names_cut"), [(None, None), ("model_weights", None), (None, 9)])
def test_convnext_by_names(files, group, names_cut):
    files.check(*convnext(files, "convnext.h5", group, names_cut), network="ConvNeXt-Tiny")


def test_convnext_by_numbers(files):
    stem = random_arrays((4, 4), 4, norm="layer", filters=96)
    convolution, norm = keras_arrays(stem)
    path = files.folder / "convnext.weights.h5"
    scales = {f"layer_scale{f'_{i}' if i else ''}": [np.ones(96, np.float32)] for i in range(36)}
    with h5py.File(path, "w") as file:
        exporting.keras_numbered(file, {"sequential/layers/conv2d": convolution,
                                      "sequential/layers/layer_normalization": norm, **scales})
    files.check(path, stem, network="ConvNeXt-Small")


def test_efficientnet_by_config_with_tensorflows_padding(files):
    for kind, fed, network, filters, count in ((["Normalization"], IMAGENET, "EfficientNetV2-B0", 32, 21),
                                               ([], KERAS128, "EfficientNetV2-L", 32, 79)):
        stem = random_arrays((3, 3), 2, norm="batch", filters=filters, fed=fed)
        convolution, norm = keras_arrays(stem)
        path = files.folder / f"{network}.keras"
        config = [("InputLayer", "in"), ("Rescaling", "rescaling"), *((name, "normalization") for name in kind),
                  ("Conv2D", "stem_conv"), ("BatchNormalization", "stem_bn"),
                  *(("Conv2D", f"block{i}a_project_conv") for i in range(1, 10)),
                  *(("Conv2D", f"block9{'abcdefghijklmnopqrstuvwxyz'[i % 26]}{i}_project_conv") for i in range(count - 9))]
        exporting.keras_zip(path, {"conv2d": convolution, "batch_normalization": norm}, config)
        files.check(path, stem, network=network)
        files.check(path, stem, "--padding", "same", network=network, padding=(0, 0, 1, 1), size=(16, 22))
        files.check(path, stem, "--padding", "same", "--size", "21x16", network=network, padding=(0, 1, 1, 1), size=(16, 21))
        assert "odd width and even height" in files.said


def test_resnet_takes_bgr(files):
    stem = random_arrays((7, 7), 2, norm="batch", filters=64, epsilon=1.001e-5, fed={"input_mean": np.array([123.68, 116.779, 103.939]) / 255,
                                                  "input_std": np.full(3, 1 / 255)})
    (kernel,), norm = keras_arrays(stem)
    layers = {"conv1_conv": {"kernel": kernel[:, :, ::-1]},
              "conv1_bn": dict(zip(("gamma", "beta", "moving_mean", "moving_variance"), norm))}
    order = ["in", *layers, "conv2_block1_3_conv", *(f"conv3_block{i}_3_conv" for i in range(2, 17))]
    layers["conv2_block1_3_conv"] = {"kernel": np.zeros((1, 1, 64, 256), np.float32)}
    exporting.keras_named(files.folder / "resnet.h5", layers, order)
    files.check(files.folder / "resnet.h5", stem, network="ResNet-50")


def test_resnet(files):
    path, stem = resnet(files)
    files.check(path, stem, network="ResNet-18")
    files.check(path, stem, "--padding", "same", network="ResNet-18", padding=(3, 3, 3, 3))


def test_names_of_a_model_that_was_wrapped(files):
    stem = random_arrays((4, 4), 4, norm="layer", filters=96)
    arrays = torch_arrays(stem, "downsample_layers.0.0", "downsample_layers.0.1")
    arrays |= blocks(f"stages.{s}.{b}.dwconv" for s, n in enumerate((3, 3, 27, 3)) for b in range(n))
    path = files.folder / "parallel.safetensors"
    safetensors.numpy.save_file({f"module.{name}": values for name, values in arrays.items()}, path)
    files.check(path, stem, network="ConvNeXt-Small")


def test_the_file_tells_networks_apart_by_their_blocks(files):
    stem = random_arrays((3, 3), 2, norm="batch", filters=24, fed=HALF)
    path = files.folder / "s.safetensors"
    arrays = torch_arrays(stem, "conv_stem", "bn1") | efficientnet_blocks((2, 4, 4, 6, 9, 15))
    safetensors.numpy.save_file(arrays, path)
    files.check(path, stem, network="EfficientNetV2-S")


def test_a_file_for_each_layer(files):
    path, stem = resnet(files)
    entries = files.export(path, "--layers", "conv1,bn1")
    assert [entry["layer"] for entry in entries] == ["conv1", "bn1"]
    assert [entry["file"] for entry in entries] == ["resnet18_conv1.onnx", "resnet18_bn1.onnx"]


def test_one_filter(files):
    path, stem = resnet(files)
    image = np.random.default_rng(3).uniform(0, 255, (3, 20, 21))
    for options in ((), ("--fold",)):
        entry = files.export(path, "--filter", "7", *options)[-1]
        assert (entry["filters"], entry["file"]) == (1, "resnet18_filter7.onnx")
        np.testing.assert_allclose(run_onnx(files.out / entry["file"], image)[0], plain_stem(stem, image, (0, 0, 0, 0))[7], atol=1e-3)


def test_weights_of_another_network(files):
    path = files.folder / "other.safetensors"
    safetensors.numpy.save_file({"features.0.weight": np.zeros((64, 3, 11, 11), np.float32)}, path)
    message = files.error_of(path)
    assert all(word in message for word in ("expected the weights of one of ConvNeXt-", "ResNet-152", "found other ones", "features.0 64x3x11x11"))
    assert "expected the weights of ConvNeXt-XLarge (256 filters in the stem), found those of ResNet-18 (64 filters)" in files.error_of(resnet(files)[0], "--network", "ConvNeXt-XLarge")


def test_layers_and_filters(files):
    path, _ = resnet(files)
    assert "--layers: expected conv1, bn1 (deeper" in files.error_of(path, "--layers", "layer3")
    for options in ((), ("--fold",)):
        assert "--filter: expected 0 to 63, found 64" in files.error_of(path, "--filter", "64", *options)
    assert "--fold: expected --filter K" in files.error_of(path, "--fold")
    assert "--default-filter: expected 0 to 63, found 64" in files.error_of(path, "--default-filter", "64")


def test_damaged_files(files):
    path, _ = resnet(files)
    whole = path.read_bytes()
    tensors = files.folder / "whole.safetensors"
    safetensors.numpy.save_file({"conv1.weight": np.zeros((64, 3, 7, 7), np.float32)}, tensors)
    keras = files.folder / "whole.h5"
    exporting.keras_named(keras, {"a": {"kernel": np.ones((9, 9))}}, ["a"])
    stored = files.save(random_arrays((3, 3), 2, norm="batch")).read_bytes()
    contents = [b"", b"text", stored[:len(stored) // 2], stored[:300] + bytes(200) + stored[500:], whole[:len(whole) // 2], tensors.read_bytes()[:99], keras.read_bytes()[:1000]]
    for suffix in (".npz", ".safetensors", ".h5", ".keras", ".onnx"):
        for content in contents:
            damaged = files.folder / f"damaged{suffix}"
            damaged.write_bytes(content)
            assert "expected" in files.error_of(damaged, "--layers", "a", "--preprocessing", "none")
        assert "found nothing" in files.error_of(files.folder / f"absent{suffix}", "--layers", "a", "--preprocessing", "none")
    assert "expected one of .npz, .onnx, .h5" in files.error_of(files.folder / "a.txt") and "found no suffix" in files.error_of(files.folder)


def test_a_pickle_is_told_how_to_convert_it(files):
    path = files.folder / "resnet18.pth"
    path.write_bytes(b"anything")
    for message in (files.error_of(path), files.error_of(path, "--list")):
        assert "torch.load('resnet18.pth', weights_only=True), 'resnet18.safetensors')" in message


def test_not_finite_weights(files):
    stem = random_arrays((7, 7), 2, norm="batch", filters=64, epsilon=1e-5)
    stem["conv_w"][3] = np.nan
    path = files.folder / "nan.safetensors"
    safetensors.numpy.save_file(torch_arrays(stem, "conv1", "bn1") | RESNET18, path)
    assert "conv1.weight: expected finite numbers" in files.error_of(path)
