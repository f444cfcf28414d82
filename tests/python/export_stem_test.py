# SPDX-License-Identifier: MIT
"""tools/export_stem.py against a plain numpy convolution: values, pixel map, padding, errors."""

import os
import pathlib
import unittest

from exporting import Files, random_arrays, run_onnx

import numpy as np
import onnx

import export_stem
from stems import metadata


class Npz(Files):
    def save(self, arrays, name="random.npz"):
        np.savez(self.folder / name, **arrays)
        return self.folder / name


class Values(Npz):
    def test_all_norms_kernels_and_paddings(self):
        for norm in ("none", "batch", "layer"):
            for kernel, stride in (((3, 3), 2), ((4, 4), 4), ((5, 2), 3)):
                arrays = random_arrays(kernel, stride, norm=norm)
                for option, padding in (("none", (0, 0, 0, 0)), ("same", export_stem.weights.own_padding(arrays)), ("0,1,2,1", (0, 1, 2, 1))):
                    with self.subTest(norm=norm, kernel=kernel, padding=option):
                        self.check(self.save(arrays), arrays, "--padding", option, padding=padding)

    def test_same_is_the_odd_pixel_at_the_bottom_and_right(self):
        self.assertEqual(export_stem.weights.own_padding(random_arrays((3, 3), 2, norm="none")), (0, 0, 1, 1))
        arrays = random_arrays((7, 7), 2, norm="none") | {"padding": np.int32(3)}
        self.assertEqual(export_stem.weights.own_padding(arrays), (3, 3, 3, 3))

    def test_same_stem_same_bytes(self):
        weights = self.save(random_arrays((4, 4), 4, norm="layer"))
        first, second = ((self.folder / "out" / self.export(weights)[0]["file"]).read_bytes() for _ in range(2))
        self.assertEqual(first, second)


class PixelMap(Npz):
    def test_centre_of_mass_of_a_spot_is_where_the_metadata_put_it(self):
        """All-ones filters see a spot wherever it is under the kernel: the pixels that see it, mapped by
        input = stride * channel + (kernel - 1) / 2 - padding, surround it evenly."""
        for kernel, stride, padding in (((4, 4), 1, (0, 0, 0, 0)), ((3, 5), 1, (2, 1, 0, 3))):
            arrays = {"conv_w": np.ones((1, 3, *kernel), np.float32), "stride": np.int32(stride)}
            entry = self.export(self.save(arrays), "--padding", ",".join(map(str, padding)))[-1]
            image = np.zeros((3, 20, 24))
            image[:, 9, 13] = 255.0
            rows, columns = np.nonzero(run_onnx(self.folder / "out" / entry["file"], image)[0])
            offset = [(entry["kernel"][axis] - 1) / 2 - entry["padding"][axis] for axis in (0, 1)]
            self.assertAlmostEqual(entry["stride"] * rows.mean() + offset[0], 9.0)
            self.assertAlmostEqual(entry["stride"] * columns.mean() + offset[1], 13.0)


class Metadata(Npz):
    def test_the_file_says_what_it_is(self):
        weights = self.save(random_arrays((4, 4), 4, norm="none"))
        odd = "yes: \"quoted\" # and odd"
        (said,) = self.export(weights, "--name", "first", "--licence", odd, "--default-filter", "3", "--network", "ours", "--layer", "conv")
        self.assertEqual({key: said[key] for key in ("network", "layer", "licence", "default_filter", "filters", "kernel", "stride", "padding")},
                         {"network": "ours", "layer": "conv", "licence": odd, "default_filter": 3, "filters": 5, "kernel": [4, 4],
                          "stride": 4, "padding": [0, 0, 0, 0]})
        self.assertIn("tools/export_stem.py random.npz", said["command"])

    def test_a_file_without_metadata_is_told_how_to_get_them(self):
        model = onnx.ModelProto()
        (self.folder / "plain.onnx").write_bytes(model.SerializeToString())
        with self.assertRaisesRegex(metadata.MetadataError, "plain.onnx: expected metadata stemvo.network, found none; tools/export_stem.py"):
            metadata.read(self.folder / "plain.onnx")


