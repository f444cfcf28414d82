# SPDX-License-Identifier: MIT
"""Under a Python that has the frameworks: networks with random weights, saved as the libraries save them, and
what the libraries make of one picture. See export_frameworks.py.

    python write_files.py FOLDER keras|torch     # one at a time: they do not load into one process
"""

import json
import os
import pathlib
import sys

os.environ.setdefault("TF_CPP_MIN_LOG_LEVEL", "3")
os.environ.setdefault("CUDA_VISIBLE_DEVICES", "")

import numpy as np  # noqa: E402

# Even, odd, and one of each: TensorFlow's "same" padding differs.
SIZES = ((96, 128), (95, 127), (96, 127))


def shake(values, rng):
    """Batch norms and biases start as ones and zeros: make them matter; variances stay positive."""
    return [value * rng.uniform(0.8, 1.2, value.shape) + rng.uniform(0.01, 0.2, value.shape) for value in values]


def write_keras(folder, pictures, cases):
    import keras

    applications = keras.applications
    networks = (("convnext_tiny", "ConvNeXtTiny", "convnext_tiny_stem", "identity"), ("efficientnetv2-b0", "EfficientNetV2B0", "stem_bn", "identity"),
                ("efficientnetv2-s", "EfficientNetV2S", "stem_bn", "identity"), ("nasnet_mobile", "NASNetMobile", "stem_bn1", "nasnet"),
                ("resnet50", "ResNet50", "conv1_bn", "resnet50"))
    rng = np.random.default_rng(1)
    for name, builder, layer, preprocess in networks:
        keras.utils.set_random_seed(1)
        model = getattr(applications, builder)(weights=None, include_top=False, input_shape=(224, 224, 3))
        model.set_weights(shake(model.get_weights(), rng))
        stem = keras.Model(model.input, model.get_layer(layer).output)
        free = keras.models.clone_model(stem, input_tensors=keras.Input((None, None, 3)))
        free.set_weights(stem.get_weights())
        prepare = (lambda x: x) if preprocess == "identity" else getattr(applications, preprocess).preprocess_input
        outputs = [np.asarray(free(prepare(picture.transpose(1, 2, 0)[None].copy()))).transpose(0, 3, 1, 2)[0] for picture in pictures]
        np.savez(folder / f"keras_{name}.out.npz", *outputs)
        for suffix, save in ((".keras", model.save), (".h5", model.save), (".weights.h5", model.save_weights)):
            file = f"keras_{name}{suffix}"
            save(folder / file)
            cases.append({"file": file, "output": f"keras_{name}.out.npz", "layer": layer})
    cases[-1]["version"] = f"keras {keras.__version__}"


def shaken_state(model, rng):
    import torch

    state = {name: value if value.dtype == torch.int64 else torch.from_numpy(shake([value.numpy()], rng)[0].astype(np.float32))
             for name, value in model.state_dict().items()}
    model.load_state_dict(state)
    return model.eval()


def torch_outputs(model, stem, mean, std, pictures):
    import torch

    outputs = []
    for picture in pictures:
        fed = (picture / 255.0 - np.array(mean).reshape(3, 1, 1)) / np.array(std).reshape(3, 1, 1)
        with torch.no_grad():
            outputs.append(stem(model, torch.from_numpy(fed.astype(np.float32))[None]).numpy()[0])
    return outputs


def norm_without_activation(norm, values):
    """timm's BatchNormAct2d holds the activation too."""
    import torch

    return torch.nn.functional.batch_norm(values, norm.running_mean, norm.running_var, norm.weight, norm.bias, eps=norm.eps)


