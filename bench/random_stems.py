# SPDX-License-Identifier: MIT
"""Writes OUT/full.onnx and OUT/folded.onnx: a stem of ConvNeXt-XLarge's shape (256 filters 4x4, stride 4, layer norm,
random weights), and filter 10 of it folded into a network of its own (docs/search.md). Same values, other cost.

    build/lab/bin/python bench/random_stems.py OUT
"""

import argparse
import pathlib

import numpy as np
from stemvo.stems import families, fold, metadata, onnx_writer
from stemvo.stems import stem as stem_module

FILTERS, FILTER = 256, 10


def random_stem(filters, seed):
    """The shape of a ConvNeXt stem, its layer norm trained to other than ones and zeros."""
    rng = np.random.default_rng(seed)
    fed = families.PREPROCESSING["imagenet"]
    norm = stem_module.LayerNorm(rng.uniform(0.5, 1.5, filters), rng.normal(size=filters), 1e-6)
    return stem_module.Stem(stem_module.fold_scale(rng.normal(size=(filters, 3, 4, 4)) / 7, fed.std), rng.normal(size=filters) / 10, 4,
                            np.array(fed.mean), layer_norm=norm)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=pathlib.Path, help="folder, created")
    out = parser.parse_args().out
    out.mkdir(parents=True, exist_ok=True)
    full = random_stem(FILTERS, seed=1)
    for name, stem, chosen in (("full", full, FILTER), ("folded", fold.layer_norm_filter(full, FILTER), 0)):
        metadata.write(out / f"{name}.onnx", onnx_writer.build(stem), stem, network="random, ConvNeXt-XLarge's shape", layer="stem",
                       licence="MIT", default_filter=chosen, command="bench/random_stems.py")


if __name__ == "__main__":
    main()