class Errors(Npz):
    def expect(self, weights, *words, options=()):
        message = self.error_of(weights, *options)
        for word in words:
            self.assertIn(word, message)

    def test_one_line_says_what_is_wrong(self):
        good = random_arrays((3, 3), 2, norm="batch")
        without = {key: value for key, value in good.items() if key not in ("stride", "conv_w")}
        self.expect(self.save(without), "missing conv_w, stride", "bn_beta")
        self.expect(self.save({key: value for key, value in good.items() if key != "bn_var"}), "missing bn_var")
        self.expect(self.save(good | {"conv_w": np.zeros((3, 3, 32, 3, 1))}), "conv_w", "nx3xnxn", "3x3x32x3x1")
        self.expect(self.save(good | {"conv_w": good["conv_w"] * np.nan}), "conv_w", "NaN")
        self.expect(self.save(good | {"stride": np.int32(0)}), "stride", "found 0")
        self.expect(self.save(good | {"extra": np.int32(0)}), "found extra")
        self.expect(self.save(good | {"conv_w": np.array(["a"])}), "conv_w")

    def test_a_known_network_is_held_against_the_arrays(self):
        def stem(filters, kernel, stride, norm):
            return self.save(random_arrays((kernel, kernel), stride, norm=norm, filters=filters), f"{filters}.npz")

        for arrays, network, found in (
                ((64, 7, 2, "none"), "EfficientNetV2-B0", "found 64 filters 7x7, stride 2"), ((32, 3, 1, "batch"), "efficientnetv2-b0", "found 32 filters 3x3, stride 1"),
                ((24, 3, 2, "batch"), "EfficientNetV2-B0", "found 24 filters 3x3, stride 2"), ((32, 3, 2, "layer"), "EfficientNetV2-B0", "layer norm")):
            self.expect(stem(*arrays), ".npz: --network: expected the stem of EfficientNetV2-B0 (32 filters 3x3, stride 2, batch norm)", found,
                        options=("--network", network))
        self.expect(stem(96, 4, 4, "batch"), "ConvNeXt-Tiny (96 filters 4x4, stride 4, layer norm), found 96 filters 4x4, stride 4, batch norm",
                    options=("--network", "ConvNeXt-Tiny"))
        for arrays, network in (((64, 7, 2, "none"), "ResNet-18"), ((32, 3, 2, "batch"), "EfficientNetV2-B0"), ((96, 4, 4, "layer"), "convnext-tiny"),
                                ((64, 7, 2, "none"), "my own network")):
            self.assertIn(network, [entry["network"] for entry in self.export(stem(*arrays), "--network", network)])

    def test_damaged_files(self):
        whole = self.save(random_arrays((3, 3), 2, norm="batch")).read_bytes()
        damaged = self.folder / "damaged.npz"
        for content in (b"", b"text", whole[:len(whole) // 2], whole[:300] + bytes(200) + whole[500:]):
            damaged.write_bytes(content)
            self.expect(damaged, "damaged.npz", "expected an .npz file")
        self.expect(self.folder / "absent.npz", "found nothing")
        self.expect(self.folder, "found no suffix")


@unittest.skipUnless("STEMVO_SHARED_DATA" in os.environ, "STEMVO_SHARED_DATA is not set")
class PretrainedStems(Npz):
    def test_values(self):
        files = sorted(pathlib.Path(os.environ["STEMVO_SHARED_DATA"], "stems").glob("*.npz"))
        self.assertGreaterEqual(len(files), 3)
        for file in files:
            with np.load(file) as stored:
                arrays = dict(stored)
            for option, padding in (("none", (0, 0, 0, 0)), ("same", export_stem.weights.own_padding(arrays))):
                with self.subTest(file=file.name, padding=option):
                    self.check(file, arrays, "--padding", option, padding=padding, size=(36, 50))


if __name__ == "__main__":
    unittest.main()
