"""Options of ``flyaround capture``."""

from __future__ import annotations

from typing import Annotated, ClassVar

import typer
from msgspec import Meta

from flyaround.runs.document import NOT_RECORDED, Only, Run
from flyaround.runs.fields import (
    AutoExposureOption,
    Count,
    EncodingOption,
    EnvironmentOption,
    File,
    Gpu,
    Labels,
    QualityOption,
    Seed,
)
from flyaround.simulator.dataset.formats.registry import writable
from flyaround.simulator.runtime.sections import Section


class CapturedPictures(Section, frozen=True, kw_only=True):
    """The images to take."""

    n: Annotated[
        Count | None,
        typer.Option(
            "-n", help="Frames: evenly in time (default 20), or samples of a recipe (default its own)."
        ),
    ] = None
    every_s: Annotated[
        float | None, typer.Option("--every", help="Seconds between frames, instead of -n.")
    ] = None
    rgb: Annotated[bool, typer.Option("--rgb", help="Colour images instead of the scenario's bands.")] = False
    encoding: EncodingOption = None
    auto_exposure: AutoExposureOption = False
    quality: QualityOption = None
    environment: EnvironmentOption = None
    camera: Annotated[
        str | None, typer.Option(help="Built-in camera or file, instead of the scenario's own.")
    ] = None
    target: Annotated[str | None, typer.Option(help="Target instead of the scenario's or recipe's own.")] = (
        None
    )
    vary: Annotated[
        File | None,
        typer.Option(help="TOML file of ranges from which each frame's craft, light and image are varied."),
    ] = None
    seed: Seed = None


class DataSet(Section, frozen=True, kw_only=True):
    """The files to write for each image."""

    formats: Annotated[
        str,
        typer.Option(
            "--format",
            help=f"In addition to the native layout: {', '.join(writable()[1:])}; separated by commas.",
        ),
    ] = "native"
    split: Annotated[
        str | None,
        typer.Option(
            help="Shares of training, validation and test frames, such as 8:1:1, equal at all ranges "
            "(default: a recipe's own).",
        ),
    ] = None
    labels: Labels = None
    sensors: Annotated[
        str, typer.Option(help="Sensors of plug-in packages, separated by commas (docs/plugins.md).")
    ] = ""


class Drawing(Section, frozen=True, kw_only=True):
    """Render processes, which do not affect the bytes of the result."""

    workers: Annotated[
        Annotated[int, Meta(ge=1, le=64)], typer.Option(help="Render processes; same bytes."), NOT_RECORDED
    ] = 1
    ray: Annotated[
        str | None,
        typer.Option(help="Render on a Ray cluster instead: auto, HOST:PORT or ray://HOST:PORT; same bytes."),
        NOT_RECORDED,
    ] = None
    gpu_share: Annotated[
        Annotated[float, Meta(ge=0, le=1)],
        typer.Option(help="Share of a GPU for each of Ray's render processes."),
        NOT_RECORDED,
    ] = 0.0
    gpu: Gpu = None


class CaptureRun(Run, frozen=True, kw_only=True, tag="flyaround.run.capture"):
    """Options of ``flyaround capture``: write a labelled data set of a flight or a recipe."""

    RULES: ClassVar = (
        Only(
            "pictures.n", "pictures.every_s", (None,), "capture takes -n or --every, not both: leave one out"
        ),
        Only(
            "drawing.gpu_share",
            "drawing.ray",
            None,
            "--gpu-share is for a Ray cluster's processes: add --ray, or choose a GPU with --gpu",
        ),
        Only(
            "drawing.workers",
            "drawing.ray",
            (None,),
            "--workers renders here and --ray on a cluster: leave one out",
        ),
    )
    scenario: Annotated[str, typer.Argument(help="Built-in scenario or recipe, or a TOML file.")]
    output: Annotated[
        str,
        typer.Option(
            "--output",
            "-o",
            help="Folder of the data set, new or empty; or a URL of fsspec: s3://bucket/set.",
        ),
        NOT_RECORDED,
    ]
    resume: Annotated[
        bool,
        typer.Option(
            "--resume",
            help="Resume a data set: verify existing frames, and render damaged and missing ones, up to a larger -n.",
        ),
        NOT_RECORDED,
    ] = False
    pictures: CapturedPictures = CapturedPictures()
    data_set: DataSet = DataSet()
    drawing: Drawing = Drawing()
