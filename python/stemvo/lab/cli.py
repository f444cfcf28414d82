# SPDX-License-Identifier: MIT
"""stemvo-lab: a command NAME is the click command `command` of the module stemvo.lab.NAME, imported when it is called."""

import importlib

import click

import stemvo

COMMANDS = {
    "benchmark": "Methods on KITTI's sequences, beside zero motion and published numbers",
    "compare": "Trajectories of any program against one ground truth",
    "learn": "A filter, learned by gradient through the aligner",
    "paper": "The paper's tables and figures from weights and KITTI",
    "scene": "A result for COLMAP or nerfstudio",
    "robustness": "Compare channels on frames in worse light, weather or hands",
    "search": "Rank the filters of networks by the odometry they give",
    "warps": "How far tracked points land from where they are, on each channel",
}


class Lazy(click.Group):
    def list_commands(self, ctx):
        return list(COMMANDS)

    def get_command(self, ctx, name):
        return importlib.import_module(f"stemvo.lab.{name}").command if name in COMMANDS else None

    def invoke(self, ctx):
        try:
            return super().invoke(ctx)
        except (ValueError, OSError, KeyError) as error:
            raise click.ClickException(str(error)) from None

    def format_commands(self, ctx, formatter):
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))


@click.command(cls=Lazy, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(stemvo.__version__, message="%(version)s")
def main():
    """Studies of monocular visual odometry on learned filter channels."""


if __name__ == "__main__":
    main()
