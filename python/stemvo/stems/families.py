# SPDX-License-Identifier: MIT
"""Networks whose stems can be taken from their weights: one table.

Sources: keras-team/keras keras/src/applications/{convnext,efficientnet_v2,nasnet,resnet}.py; timm/models/
{convnext,efficientnet,nasnet,resnet}.py; torchvision/models/{convnext,efficientnet,resnet}.py;
facebookresearch/ConvNeXt models/convnext.py.

Preprocessing is x -> (x - mean) / std of pixels 0..255, RGB:
    imagenet  mean (.485, .456, .406) * 255, std (.229, .224, .225) * 255
    half      mean 127.5, std 127.5: -1..1
    keras128  mean 128, std 128 (EfficientNetV2-S, M, L of Keras)
    caffe     mean (123.68, 116.779, 103.939), std 1, the network itself takes BGR (ResNet of Keras)
"""

import dataclasses

import numpy as np


@dataclasses.dataclass(frozen=True)
class Preprocessing:
    mean: tuple
    std: tuple
    takes_bgr: bool = False  # the convolution's input planes are B, G, R


PREPROCESSING = {
    "none": Preprocessing((0.0,) * 3, (1.0,) * 3),
    "unit": Preprocessing((0.0,) * 3, (255.0,) * 3),
    "imagenet": Preprocessing(tuple(np.array([0.485, 0.456, 0.406]) * 255), tuple(np.array([0.229, 0.224, 0.225]) * 255)),
    "half": Preprocessing((127.5,) * 3, (127.5,) * 3),
    "keras128": Preprocessing((128.0,) * 3, (128.0,) * 3),
    "caffe": Preprocessing((123.68, 116.779, 103.939), (1.0,) * 3, takes_bgr=True),
}


@dataclasses.dataclass(frozen=True)
class Layout:
    """How one library lays out the stem of one family."""

    source: str  # keras, or torch (timm, torchvision, the authors')
    convolution: str  # pattern of the layer's name; keras: its stem's name
    norm: str
    norm_kind: str  # batch, layer
    epsilon: float
    kernel: int
    stride: int
    padding: str  # "none", "symmetric" ((kernel - 1) / 2 on each side), or "tensorflow" ("same")
    block: str  # pattern that finds each residual block once, by its name's groups


@dataclasses.dataclass(frozen=True)
class Network:
    name: str
    filters: int
    blocks: int  # residual blocks; 0: told from others by its filters alone
    layouts: dict  # layout's key -> name of its preprocessing
    bottleneck: bool | None = None  # ResNet: whether a block has three convolutions


LAYOUTS = {
    "convnext/keras": Layout("keras", r"convnext_\w+_stem_conv|sequential/conv2d", r"convnext_\w+_stem_layernorm|sequential/layer_normalization",
                             "layer", 1e-6, 4, 4, "none", r"\w+_(stage_\d+_block_\d+)_layer_scale|(layer_scale(?:_\d+)?)"),
    "convnext/timm": Layout("torch", r"stem\.0", r"stem\.1", "layer", 1e-6, 4, 4, "none", r"(stages\.\d+\.blocks\.\d+)\..*"),
    "convnext/facebook": Layout("torch", r"downsample_layers\.0\.0", r"downsample_layers\.0\.1", "layer", 1e-6, 4, 4, "none",
                                r"(stages\.\d+\.\d+)\..*"),
    "convnext/torchvision": Layout("torch", r"features\.0\.0", r"features\.0\.1", "layer", 1e-6, 4, 4, "none",
                                   r"(features\.\d+\.\d+)\.block\..*"),
    "efficientnetv2/keras": Layout("keras", r"stem_conv|conv2d", r"stem_bn|batch_normalization", "batch", 1e-3, 3, 2,
                                   "tensorflow", r"(block\d\w+)_project_conv"),
    "efficientnetv2/timm": Layout("torch", r"conv_stem", r"bn1", "batch", 1e-3, 3, 2, "tensorflow", r"(blocks\.\d+\.\d+)\..*"),
    "efficientnetv2/torchvision": Layout("torch", r"features\.0\.0", r"features\.0\.1", "batch", 1e-3, 3, 2, "symmetric",
                                         r"(features\.\d+\.\d+)\.block\..*"),
    "nasnet/keras": Layout("keras", r"stem_conv1|conv2d", r"stem_bn1|batch_normalization", "batch", 1e-3, 3, 2, "none",
                           r"(separable_conv)_1_.*|(separable_conv2d)"),
    "nasnet/timm": Layout("torch", r"conv0\.conv", r"conv0\.bn", "batch", 1e-3, 3, 2, "none", r"(cell_\w+)\..*"),
    "resnet/keras": Layout("keras", r"conv1_conv|conv2d", r"conv1_bn|batch_normalization", "batch", 1.001e-5, 7, 2, "symmetric",
                           r"(conv\d_block\d+)_3_conv"),
    "resnet/torch": Layout("torch", r"conv1", r"bn1", "batch", 1e-5, 7, 2, "symmetric", r"(layer\d\.\d+)\..*"),
}

