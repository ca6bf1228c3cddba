"""Every command but those that open panels, which `flyaround.gui.layout` adds."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flyaround.gui.commands import (
    camera,
    capture,
    display,
    docking,
    estimator,
    guidance,
    hil,
    log,
    people,
    scenario,
    steering,
    time,
    timeline,
    views,
)

if TYPE_CHECKING:
    from flyaround.gui.command_table import Command

COMMANDS: tuple[Command, ...] = (
    *scenario.COMMANDS,
    *time.COMMANDS,
    *timeline.COMMANDS,
    *steering.COMMANDS,
    *guidance.COMMANDS,
    *docking.COMMANDS,
    *display.COMMANDS,
    *camera.COMMANDS,
    *views.COMMANDS,
    *estimator.COMMANDS,
    *hil.COMMANDS,
    *capture.COMMANDS,
    *people.COMMANDS,
    *log.COMMANDS,
)
