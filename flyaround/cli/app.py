"""The command line: one application, which imports the module of a command when the command is called."""

# ruff: noqa: E501 - one paragraph of help a line
from __future__ import annotations

import logging
from importlib import import_module
from typing import Annotated, Any

import typer
from rich.logging import RichHandler
from rich.markup import escape
from typer.core import TyperCommand, TyperGroup
from typer.main import get_command, get_group

from flyaround.cli.terminal import terminal, with_literal_help

COMMANDS = {
    "sim": "console:sim",
    "render": "pictures:render",
    "fly": "flights:fly",
    "capture": "datasets:capture",
    "check": "datasets:check",
    "convert": "conversion:convert",
    "overlay": "overlay:overlay",
    "estimate": "estimation:estimate",
    "evaluate": "estimation:evaluate",
    "train": "training:train",
    "compare": "compare:compare",
    "bench": "bench:bench",
    "doctor": "doctor:doctor",
    "cache": "cache:cache",
    "plugins": "plugins:plugins",
    "scenarios": "flights:scenarios",
    "recipes": "recipes:recipes",
    "backgrounds": "recipes:backgrounds",
    "cameras": "flights:cameras",
    "demo": "demo:demo",
    "targets": "targets:app",
}
"""Module and name of each command: a function, or the application of a group. In the order of the help page."""
HIL_COMMANDS = {
    "host": "hil_host:host",
    "board": "hil_board:board",
    "camera": "hil_camera:camera",
    "bundle": "hil:bundle",
    "report": "hil:report",
    "audit": "hil:audit",
    "campaign": "hil_campaign:campaign",
    "delay-map": "hil_campaign:delay_map",
    "forecast": "hil_forecast:forecast",
    "key": "hil:make_key",
    "display": "display:display",
    "display-calibrate": "display:display_calibrate",
    "display-match": "display:display_match",
}
"""The same of the group ``hil``."""
ABOUT = {
    "sim": "Fly a scenario in a window: watch it, slow it, hurry it, take the chaser over. F1 lists the keys.",
    "render": "Draw one frame and its truth, or one for each pose of a list.",
    "fly": "Propagate only: states of both craft as a table, with phases, thrust and events; the delta-v it takes.",
    "capture": "Take labelled images of a flight or a recipe; every frame's labels are checked as it is written.",
    "check": "Re-verify every label of a data set, and some images by drawing them again; exit 1 if one is wrong.",
    "convert": "Write a data set in another format; pictures and poses of others get masks, keypoints and boxes by the model.",
    "overlay": "Draw labels over copies of a data set's pictures, to look at: the craft's axes, edges, keypoints, box, mask.",
    "estimate": "Estimate the pose of a target in images.",
    "evaluate": "Estimate every frame of a data set and compare with its truth: metrics.json, frames.csv, index.html.",
    "train": "Train a network on a data set; judge it on every tenth frame, which it never saw.",
    "compare": "Set pictures of others beside ours of the like views: histograms, Sobel, edges with and without atmosphere.",
    "bench": "Frame cost per scene beside a reference pass of the same run.",
    "doctor": "What OpenGL, GPU and optional parts this machine has, and how to get the rest.",
    "cache": "List what is kept between runs (decoded maps, baked light, targets), or remove it.",
    "plugins": "Sensors, formats, recipes, estimators, targets and bodies that installed packages add (docs/plugins.md).",
    "scenarios": "List the built-in scenarios, or print one to start from; `flyaround recipes` lists what draws samples.",
    "recipes": "List the built-in recipes, print one to start from, or write the poses that one draws.",
    "backgrounds": "Draw the library of backgrounds that a recipe puts its craft before, without the craft.",
    "cameras": "List the built-in cameras, or read one of any format, check it, and write it in another.",
    "demo": "Fly, capture and check 20 images, run 30 frames through a board process, and make a page of it.",
    "targets": "List the targets, add a mesh as one, export or draw them.",
}
"""First paragraph of each command's help, for the page that lists them: nothing is imported for it."""
HIL_ABOUT = {
    "host": "Stream a flight to a board, or fly on its poses (--closed-loop).",
    "board": "The board's side, on this machine: connect, estimate, answer; the exit code tells how it ended.",
    "camera": "Be a camera on the network: GVCP and GVSP for Aravis, GStreamer and other clients, until Ctrl-C.",
    "bundle": "Write one file that runs on a board with Python 3.9, numpy and OpenCV 4.6, and nothing else.",
    "report": "Latency, jitter, drops by cause: a page with plots from a ledger.",
    "audit": "Hold a ledger against the time codes in the pictures; exit 1 where they do not agree in every frame.",
    "campaign": "Fly cases with their seeds unattended and judge them: requirement matrix, JUnit XML; exit 1 if one is not met.",
    "delay-map": "Success of an approach over latency, jitter and losses of its poses: heat maps, CSV, and where half fail.",
    "forecast": "Fly closed loops on noisy poses and tell how well their filter foretells the attitude, over how far it looks.",
    "key": "Write a new key for hil host --key and hil board --key.",
    "display": "Show a flight full screen to a real camera that looks at the monitor.",
    "display-calibrate": "From pictures of the patterns: which pixel of the camera sees which of the screen, and how bright.",
    "display-match": "Which frame each grabbed picture shows, by the code in it; exit 1 where one has none.",
}
HIL_HELP = """\
Hardware in the loop: a flight's pictures go to a board, and its poses come back.

The closed loop, which flies on these poses: hil host SCENARIO --closed-loop. How far ahead it sees: hil forecast.

Many runs against requirements: hil campaign. The delay map of an approach: hil delay-map.

The camera endpoint, for software that grabs from real cameras: hil camera.

The emulated board, which needs no desk: make board-qemu, where the source code is (docs/hil_boards.md).
"""


