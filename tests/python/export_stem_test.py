# SPDX-License-Identifier: MIT
"""tools/export_stem.py against a plain numpy convolution: values, pixel map, padding, errors."""

import contextlib
import io
import os
import pathlib
import sys
import tempfile
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "tools"))
import _environment  # noqa: E402,F401

import numpy as np  # noqa: E402
import onnxruntime  # noqa: E402
import yaml  # noqa: E402

import export_stem  # noqa: E402
from stems import manifest  # noqa: E402


def run_onnx(path, image):
    session = onnxruntime.InferenceSession(str(path), providers=["CPUExecutionProvider"])
    return session.run(["channels"], {"image": image[None].astype(np.float32)})[0][0]


def plain_stem(arrays, image, padding):
    """The network as its authors wrote it, step by step: normalise, pad, convolve, batch norm, layer norm."""
    if "input_scale" in arrays:
        image = image / 255.0 * arrays["input_scale"] + arrays["input_offset"]
    elif "input_mean" in arrays:
        image = (image / 255.0 - arrays["input_mean"].reshape(3, 1, 1)) / arrays["input_std"].reshape(3, 1, 1)
    top, left, bottom, right = padding
    image = np.pad(image.astype(np.float64), ((0, 0), (top, bottom), (left, right)))
    weights, stride = arrays["conv_w"].astype(np.float64), int(arrays["stride"])
    rows = (image.shape[1] - weights.shape[2]) // stride + 1
    columns = (image.shape[2] - weights.shape[3]) // stride + 1
    out = np.zeros((weights.shape[0], rows, columns))
    for y in range(rows):
        for x in range(columns):
            patch = image[:, y * stride:y * stride + weights.shape[2], x * stride:x * stride + weights.shape[3]]
            out[:, y, x] = (weights * patch).sum(axis=(1, 2, 3))
    out += arrays.get("conv_b", np.zeros(weights.shape[0])).reshape(-1, 1, 1)
    if "bn_eps" in arrays:
        gamma, beta, mean, var = (arrays[f"bn_{key}"].reshape(-1, 1, 1) for key in ("gamma", "beta", "mean", "var"))
        out = (out - mean) / np.sqrt(var + arrays["bn_eps"]) * gamma + beta
    if "ln_eps" in arrays:
        out = (out - out.mean(axis=0)) / np.sqrt(out.var(axis=0) + arrays["ln_eps"])
        out = out * arrays["ln_gamma"].reshape(-1, 1, 1) + arrays["ln_beta"].reshape(-1, 1, 1)
    return out


def random_arrays(kernel, stride, *, norm):
    rng = np.random.default_rng(7)
    filters = 5
    arrays = {"conv_w": rng.normal(size=(filters, 3, *kernel)), "stride": np.int32(stride),
              "input_mean": np.array([0.485, 0.456, 0.406]), "input_std": np.array([0.229, 0.224, 0.225])}
    if norm == "batch":
        arrays |= {"bn_gamma": rng.normal(size=filters), "bn_beta": rng.normal(size=filters),
                   "bn_mean": rng.normal(size=filters), "bn_var": rng.uniform(0.1, 2, filters), "bn_eps": 1e-3}
    if norm == "layer":
        arrays |= {"conv_b": rng.normal(size=filters), "ln_gamma": rng.normal(size=filters),
                   "ln_beta": rng.normal(size=filters), "ln_eps": 1e-6}
    return {key: np.asarray(value, np.int32 if key == "stride" else np.float32) for key, value in arrays.items()}


