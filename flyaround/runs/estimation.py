"""Options of ``flyaround estimate``, ``evaluate``, ``train`` and ``compare``."""

from __future__ import annotations

from typing import Annotated

import typer
from msgspec import Meta

from flyaround.hil.board.method_names import ALL_METHODS, HYBRID
from flyaround.hil.board.net.residual_network import ARCHITECTURES
from flyaround.hil.board.svd.settings import SOLVERS, STREAMS
from flyaround.runs.document import NOT_RECORDED, Run
from flyaround.runs.fields import AnySeed, Count, Device, File
from flyaround.simulator.runtime.sections import Section

Methods = ", ".join(ALL_METHODS)


class Published(Section, frozen=True, kw_only=True):
    """Options of the published methods, svd-2018 and svd-thesis."""

    solver: Annotated[
        str | None,
        typer.Option(
            help=f"Pose solver of svd-2018 and svd-thesis: {', '.join(SOLVERS)} (default: the method's own)."
        ),
    ] = None
    streams: Annotated[
        str | None,
        typer.Option(
            help=f"Feature streams of svd-2018 and svd-thesis, comma-separated: {', '.join(STREAMS)} (default: wge,sh)."
        ),
    ] = None


class EstimateRun(Run, frozen=True, kw_only=True, tag="flyaround.run.estimate"):
    """Options of ``flyaround estimate``: estimate the poses of a target in images."""

    images: Annotated[
        tuple[File, ...],
        typer.Argument(help="PNG images, 8 or 16 bits; colour is converted to grey."),
    ]
    target: Annotated[str, typer.Option(help="Target sought in the images.")] = "tango"
    camera: Annotated[str, typer.Option(help="CAMERA.json, or the name of a built-in camera.")] = "speed"
    method: Annotated[str, typer.Option(help=f"One of {Methods}.")] = HYBRID
    debug: Annotated[
        File | None,
        typer.Option(
            help="New or empty folder for debug pictures of every stage, with a subfolder for each image."
        ),
        NOT_RECORDED,
    ] = None
    published: Published = Published()


class EvaluateRun(Run, frozen=True, kw_only=True, tag="flyaround.run.evaluate"):
    """Options of ``flyaround evaluate``: compare the estimates of every frame of a data set with its truth."""

    folder: Annotated[File, typer.Argument(help="Data set written by capture.")]
    output: Annotated[
        File, typer.Option("--output", "-o", help="New or empty folder for the report."), NOT_RECORDED
    ] = "report"
    methods: Annotated[
        tuple[str, ...],
        typer.Option("--method", help=f"One of {Methods} (default hybrid); repeatable, to compare methods."),
    ] = ()
    model: Annotated[
        File | None,
        typer.Option(help="Board model file for the estimator, instead of the target's own."),
    ] = None
    workers: Annotated[
        Count,
        typer.Option(help="Number of processes; with one, measured times are undisturbed."),
        NOT_RECORDED,
    ] = 1
    resume: Annotated[bool, typer.Option("--resume", help="Resume an interrupted run."), NOT_RECORDED] = False
    published: Published = Published()


class TrainRun(Run, frozen=True, kw_only=True, tag="flyaround.run.train"):
    """Options of ``flyaround train``: train a network on a data set, or the keypoint network of a craft."""

    folder: Annotated[File | None, typer.Argument(help="Data set written by capture.")] = None
    craft: Annotated[
        str | None,
        typer.Option(
            help="Target whose keypoint network, for the method hybrid, is trained on views rendered here."
        ),
    ] = None
    output: Annotated[
        File | None,
        typer.Option(
            "--output",
            "-o",
            help="Output file, NAME.npz (default for a craft: in the user's folder of targets).",
        ),
        NOT_RECORDED,
    ] = None
    minutes: Annotated[
        Annotated[float, Meta(ge=0.01, le=100_000)],
        typer.Option(help="Minutes of training, excluding the rendering of views."),
    ] = 6.0
    views: Annotated[
        Annotated[int, Meta(ge=25)],
        typer.Option("-n", "--views", help="Number of views of a craft to render."),
    ] = 2000
    calibrate: Annotated[
        Annotated[int, Meta(ge=0, le=10_000)],
        typer.Option(
            help="Number of further frames of a craft, on which confidence and covariance are calibrated."
        ),
    ] = 160
    steps: Annotated[
        Count | None,
        typer.Option(help="Training steps instead of minutes, for a reproducible result."),
    ] = None
    network: Annotated[str, typer.Option(help=f"Size of the network: {' or '.join(ARCHITECTURES)}.")] = (
        "small"
    )
    width: Annotated[
        Annotated[int, Meta(ge=32, le=1024)], typer.Option(help="Width of the network's input [px].")
    ] = 160
    classes: Annotated[
        Annotated[int, Meta(ge=64, le=20_000)], typer.Option(help="Number of attitude classes.")
    ] = 1024
    seed: Annotated[AnySeed, typer.Option(help="Seed of initial weights and samples.")] = 0
    device: Annotated[str, typer.Option(help="cpu, or cuda with an NVIDIA card.")] = "cpu"
    threads: Annotated[
        Annotated[int, Meta(ge=1, le=256)], typer.Option(help="Number of processor threads.")
    ] = 1


class CompareRun(Run, frozen=True, kw_only=True, tag="flyaround.run.compare"):
    """Options of ``flyaround compare``: show images from elsewhere next to simulated ones of similar views."""

    reference: Annotated[File, typer.Option(help="Folder of reference pictures, which are not changed.")]
    output: Annotated[
        File, typer.Option("--output", "-o", help="New or empty folder for the page."), NOT_RECORDED
    ] = "comparison"
    n: Annotated[
        Count, typer.Option("-n", help="Largest number of pictures, evenly spread over the folder.")
    ] = 16
    target: Annotated[str, typer.Option(help="Target in the pictures.")] = "tango"
    camera: Annotated[str, typer.Option(help="Camera of the pictures, scaled to each one: name or file.")] = (
        "speed"
    )
    labels: Annotated[
        File | None,
        typer.Option(
            help="Poses of the pictures in SPEED's format (train.json); by default they are estimated."
        ),
    ] = None
    sensor: Annotated[
        str | None,
        typer.Option(
            help="Sensor preset of the simulated pictures (default: the noise of each reference picture)."
        ),
    ] = None
    gpu: Annotated[Device | None, typer.Option(help="EGL device to render on."), NOT_RECORDED] = None
