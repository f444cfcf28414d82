# SPDX-License-Identifier: MIT
"""Pictures of a folder as networks see them: 3 x H x W float32, RGB, 0..255; a gray one has three equal planes."""

import matplotlib.image
import numpy as np

from stems.weights import WeightsError


def find(folder, count):
    """At most `count` PNG files, spread over the folder."""
    files = sorted(folder.glob("*.png")) if folder.is_dir() else []
    if len(files) < 2:
        raise WeightsError(f"{folder}: expected a folder of at least 2 PNG files, found {len(files)}")
    return [files[round(index)] for index in np.linspace(0, len(files) - 1, min(count, len(files)))]


def read(path):
    try:
        picture = matplotlib.image.imread(path).astype(np.float32)
    except (OSError, SyntaxError, ValueError) as error:
        raise WeightsError(f"{path}: expected a PNG, found: {' '.join(str(error).split())}") from error
    picture = np.rint(255.0 * picture)
    return np.ascontiguousarray(np.tile(picture, (3, 1, 1)) if picture.ndim == 2 else picture[:, :, :3].transpose(2, 0, 1))