class Folder(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def export(self, weights, *options):
        with contextlib.redirect_stdout(io.StringIO()):
            self.assertEqual(export_stem.main([str(weights), "--out", str(self.folder / "out"), *options]), 0)
        return yaml.safe_load((self.folder / "out" / "manifest.yaml").read_text(encoding="utf-8"))["models"]

    def save(self, arrays, name="random.npz"):
        np.savez(self.folder / name, **arrays)
        return self.folder / name

    def check_values(self, weights, arrays, option, padding, size):
        image = np.random.default_rng(3).uniform(0, 255, (3, *size))
        entry = self.export(weights, "--padding", option)[-1]
        self.assertEqual(entry["padding"], list(padding))
        got = run_onnx(self.folder / "out" / entry["file"], image)
        want = plain_stem(arrays, image, padding)
        self.assertEqual(got.shape, want.shape)
        error = np.abs(got - want).max() / want.std()
        self.assertTrue(error < 2e-5, f"error {error} standard deviations")


class Values(Folder):
    def test_all_norms_kernels_and_paddings(self):
        for norm in ("none", "batch", "layer"):
            for kernel, stride in (((3, 3), 2), ((4, 4), 4), ((5, 2), 3)):
                same = export_stem.weights.own_padding(random_arrays(kernel, stride, norm=norm))
                for option, padding in (("none", (0, 0, 0, 0)), ("same", same), ("0,1,2,1", (0, 1, 2, 1))):
                    with self.subTest(norm=norm, kernel=kernel, padding=option):
                        arrays = random_arrays(kernel, stride, norm=norm)
                        self.check_values(self.save(arrays), arrays, option, padding, (17, 22))

    def test_same_is_the_odd_pixel_at_the_bottom_and_right(self):
        self.assertEqual(export_stem.weights.own_padding(random_arrays((3, 3), 2, norm="none")), (0, 0, 1, 1))
        arrays = random_arrays((7, 7), 2, norm="none") | {"padding": np.int32(3)}
        self.assertEqual(export_stem.weights.own_padding(arrays), (3, 3, 3, 3))

    def test_same_stem_same_bytes(self):
        weights = self.save(random_arrays((4, 4), 4, norm="layer"))
        first = self.export(weights)[0]["sha256"]
        self.assertEqual(self.export(weights)[0]["sha256"], first)


class PixelMap(Folder):
    def test_centre_of_mass_of_a_spot_is_where_the_manifest_puts_it(self):
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


class Manifest(Folder):
    def test_entries_are_replaced_by_name_and_others_stay(self):
        weights = self.save(random_arrays((4, 4), 4, norm="none"))
        self.export(weights, "--name", "first")
        self.export(weights, "--name", "second", "--licence", "yes: \"quoted\" # and odd")
        models = self.export(weights, "--name", "first", "--default-filter", "3")
        self.assertEqual([model["name"] for model in models], ["first", "second"])
        self.assertEqual(models[0]["default_filter"], 3)
        self.assertEqual(models[1]["licence"], "yes: \"quoted\" # and odd")
        for model in models:
            self.assertEqual(tuple(model), manifest.KEYS)
            self.assertEqual(model["sha256"], manifest.sha256(self.folder / "out" / model["file"]))


class Errors(Folder):
    def expect(self, weights, *words, options=()):
        with self.assertRaises((export_stem.weights.WeightsError, manifest.ManifestError)) as caught:
            export_stem.export(export_stem.parse_arguments([str(weights), "--out", str(self.folder / "out"), *options]))
        message = str(caught.exception)
        self.assertNotIn("\n", message)
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
        def stem(filters, kernel, stride, norm, **more):
            arrays = {key: np.resize(value, (filters, 3, kernel, kernel) if key == "conv_w" else filters) if np.ndim(value) and "input" not in key else value
                      for key, value in random_arrays((kernel, kernel), stride, norm=norm).items()}
            return self.save(arrays | more, f"{filters}.npz")

        for arrays, network, found in (
                ((64, 7, 2, "none"), "EfficientNetV2-B0", "found 64 filters 7x7, stride 2"), ((32, 3, 1, "batch"), "efficientnetv2-b0", "found 32 filters 3x3, stride 1"),
                ((24, 3, 2, "batch"), "EfficientNetV2-B0", "found 24 filters 3x3, stride 2"), ((32, 3, 2, "layer"), "EfficientNetV2-B0", "layer norm")):
            self.expect(stem(*arrays), ".npz: --network: expected the stem of EfficientNetV2-B0 (32 filters 3x3, stride 2, batch norm)", found,
                        options=("--network", network))
            self.assertFalse((self.folder / "out").exists())
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

    def test_broken_manifest_is_not_overwritten(self):
        weights = self.save(random_arrays((3, 3), 2, norm="batch"))
        (self.folder / "out").mkdir()
        (self.folder / "out" / "manifest.yaml").write_text("models: [", encoding="utf-8")
        self.expect(weights, "manifest.yaml")
        self.assertEqual(os.listdir(self.folder / "out"), ["manifest.yaml"])


@unittest.skipUnless("STEMVO_SHARED_DATA" in os.environ, "STEMVO_SHARED_DATA is not set")
class PretrainedStems(Folder):
    def test_values(self):
        files = sorted(pathlib.Path(os.environ["STEMVO_SHARED_DATA"], "stems").glob("*.npz"))
        self.assertGreaterEqual(len(files), 3)
        for file in files:
            with np.load(file) as stored:
                arrays = dict(stored)
            for option, padding in (("none", (0, 0, 0, 0)), ("same", export_stem.weights.own_padding(arrays))):
                with self.subTest(file=file.name, padding=option):
                    self.check_values(file, arrays, option, padding, (36, 50))


if __name__ == "__main__":
    unittest.main()
