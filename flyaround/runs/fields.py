"""Field types shared by runs: bounded numbers, files, and options with their help texts."""

from __future__ import annotations

from typing import Annotated, get_args

import typer
from msgspec import Meta

from flyaround.runs.document import NOT_RECORDED, PATH
from flyaround.simulator.camera.encoding import Encoding
from flyaround.simulator.labels.request import LAYERS
from flyaround.simulator.scene.environments import ENVIRONMENTS
from flyaround.simulator.scene.state import Quality

File = Annotated[str, Meta(extra={PATH: True})]
Count = Annotated[int, Meta(ge=1)]
AnySeed = Annotated[int, Meta(ge=0)]
Device = Annotated[int, Meta(ge=0)]
Duration = Annotated[float, Meta(ge=0)]

ScenarioArgument = Annotated[str, typer.Argument(help="Built-in name or TOML file.")]
Seed = Annotated[AnySeed | None, typer.Option(help="Seed of every random choice (default: the scenario's).")]
FlightSeed = Annotated[AnySeed | None, typer.Option(help="Seed (default: the scenario's).")]
Labels = Annotated[
    str | None,
    typer.Option(help=f"Label layers besides truth and mask: all, none, or any of {', '.join(LAYERS)}."),
]
EnvironmentOption = Annotated[
    str | None,
    typer.Option(help=f"Preset of the environment instead of the scenario's: {', '.join(ENVIRONMENTS)}."),
]
EncodingOption = Annotated[
    Encoding | None,
    typer.Option(
        help=f"Transfer function of the image: {', '.join(get_args(Encoding))} (default: the scenario's; srgb for 8-bit"
        " colour)."
    ),
]
AutoExposureOption = Annotated[
    bool,
    typer.Option(
        "--auto-exposure",
        help="Use automatic exposure even if the scenario does not.",
    ),
]
QualityOption = Annotated[Quality | None, typer.Option(help=f"{', '.join(get_args(Quality))}.")]
Gpu = Annotated[
    Device | None, typer.Option(help="EGL device to render on (default: the driver's choice)."), NOT_RECORDED
]
