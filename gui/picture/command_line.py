"""Command lines that reproduce the present flight and view, and settings that they cannot express."""

from __future__ import annotations

import shlex
from typing import TYPE_CHECKING, NamedTuple

from flyaround.gui.picture.view_settings import OVERLAYS, Overlays

if TYPE_CHECKING:
    from flyaround.gui.picture.view_settings import Options
    from flyaround.simulator.piloting.session import FlightSession


class CommandLines(NamedTuple):
    """Equivalent command lines, each with its purpose.

    Parameters
    ----------
    lines : tuple of tuple of str
        Pairs of purpose and line.
    left_out : tuple of str
        Settings of the console that they cannot express.
    """

    lines: tuple[tuple[str, str], ...]
    left_out: tuple[str, ...]


def command_lines(session: FlightSession, options: Options, source: str, saved: str = "") -> CommandLines:
    """Return command lines of a flight and its view.

    Parameters
    ----------
    session : FlightSession
        The flight.
    options : Options
        The operator's settings.
    source : str
        Built-in name or file of the scenario; empty if it is in no file.
    saved : str, optional
        Truth record of a saved picture, if any.
    """
    settings = options.settings
    if not source:
        why = "this scenario was changed here and is in no file: save its text, open that, and the lines name it"
        return CommandLines(_of_saved(saved), (why,))
    seed = [] if session.plan.seed == session.plan.scenario.seed else ["--seed", str(session.plan.seed)]
    first = Overlays()
    over = [f for f in OVERLAYS if getattr(options.overlays, f) and not getattr(first, f)]
    sim = ["flyaround", "sim", source, *seed, *(["--overlays", ",".join(over)] if over else [])]
    lines = [("this console", shlex.join(sim))]
    left_out = []
    if session.craft.mode == "guidance":
        rgb = ["--rgb"] if settings.bands == "rgb" and session.plan.bands != "rgb" else []
        at = ["-t", repr(float(session.t_s))]
        render = ["flyaround", "render", source, *at, *seed, *rgb, "-o", "frame.png"]
        lines.append(("this picture", shlex.join(render)))
    else:
        left_out.append("the chaser is steered: save the picture (P), and draw it from its truth record")
    lines += _of_saved(saved)
    capture = ["flyaround", "capture", source, *seed, "-n", "40", "-o", "out/set"]
    lines.append(("a data set of this flight", shlex.join(capture)))
    if settings.exposure_stops or settings.sensor_changes or settings.camera or settings.lights:
        left_out.append("exposure, camera, sensor or lights were changed here: change the scenario's text")
    if settings.environment != session.scene().environment:
        left_out.append("layers of the world were switched here: change [environment] in the scenario's text")
    return CommandLines(tuple(lines), tuple(left_out))


def _of_saved(saved: str) -> tuple[tuple[str, str], ...]:
    line = shlex.join(["flyaround", "render", "--from-truth", saved])
    return (("the picture saved last", line),) if saved else ()
