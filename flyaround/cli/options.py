"""Options that commands about pictures share, each with its help."""

from __future__ import annotations

from typing import Annotated

import typer

from flyaround.simulator.errors import UserError
from flyaround.simulator.labels.request import LAYERS
from flyaround.simulator.scene.environments import ENVIRONMENTS
from flyaround.simulator.scene.state import Quality

Seed = Annotated[
    int | None, typer.Option("--seed", min=0, help="Seed of every random choice (default: the scenario's).")
]
Labels = Annotated[
    str | None,
    typer.Option(
        "--labels", help=f"Label layers beyond truth and mask: all, none, or of {', '.join(LAYERS)}."
    ),
]
World = Annotated[
    str | None,
    typer.Option(
        "--environment",
        help=f"Layers of the world instead of the scenario's: {', '.join(ENVIRONMENTS)}.",
    ),
]
Device = Annotated[
    int | None, typer.Option("--gpu", help="EGL device to draw on (default: the driver's choice).")
]


def quality_preset(name: str | None) -> Quality | None:
    """The preset of ``--quality``.

    Raises
    ------
    UserError
        If there is no such preset.
    """
    match name:
        case None | "draft" | "default" | "high":
            return name
        case _:
            raise UserError(f"unknown quality '{name}' in --quality; choose from draft, default, high")