class LazyCommand(TyperCommand):
    """A command of which name and first paragraph are known; its module is imported for its words or its help."""

    def __init__(self, name: str, home: str, about: str) -> None:
        super().__init__(name, help=escape(about))
        self._home = home

    def make_context(self, *call: Any, **options: Any) -> Any:  # noqa: ANN401 - click's own signature
        """Parse the command's words; the context has the whole command."""
        module, _, name = self._home.partition(":")
        thing = getattr(import_module(f"flyaround.cli.{module}"), name)
        if isinstance(thing, typer.Typer):
            return with_literal_help(get_group(thing)).make_context(*call, **options)
        one = typer.Typer(add_completion=False)
        one.command(self.name)(thing)
        return with_literal_help(get_command(one)).make_context(*call, **options)


class Commands(TyperGroup):
    """The commands of the tables above."""

    def __init__(self, **options: Any) -> None:  # noqa: ANN401 - click's own
        super().__init__(**options)
        with_literal_help(self)
        hil_commands: dict[str, Any] = {
            name: LazyCommand(name, home, HIL_ABOUT[name]) for name, home in HIL_COMMANDS.items()
        }
        hil = TyperGroup(name="hil", help=HIL_HELP, no_args_is_help=True, commands=hil_commands)
        commands: dict[str, Any] = {
            name: LazyCommand(name, home, ABOUT[name]) for name, home in COMMANDS.items()
        }
        targets = commands.pop("targets")
        self.commands = {**commands, "hil": hil, "targets": targets}


app = typer.Typer(
    name="flyaround",
    cls=Commands,
    help="What a camera on a chaser sees of a spacecraft: pictures, truth, hardware in the loop.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _show_version(value: bool) -> None:
    if value:
        from importlib.metadata import version  # noqa: PLC0415 - slow to import, needed here alone

        typer.echo(version("flyaround"))
        raise typer.Exit


@app.callback()
def options(
    verbose: Annotated[
        int, typer.Option("--verbose", "-v", count=True, help="More log lines; twice for debugging.")
    ] = 0,
    *,
    _version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Options of every command."""
    level = (logging.WARNING, logging.INFO, logging.DEBUG)[min(verbose, 2)]
    handler = RichHandler(console=terminal(stderr=True), show_path=verbose > 1, rich_tracebacks=False)
    logging.basicConfig(level=level, format="%(name)s: %(message)s", handlers=[handler], force=True)
