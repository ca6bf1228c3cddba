"""The command-line application. A command's module is imported when the command is called."""

# ruff: noqa: E501 - one paragraph of help a line
from __future__ import annotations

import logging
import math
from importlib import import_module
from typing import Annotated, Any

import typer
from rich.logging import RichHandler
from rich.markup import escape
from typer.core import TyperCommand, TyperGroup
from typer.main import get_command, get_group

from flyaround.cli.terminal import terminal, with_literal_help
from flyaround.simulator.errors import UserError

COMMANDS = {
    "sim": "console:sim",
    "render": "pictures:render",
    "fly": "flights:fly",
    "film": "film:film",
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
"""Module and function, or application of a group, of each command, in the order of the help page."""

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
"""The same for the group ``hil``."""

ABOUT = {
    "sim": "Fly a scenario in a window, with time control and manual control. F1 lists the keys.",
    "render": "Render one frame and its truth, or one for each pose of a list.",
    "fly": "Propagate without images: states of both craft as a table, with phases, thrust, events and delta-v.",
    "film": "Render a flight, or a part of it, as a film; a film that is interrupted leaves no file.",
    "capture": "Take labelled images of a flight or a recipe; every frame's labels are verified as it is written.",
    "check": "Verify every label of a data set again, and re-render some images; exit 1 if one is wrong.",
    "convert": "Write a data set in another format; those with poses only get masks, keypoints and boxes from the model.",
    "overlay": "Draw labels over copies of a data set's images: the craft's axes, edges, keypoints, box, mask.",
    "estimate": "Estimate the pose of a target in images.",
    "evaluate": "Evaluate an estimator on every frame of a data set: metrics.json, frames.csv, index.html.",
    "train": "Train a network on a data set, or with --craft the keypoint network that hybrid uses for a craft.",
    "compare": "Compare reference images with simulated ones of similar views: histograms, edges, with and without atmosphere.",
    "bench": "Measure the frame cost per scene and that of a reference pass of the same run.",
    "doctor": "Report OpenGL, GPU and optional parts of this machine, and how to install the missing ones.",
    "cache": "List the data cached between runs (decoded maps, baked light, targets), or remove it.",
    "plugins": "List the sensors, formats, recipes, estimators, targets and bodies of installed packages (docs/plugins.md).",
    "scenarios": "List the built-in scenarios, or print one to start from; `flyaround recipes` lists the recipes.",
    "recipes": "List the built-in recipes, print one to start from, or write the poses that it samples.",
    "backgrounds": "Render the background library of a recipe, without the craft.",
    "cameras": "List the built-in cameras, or read one of any format, check it, and write it in another.",
    "demo": "Fly, capture and check 20 images, send 30 frames to a board process, and write a report page.",
    "targets": "List the targets, add a mesh as a target, export or render them.",
}
"""First paragraph of each command's help, for the page that lists them without importing anything."""

HIL_ABOUT = {
    "host": "Stream a flight to a board, or fly on its poses (--closed-loop).",
    "board": "Run the board agent on this machine: connect, estimate, answer.",
    "camera": "Serve a GigE camera on the network (GVCP and GVSP, for Aravis, GStreamer and other clients) until Ctrl-C.",
    "bundle": "Write one file that runs on a board with only Python 3.9, numpy and OpenCV 4.6.",
    "report": "Write a page with plots from a ledger: latency, jitter, drops by cause.",
    "audit": "Compare a ledger with the time codes in the images; exit 1 unless they agree in every frame.",
    "campaign": "Fly cases with their seeds unattended and judge them: requirement matrix, JUnit XML; exit 1 if one is not met.",
    "delay-map": "Map an approach's success over latency, jitter and loss of its poses: heat maps, CSV, half-success latencies.",
    "forecast": "Fly closed loops on noisy poses and measure the error of the predicted attitude over the horizon.",
    "key": "Write a new key for hil host --key and hil board --key.",
    "display": "Show a flight full screen to a real camera that views the monitor.",
    "display-calibrate": "Calibrate the screen from images of the patterns: pixel map between camera and screen, and brightness.",
    "display-match": "Identify the frame that each grabbed image shows by its time code; exit 1 if one has none.",
}
CONSOLE_NAMES = frozenset({"gui", "console", "ui"})
"""Words that people type for the operator console."""
HIL_HELP = """\
Hardware in the loop: a flight's pictures are sent to a board, which returns poses.

A closed loop that flies on these poses: hil host SCENARIO --closed-loop. Its prediction error: hil forecast.
Many runs against requirements: hil campaign. The delay map of an approach: hil delay-map.
A camera endpoint for machine-vision software: hil camera.
An emulated board, which needs no hardware: make board-qemu, in the source code (docs/hil_boards.md).
"""


class LazyCommand(TyperCommand):
    """Command whose module is imported when its arguments or its help are needed."""

    def __init__(self, name: str, home: str, help_text: str) -> None:
        super().__init__(name, help=escape(help_text))
        self._home = home

    def make_context(self, *call: Any, **options: Any) -> Any:  # noqa: ANN401 - click's own signature
        """Import the command and parse its arguments."""
        module, _, name = self._home.partition(":")
        thing = getattr(import_module(f"flyaround.cli.{module}"), name)
        if isinstance(thing, typer.Typer):
            return _with_finite_numbers(with_literal_help(get_group(thing))).make_context(*call, **options)
        group = typer.Typer(add_completion=False)
        group.command(self.name)(thing)
        return _with_finite_numbers(with_literal_help(get_command(group))).make_context(*call, **options)


def _with_finite_numbers(command: Any) -> Any:  # noqa: ANN401 - click's commands and groups
    """Return a command whose options refuse NaN and infinity, which pass typer's bounds."""
    for parameter in command.params:
        parameter.callback = parameter.callback or _refuse_not_finite
    for inner in getattr(command, "commands", {}).values():
        _with_finite_numbers(inner)
    return command


def _refuse_not_finite(_context: Any, parameter: Any, value: Any) -> Any:  # noqa: ANN401 - click's callback
    for number in value if isinstance(value, list | tuple) else (value,):
        if isinstance(number, float) and not math.isfinite(number):
            raise UserError(f"{parameter.opts[0]} {number} is invalid: give a finite number")
    return value


class Commands(TyperGroup):
    """Group of the commands listed in ``COMMANDS`` and ``HIL_COMMANDS``."""

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

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:  # noqa: ANN401 - click's own signature
        """Return the command of the arguments; one that people guess for the console names the right one."""
        if args[0] in CONSOLE_NAMES:
            raise UserError(f"there is no command '{args[0]}': flyaround sim opens the operator console")
        return super().resolve_command(ctx, args)


app = typer.Typer(
    name="flyaround",
    cls=Commands,
    help="Simulate the camera of a chaser near a spacecraft: images, ground truth, hardware in the loop.",
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
    """Handle the options that every command has."""
    level = (logging.WARNING, logging.INFO, logging.DEBUG)[min(verbose, 2)]
    handler = RichHandler(console=terminal(stderr=True), show_path=verbose > 1, rich_tracebacks=False)
    logging.basicConfig(level=level, format="%(name)s: %(message)s", handlers=[handler], force=True)
