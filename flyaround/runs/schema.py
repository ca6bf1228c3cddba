"""The JSON Schema of run files."""

from __future__ import annotations

from typing import Any

import msgspec

from flyaround.runs.capture import CaptureRun
from flyaround.runs.document import Run, run_fields
from flyaround.runs.host import HostRun
from flyaround.runs.importing import ImportRun

RUNS: dict[str, type[Run]] = {
    "capture": CaptureRun,
    "hil host": HostRun,
    "targets add": ImportRun,
}
"""By command."""


def runs_schema() -> dict[str, Any]:
    """Return the JSON Schema of all runs, each chosen by its ``schema``; keys are described as in the help."""
    (schemas, definitions) = msgspec.json.schema_components(tuple(RUNS.values()))
    for kind in RUNS.values():
        for field in run_fields(kind):
            definitions[field.section.__name__]["properties"][field.name]["description"] = field.declared.help
    return {"anyOf": list(schemas), "$defs": definitions}