_CONVNEXT = {key: "imagenet" for key in LAYOUTS if key.startswith("convnext/")}
_TORCH_ONLY = {"convnext/timm": "imagenet"}
_RESNET = {"resnet/keras": "caffe", "resnet/torch": "imagenet"}


def _efficientnet(keras, timm, torchvision=None):
    names = {"efficientnetv2/keras": keras, "efficientnetv2/timm": timm}
    return names | ({"efficientnetv2/torchvision": torchvision} if torchvision else {})


NETWORKS = (
    Network("ConvNeXt-Atto", 40, 12, _TORCH_ONLY), Network("ConvNeXt-Femto", 48, 12, _TORCH_ONLY),
    Network("ConvNeXt-Pico", 64, 12, _TORCH_ONLY), Network("ConvNeXt-Nano", 80, 14, _TORCH_ONLY),
    Network("ConvNeXt-Tiny", 96, 18, _CONVNEXT), Network("ConvNeXt-Small", 96, 36, _CONVNEXT),
    Network("ConvNeXt-Base", 128, 36, _CONVNEXT), Network("ConvNeXt-Large", 192, 36, _CONVNEXT),
    Network("ConvNeXt-XLarge", 256, 36, _CONVNEXT),
    Network("EfficientNetV2-B0", 32, 21, _efficientnet("imagenet", "imagenet")),
    Network("EfficientNetV2-B1", 32, 27, _efficientnet("imagenet", "imagenet")),
    Network("EfficientNetV2-B2", 32, 28, _efficientnet("imagenet", "imagenet")),
    Network("EfficientNetV2-B3", 40, 34, _efficientnet("imagenet", "imagenet")),
    Network("EfficientNetV2-S", 24, 40, _efficientnet("keras128", "half", "imagenet")),
    Network("EfficientNetV2-M", 24, 57, _efficientnet("keras128", "half", "imagenet")),
    Network("EfficientNetV2-L", 32, 79, _efficientnet("keras128", "half", "half")),
    Network("NASNet-Mobile", 32, 0, {"nasnet/keras": "half"}),
    Network("NASNet-Large", 96, 0, {"nasnet/keras": "half", "nasnet/timm": "half"}),
    Network("ResNet-18", 64, 8, {"resnet/torch": "imagenet"}, bottleneck=False),
    Network("ResNet-34", 64, 16, {"resnet/torch": "imagenet"}, bottleneck=False),
    Network("ResNet-50", 64, 16, _RESNET, bottleneck=True), Network("ResNet-101", 64, 33, _RESNET, bottleneck=True),
    Network("ResNet-152", 64, 50, _RESNET, bottleneck=True),
)


def find(name):
    """The known network of that name, whatever its case; None if there is none."""
    return next((network for network in NETWORKS if name and network.name.lower() == name.lower()), None)


def mismatch(name, filters, kernel, stride, norm=None):
    """Says why a first convolution is not a known network's: "expected .., found ..", or None: it is like it, or no known
    network has that name. kernel: height, width. norm: layer, batch, or None where it is folded, left out or not known."""
    network = find(name)
    if network is None:
        return None
    layout = LAYOUTS[next(iter(network.layouts))]  # the libraries agree on these

    def described(count, height, width, step, kind):
        return f"{count} filters {height}x{width}, stride {step}" + (f", {kind} norm" if kind else "")

    if (filters, *kernel, stride, norm or layout.norm_kind) == (network.filters, layout.kernel, layout.kernel, layout.stride, layout.norm_kind):
        return None
    return (f"expected the stem of {network.name} ({described(network.filters, layout.kernel, layout.kernel, layout.stride, layout.norm_kind)}), "
            f"found {described(filters, *kernel, stride, norm)}")
