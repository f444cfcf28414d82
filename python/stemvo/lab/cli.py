# SPDX-License-Identifier: MIT
"""stemvo-lab: a command NAME is the click command `command` of the module NAME of stemvo.lab or stemvo.stems, imported when it is called."""

import importlib

import click

import stemvo

LAB = {
    "benchmark": "Methods on KITTI's sequences, beside zero motion and published numbers",
    "compare": "Trajectories of any program against one ground truth",
    "paper": "The paper's tables and figures from weights and KITTI",
    "scene": "A result for COLMAP or nerfstudio",
    "robustness": "Compare channels on frames in worse light, weather or hands",
    "search": "Rank the filters of networks by the odometry they give",
    "warps": "How far tracked points land from where they are, on each channel",
}
STEMS = {
    "export": "Weights of a pretrained network (Keras, PyTorch, ONNX) as models",
    "family": "A grid of made filters, for a search",
    "learn": "A stem or a filter, learned from rendered drives",
    "show": "A stem's filters as a picture; how far it is from gray",
}
COMMANDS = LAB | STEMS


class Lazy(click.Group):
    def list_commands(self, ctx):
        return list(COMMANDS)

    def get_command(self, ctx, name):
        return importlib.import_module(f"stemvo.{'stems' if name in STEMS else 'lab'}.{name}").command if name in COMMANDS else None

    def invoke(self, ctx):
        try:
            return super().invoke(ctx)
        except (ValueError, OSError) as error:
            file, why = getattr(error, "filename", None), getattr(error, "strerror", None)
            raise click.ClickException(f"{file}: expected to be read or written, found: {why}" if file else str(error)) from None

    def format_commands(self, ctx, formatter):
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))


@click.command(cls=Lazy, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(stemvo.__version__, message="%(version)s")
def main():
    """Studies of monocular visual odometry on learned filter channels."""


if __name__ == "__main__":
    main()
