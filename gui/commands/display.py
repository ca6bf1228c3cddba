"""Commands of the display: overlays, exposure, layers of the world, the window."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from flyaround.gui.command_table import command, number, setting, switch, word
from flyaround.gui.picture.light_settings import lit
from flyaround.gui.picture.view_settings import DETAILS, LAYERS, OVERLAYS
from flyaround.gui.texts import texts
from flyaround.simulator.imaging.auto_exposure import AutoExposure
from flyaround.simulator.imaging.metering import metered_exposure_s

if TYPE_CHECKING:
    from flyaround.gui.console import Console

OVERLAY_KEYS = texts("overlay-keys")
MOST_STOPS = 8.0  # largest change of the exposure [powers of two]


def _layer(name: str, console: Console, state: bool) -> None:  # noqa: FBT001 - a switch
    settings = console.options.settings
    settings.environment = msgspec.structs.replace(settings.environment, **{name: state})


def _layer_is_on(name: str, console: Console) -> bool:
    return bool(getattr(console.options.settings.environment, name))


def _meter(console: Console) -> None:
    """Set the exposure to the meter's for the present scene."""
    session, settings = console.session, console.options.settings
    scene = lit(session.scene(), settings.lights)
    wanted_s = metered_exposure_s(AutoExposure(), scene, session.plan.target)
    stops = float(np.log2(wanted_s / scene.exposure_s))
    settings.exposure_stops = round(min(max(stops, -MOST_STOPS), MOST_STOPS), 2)


def _detail(console: Console, detail: str) -> None:
    console.options.settings.detail = next(d for d in DETAILS if d == detail)


def _colour(console: Console, state: bool) -> None:  # noqa: FBT001 - a switch
    console.options.settings.bands = "rgb" if state else "mono"


def _quit(console: Console) -> None:
    # a second time is the answer
    if console.shown.get("quit") or not console.losses:
        console.do("window.close")
    else:
        console.open_panel("quit", shown=True)


def _request(name: str, console: Console) -> None:
    setattr(console.window, name, True)


STOPS = number("stops", "1 exposes twice as long, -1 half as long", -MOST_STOPS, MOST_STOPS, "powers of two")

COMMANDS = (
    *(
        setting(
            f"overlay.{name}",
            lambda console: console.options.overlays,
            name,
            *filter(None, [OVERLAY_KEYS.get(name)]),
            title=title,
            text=f"draw over the view: {title.lower()}",
        )
        for name, title in OVERLAYS.items()
    ),
    command("picture.save", lambda console: console.feed.ask_to_save(), "p", "f12"),
    command("picture.exposure", lambda c, stops: setattr(c.options.settings, "exposure_stops", stops), STOPS),
    command("picture.meter", _meter),
    command("picture.detail", _detail, word("detail", "how fine", DETAILS)),
    switch("picture.colour", _colour, lambda console: bool(console.options.settings.bands == "rgb")),
    setting("picture.noise", lambda console: console.options.settings, "noise"),
    *(
        switch(
            f"world.{name.replace('_', '-')}",
            partial(_layer, name),
            partial(_layer_is_on, name),
            title=title,
            text=f"draw or leave out: {title.lower()}",
        )
        for name, title in LAYERS.items()
    ),
    setting("window.panels", lambda console: console.options, "panel", "tab"),
    command("window.full-screen", partial(_request, "full_screen"), "f11"),
    command("window.acknowledge", lambda console: console.messages.acknowledge(), "f9"),
    command("window.quit", _quit, "ctrl+q"),
    command("window.close", partial(_request, "close")),
)
