"""Commands of the estimator beside the flight."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flyaround.gui.command_table import command, switch, word

if TYPE_CHECKING:
    from flyaround.gui.console import Console


def _show_stage(console: Console, stage: str) -> None:
    console.jobs.estimates.stage = stage
    console.open_panel("stage", shown=True)


METHOD = word("method", "hybrid, svd-2018, svd-thesis, hybrid-track, net:FILE or a package's")
STAGE = word("stage", "key of its picture, such as gradient or lsd_stream")

COMMANDS = (
    switch(
        "estimator.run",
        lambda console, on: console.jobs.estimates.start() if on else console.jobs.estimates.stop(),
        lambda console: console.jobs.estimates.on,
    ),
    command("estimator.method", lambda console, method: console.jobs.estimates.choose(method), METHOD),
    switch(
        "estimator.stages",
        lambda console, on: console.jobs.estimates.send_stages(on=on),
        lambda console: console.jobs.estimates.with_stages,
    ),
    command("estimator.stage", _show_stage, STAGE),
    command("estimator.forget", lambda console: console.jobs.estimates.forget()),
)
