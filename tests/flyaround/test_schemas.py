"""Shipped JSON Schemas are the ones the code has, and are valid schemas."""

import json
from pathlib import Path

import jsonschema
import pytest

from flyaround.schemas import all_schemas

FORMATS = Path(__file__).parents[2] / "docs" / "formats"


@pytest.mark.parametrize("name", sorted(all_schemas()))
def test_schema_is_shipped_and_current(name):
    schema = all_schemas()[name]
    jsonschema.Draft202012Validator.check_schema(schema)
    shipped = json.loads((FORMATS / f"{name}.schema.json").read_text())
    assert shipped == json.loads(json.dumps(schema)), "run make schemas"


def test_every_shipped_schema_belongs_to_a_format():
    assert {p.name.removesuffix(".schema.json") for p in FORMATS.glob("*.schema.json")} == set(all_schemas())
