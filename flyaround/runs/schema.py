"""JSON Schema of run files."""

from __future__ import annotations

from typing import Any

import msgspec

from flyaround.runs.bench import BenchRun
from flyaround.runs.board import BoardRun
from flyaround.runs.camera import CameraRun
from flyaround.runs.campaign import CampaignRun, DelayMapRun
from flyaround.runs.capture import CaptureRun
from flyaround.runs.console import ConsoleRun
from flyaround.runs.conversion import ConvertRun
from flyaround.runs.document import Run, run_fields
from flyaround.runs.estimation import CompareRun, EstimateRun, EvaluateRun, TrainRun
from flyaround.runs.flights import FilmRun, FlyRun
from flyaround.runs.host import HostRun
from flyaround.runs.importing import ImportRun
from flyaround.runs.pictures import RenderRun

RUNS: dict[str, type[Run]] = {
    "sim": ConsoleRun,
    "render": RenderRun,
    "fly": FlyRun,
    "film": FilmRun,
    "capture": CaptureRun,
    "convert": ConvertRun,
    "estimate": EstimateRun,
    "evaluate": EvaluateRun,
    "train": TrainRun,
    "compare": CompareRun,
    "bench": BenchRun,
    "hil host": HostRun,
    "hil board": BoardRun,
    "hil camera": CameraRun,
    "hil campaign": CampaignRun,
    "hil delay-map": DelayMapRun,
    "targets add": ImportRun,
}
"""Run types by command."""


def runs_schema() -> dict[str, Any]:
    """Return the JSON Schema of all runs, selected by ``schema``, with the help texts as descriptions."""
    (schemas, definitions) = msgspec.json.schema_components(tuple(RUNS.values()))
    for kind in RUNS.values():
        for field in run_fields(kind):
            definitions[field.section.__name__]["properties"][field.name]["description"] = field.declared.help
    return {"anyOf": list(schemas), "$defs": definitions}