def write_torch(folder, pictures, cases):
    import safetensors.torch
    import timm
    import torch
    import torchvision

    timm_stems = {"convnext_atto": lambda m, x: m.stem(x), "convnext_tiny": lambda m, x: m.stem(x),
                  "tf_efficientnetv2_b0": lambda m, x: norm_without_activation(m.bn1, m.conv_stem(x)),
                  "tf_efficientnetv2_s": lambda m, x: norm_without_activation(m.bn1, m.conv_stem(x)),
                  "resnet18": lambda m, x: m.bn1(m.conv1(x)), "nasnetalarge": lambda m, x: m.conv0(x)}
    rng = np.random.default_rng(2)
    torch.manual_seed(1)
    for name, stem in timm_stems.items():
        model = shaken_state(timm.create_model(name, pretrained=False), rng)
        config = model.pretrained_cfg
        np.savez(folder / f"timm_{name}.out.npz", *torch_outputs(model, stem, config["mean"], config["std"], pictures))
        state = {key: value.contiguous() for key, value in model.state_dict().items()}
        safetensors.torch.save_file(state, folder / f"timm_{name}.safetensors")
        cases.append({"file": f"timm_{name}.safetensors", "output": f"timm_{name}.out.npz", "layer": "stem"})
        if name in ("convnext_atto", "tf_efficientnetv2_b0", "resnet18"):
            write_whole(folder, name, model, config, pictures, cases)
    for name, stem in (("resnet18", lambda m, x: m.bn1(m.conv1(x))), ("convnext_tiny", lambda m, x: m.features[0](x)),
                       ("efficientnet_v2_s", lambda m, x: m.features[0][1](m.features[0][0](x)))):
        model = shaken_state(getattr(torchvision.models, name)(weights=None), rng)
        outputs = torch_outputs(model, stem, (0.485, 0.456, 0.406), (0.229, 0.224, 0.225), pictures)
        np.savez(folder / f"torchvision_{name}.out.npz", *outputs)
        safetensors.torch.save_file(model.state_dict(), folder / f"torchvision_{name}.safetensors")
        cases.append({"file": f"torchvision_{name}.safetensors", "output": f"torchvision_{name}.out.npz", "layer": "stem"})
    cases[-1]["version"] = f"torch {torch.__version__}, timm {timm.__version__}, torchvision {torchvision.__version__}"


def write_whole(folder, name, model, config, pictures, cases):
    """The whole network as ONNX, and what a module deep inside gives."""
    import torch

    place, layer = {"convnext_atto": ("stages.1.blocks.0.mlp.fc1", "/stages/stages.1/blocks/blocks.0/mlp/fc1/Conv_output_0"),
                    "tf_efficientnetv2_b0": ("blocks.4.0.conv_dw", "/blocks/blocks.4/blocks.4.0/conv_dw/Conv_output_0"),
                    "resnet18": ("layer3.0.conv2", "/layer3/layer3.0/conv2/Conv_output_0")}[name]
    kept = []
    norm = {"tf_efficientnetv2_b0": "blocks.4.0.bn2", "resnet18": "layer3.0.bn2"}.get(name)

    def keep(_module, _inputs, output):  # the exporter folds the norm behind a convolution into it
        kept.append(norm_without_activation(model.get_submodule(norm), output) if norm else output)

    hook = model.get_submodule(place).register_forward_hook(keep)
    torch_outputs(model, lambda m, x: m(x), config["mean"], config["std"], pictures)
    hook.remove()
    outputs = [values.numpy()[0] for values in kept]
    np.savez(folder / f"whole_{name}.out.npz", *outputs)
    torch.onnx.export(model, (torch.zeros(1, 3, 96, 128),), folder / f"whole_{name}.onnx", opset_version=18, dynamo=False,
                      input_names=["x"], output_names=["y"], dynamic_axes={"x": {2: "h", 3: "w"}})
    fed = "imagenet" if config["mean"][0] == 0.485 else "half"
    cases.append({"file": f"whole_{name}.onnx", "output": f"whole_{name}.out.npz", "layer": layer, "fed": fed})


def main():
    folder, library = pathlib.Path(sys.argv[1]), sys.argv[2]
    rng = np.random.default_rng(3)
    pictures = [rng.uniform(0, 255, (3, *size)).astype(np.float32) for size in SIZES]
    cases = []
    {"keras": write_keras, "torch": write_torch}[library](folder, pictures, cases)
    np.savez(folder / "pictures.npz", *pictures)
    (folder / f"{library}.json").write_text(json.dumps(cases), encoding="utf-8")


if __name__ == "__main__":
    main()
