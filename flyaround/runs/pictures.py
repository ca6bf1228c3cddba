"""Options of ``flyaround render``."""

from __future__ import annotations

from typing import Annotated, ClassVar

import typer

from flyaround.runs.document import NOT_RECORDED, Only, Run
from flyaround.runs.fields import (
    AutoExposureOption,
    EncodingOption,
    EnvironmentOption,
    File,
    Gpu,
    Labels,
    QualityOption,
    Seed,
)


class RenderRun(Run, frozen=True, kw_only=True, tag="flyaround.run.render"):
    """Options of ``flyaround render``: draw an image and its truth, or one for each pose of a list."""

    RULES: ClassVar = (
        Only(
            "environment",
            "from_truth",
            (None,),
            "--from-truth uses the record's environment: leave out --environment",
        ),
        Only(
            "encoding",
            "from_truth",
            (None,),
            "--from-truth uses the recorded encoding: leave out --encoding",
        ),
        Only(
            "auto_exposure",
            "from_truth",
            (None,),
            "--from-truth uses the recorded exposure: leave out --auto-exposure",
        ),
        Only(
            "poses",
            "from_truth",
            (None,),
            "--poses needs a SCENARIO for camera and light: leave out --from-truth",
        ),
        Only("timings", "poses", (None,), "--timings applies to one picture: leave out --poses"),
    )
    scenario: Annotated[str | None, typer.Argument(help="Built-in name or TOML file.")] = None
    output: Annotated[
        File,
        typer.Option(
            "--output",
            "-o",
            help=".png image, .npy raw numbers, .exr radiance; the truth is written to .json next to it. "
            "Existing files are replaced. With --poses also a folder, which is created if necessary.",
        ),
        NOT_RECORDED,
    ] = "frame.png"
    time_s: Annotated[float, typer.Option("--time", "-t", help="Mid-exposure, seconds from the start.")] = 0.0
    from_truth: Annotated[
        File | None, typer.Option(help="Render the frame of a truth record again, byte for byte.")
    ] = None
    poses: Annotated[
        File | None,
        typer.Option(
            help="CSV with q_w,q_x,q_y,q_z,t_x_m,t_y_m,t_z_m (target in camera): render the scenario with each."
        ),
    ] = None
    rgb: Annotated[bool, typer.Option("--rgb", help="Colour image instead of the scenario's bands.")] = False
    encoding: EncodingOption = None
    auto_exposure: AutoExposureOption = False
    quality: QualityOption = None
    environment: EnvironmentOption = None
    labels: Labels = None
    seed: Seed = None
    gpu: Gpu = None
    timings: Annotated[
        bool,
        typer.Option("--timings", help="Render it five more times and print the time of each pass."),
        NOT_RECORDED,
    ] = False
