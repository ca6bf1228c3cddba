"""JSON Schemas of every file format, by name; `python -m flyaround.schemas DIR` writes them."""

from __future__ import annotations

import inspect
import json
import re
import sys
from pathlib import Path
from typing import Any

import msgspec

from flyaround.hil.board_model.records import BoardModelRecord
from flyaround.hil.campaign.campaign import CampaignOutcome
from flyaround.hil.campaign.definitions import Campaign
from flyaround.hil.campaign.map_results import DelayMapOutcome
from flyaround.hil.evaluate.metrics import Metrics
from flyaround.hil.host.ledger.run_terms import RunTerms
from flyaround.hil.host.ledger.summary import LedgerSummary
from flyaround.runs.schema import runs_schema
from flyaround.simulator.dataset.card import DatasetCard
from flyaround.simulator.labels.imported import ImportedTruth
from flyaround.simulator.labels.truth import Truth
from flyaround.simulator.runtime.files import write_atomic
from flyaround.simulator.scenario.recipe import Recipe
from flyaround.simulator.scenario.scenario import Scenario
from flyaround.simulator.scenario.vary import Vary
from flyaround.simulator.targets.records import TargetRecord

DIALECT = "https://json-schema.org/draft/2020-12/schema"

# Heading of a numpydoc section, and an entry of one: names, then an indented description.
_SECTION = re.compile(r"\n+([A-Z]\w+)\n-{3,}\n")
_FIELD = re.compile(r"^(\w[\w, ]*) : .*((?:\n[ \n].*|\n)+)", re.MULTILINE)


def all_schemas() -> dict[str, dict[str, Any]]:
    """Return the schema documents by format name."""
    schemas = {
        "scenario": msgspec.json.schema(Scenario),
        "recipe": msgspec.json.schema(Recipe),
        "vary": msgspec.json.schema(Vary),
        "runs": runs_schema(),
        "target": msgspec.json.schema(TargetRecord),
        "board_model": msgspec.json.schema(BoardModelRecord),
        "truth": msgspec.json.schema(Truth),
        "imported": msgspec.json.schema(ImportedTruth),
        "dataset": msgspec.json.schema(DatasetCard),
        "run": msgspec.json.schema(RunTerms),
        "ledger_summary": msgspec.json.schema(LedgerSummary),
        "metrics": msgspec.json.schema(Metrics),
        "campaign": msgspec.json.schema(Campaign),
        "campaign_outcome": msgspec.json.schema(CampaignOutcome),
        "delay_map": msgspec.json.schema(DelayMapOutcome),
    }
    return {
        name: {"$schema": DIALECT, "title": f"flyaround {name}", **_described(schema)}
        for name, schema in schemas.items()
    }


def _described(value: Any) -> Any:  # noqa: ANN401 - any JSON
    """Return a document with docstrings as plain sentences: those on a field become the description of its property."""
    if isinstance(value, list):
        return [_described(v) for v in value]
    if not isinstance(value, dict):
        return value
    out = {key: _described(v) for key, v in value.items()}
    if isinstance(value.get("description"), str):
        text, *sections = _SECTION.split(inspect.cleandoc(value["description"]))
        out["description"] = _sentences(text)
        for title, body in zip(sections[::2], sections[1::2], strict=True):
            if title in {"Parameters", "Attributes"}:
                for names, field in _FIELD.findall(body):
                    for name in names.split(", "):
                        if name in out.get("properties", {}):
                            out["properties"][name]["description"] = _sentences(inspect.cleandoc(field))
    return out


def _sentences(text: str) -> str:
    """Return prose without the marks and line breaks of reStructuredText, except between paragraphs."""
    return re.sub(r"(?<!\n)\n(?!\n)", " ", text.strip().replace("``", "").replace("`", ""))


def write_schemas(folder: Path) -> None:
    """Write ``NAME.schema.json`` for every format."""
    for name, schema in all_schemas().items():
        write_atomic(folder / f"{name}.schema.json", (json.dumps(schema, indent=1) + "\n").encode())


if __name__ == "__main__":
    write_schemas(Path(sys.argv[1]))
