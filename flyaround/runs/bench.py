"""Options of ``flyaround bench``."""

from __future__ import annotations

from typing import Annotated

import typer
from msgspec import Meta

from flyaround.runs.document import NOT_RECORDED, Run
from flyaround.runs.fields import Device


class BenchRun(Run, frozen=True, kw_only=True, tag="flyaround.run.bench"):
    """Options of ``flyaround bench``: measure the cost of a frame in each scene, and of the other parts."""

    frames: Annotated[Annotated[int, Meta(ge=3)], typer.Option("-n", help="Frames timed per scene.")] = 20
    scene: Annotated[tuple[str, ...], typer.Option(help="Only these scenes (repeat the option).")] = ()
    gpu: Annotated[Device | None, typer.Option(help="EGL device to render on."), NOT_RECORDED] = None
