# SPDX-License-Identifier: MIT
"""stemvo-lab export against a plain numpy convolution: values, pixel map, padding, errors."""

import os
import pathlib

import numpy as np
import onnx
import pytest
from exporting import files, plain_stem, random_arrays, run_onnx  # noqa: F401
from stemvo.stems import metadata
from stemvo.stems.weights import own_padding


@pytest.mark.parametrize("norm", ["none", "batch", "layer"])
@pytest.mark.parametrize(("kernel", "stride"), [((3, 3), 2), ((4, 4), 4), ((5, 2), 3)])
def test_all_norms_kernels_and_paddings(files, norm, kernel, stride):
    arrays = random_arrays(kernel, stride, norm=norm)
    for option, padding in (("none", (0, 0, 0, 0)), ("same", own_padding(arrays)), ("0,1,2,1", (0, 1, 2, 1))):
        files.check(files.save(arrays), arrays, "--padding", option, padding=padding)
    entry, image = files.export(files.save(arrays), "--filter", "3", "--fold")[-1], np.random.default_rng(8).uniform(0, 255, (3, 64, 96))
    assert run_onnx(files.out / entry["file"], image) == pytest.approx(plain_stem(arrays, image, (0, 0, 0, 0))[3:4], abs=1e-4)


def test_same_is_the_odd_pixel_at_the_bottom_and_right(files):
    assert own_padding(random_arrays((3, 3), 2, norm="none")) == (0, 0, 1, 1)
    arrays = random_arrays((7, 7), 2, norm="none") | {"padding": np.int32(3)}
    assert own_padding(arrays) == (3, 3, 3, 3)


def test_same_stem_same_bytes(files):
    weights = files.save(random_arrays((4, 4), 4, norm="layer"))
    first, second = ((files.out / files.export(weights)[0]["file"]).read_bytes() for _ in range(2))
    assert first == second


def test_centre_of_mass_of_a_spot_is_where_the_metadata_put_it(files):
    """All-ones filters see a spot wherever it is under the kernel: the pixels that see it, mapped by
    input = stride * channel + (kernel - 1) / 2 - padding, surround it evenly."""
    for kernel, stride, padding in (((4, 4), 1, (0, 0, 0, 0)), ((3, 5), 1, (2, 1, 0, 3))):
        arrays = {"conv_w": np.ones((1, 3, *kernel), np.float32), "stride": np.int32(stride)}
        entry = files.export(files.save(arrays), "--padding", ",".join(map(str, padding)))[-1]
        image = np.zeros((3, 20, 24))
        image[:, 9, 13] = 255.0
        rows, columns = np.nonzero(run_onnx(files.out / entry["file"], image)[0])
        offset = [(entry["kernel"][axis] - 1) / 2 - entry["padding"][axis] for axis in (0, 1)]
        assert entry["stride"] * rows.mean() + offset[0] == pytest.approx(9.0, abs=0.5e-7, rel=0)
        assert entry["stride"] * columns.mean() + offset[1] == pytest.approx(13.0, abs=0.5e-7, rel=0)


def test_the_file_says_what_it_is(files):
    weights = files.save(random_arrays((4, 4), 4, norm="none"))
    odd = "yes: \"quoted\" # and odd"
    (said,) = files.export(weights, "--name", "first", "--licence", odd, "--default-filter", "3", "--network", "ours", "--layer", "conv")
    assert ({key: said[key] for key in ("network", "layer", "licence", "default_filter", "filters", "kernel", "stride", "padding")} ==
            {"network": "ours", "layer": "conv", "licence": odd, "default_filter": 3, "filters": 5, "kernel": [4, 4], "stride": 4, "padding": [0, 0, 0, 0]})
    assert "stemvo-lab export random.npz" in said["command"]


def test_a_file_without_metadata_is_told_how_to_get_them(files):
    (files.folder / "plain.onnx").write_bytes(onnx.ModelProto().SerializeToString())
    with pytest.raises(ValueError, match="plain.onnx: expected metadata stemvo.network, found none; `stemvo-lab export`"):
        metadata.read(files.folder / "plain.onnx")


def expect(files, weights, *words, options=()):
    message = files.error_of(weights, *options)
    assert all(word in message for word in words), message


def test_one_line_says_what_is_wrong(files):
    good = random_arrays((3, 3), 2, norm="batch")
    without = {key: value for key, value in good.items() if key not in ("stride", "conv_w")}
    expect(files, files.save(without), "missing conv_w, stride", "bn_beta")
    expect(files, files.save({key: value for key, value in good.items() if key != "bn_var"}), "missing bn_var")
    expect(files, files.save(good | {"conv_w": np.zeros((3, 3, 32, 3, 1))}), "conv_w", "nx3xnxn", "3x3x32x3x1")
    expect(files, files.save(good | {"conv_w": good["conv_w"] * np.nan}), "conv_w", "NaN")
    expect(files, files.save(good | {"stride": np.int32(0)}), "stride", "found 0")
    expect(files, files.save(good | {"extra": np.int32(0)}), "found extra")
    expect(files, files.save(good | {"conv_w": np.array(["a"])}), "conv_w")


def test_a_known_network_is_held_against_the_arrays(files):
    def stem(filters, kernel, stride, norm):
        return files.save(random_arrays((kernel, kernel), stride, norm=norm, filters=filters), f"{filters}.npz")

    for arrays, network, found in (
            ((64, 7, 2, "none"), "EfficientNetV2-B0", "found 64 filters 7x7, stride 2"), ((32, 3, 1, "batch"), "efficientnetv2-b0", "found 32 filters 3x3, stride 1"),
            ((24, 3, 2, "batch"), "EfficientNetV2-B0", "found 24 filters 3x3, stride 2"), ((32, 3, 2, "layer"), "EfficientNetV2-B0", "layer norm")):
        expect(files, stem(*arrays), ".npz: --network: expected the stem of EfficientNetV2-B0 (32 filters 3x3, stride 2, batch norm)", found,
                    options=("--network", network))
    expect(files, stem(96, 4, 4, "batch"), "ConvNeXt-Tiny (96 filters 4x4, stride 4, layer norm), found 96 filters 4x4, stride 4, batch norm",
                options=("--network", "ConvNeXt-Tiny"))
    for arrays, network in (((64, 7, 2, "none"), "ResNet-18"), ((32, 3, 2, "batch"), "EfficientNetV2-B0"), ((96, 4, 4, "layer"), "convnext-tiny"),
                            ((64, 7, 2, "none"), "my own network")):
        assert network in [entry["network"] for entry in files.export(stem(*arrays), "--network", network)]


def test_a_padded_layer_norm_does_not_fold(files):
    expect(files, files.save(random_arrays((4, 4), 4, norm="layer")), "expected --padding none", options=("--filter", "3", "--fold", "--padding", "1,1,1,1"))


@pytest.mark.skipif("STEMVO_SHARED_DATA" not in os.environ, reason="STEMVO_SHARED_DATA is not set")
def test_pretrained_stems(files):
    found = sorted(pathlib.Path(os.environ["STEMVO_SHARED_DATA"], "stems").glob("*.npz"))
    assert len(found) >= 3
    for file in found:
        with np.load(file) as stored:
            arrays = dict(stored)
        for option, padding in (("none", (0, 0, 0, 0)), ("same", own_padding(arrays))):
            files.check(file, arrays, "--padding", option, padding=padding, size=(36, 50))
