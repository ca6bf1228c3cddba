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


def descriptions(document):
    if isinstance(document, list):
        for value in document:
            yield from descriptions(value)
    elif isinstance(document, dict):
        if isinstance(document.get("description"), str):
            yield document["description"]
        for value in document.values():
            yield from descriptions(value)


@pytest.mark.parametrize("name", sorted(all_schemas()))
def test_a_description_is_plain_sentences(name):
    for text in descriptions(all_schemas()[name]):
        assert not any(mark in text for mark in ("----", "`", "  ")), text
        assert all("\n" not in paragraph for paragraph in text.split("\n\n"))


def test_each_field_of_faces_and_outlines_is_described():
    records = all_schemas()["board_model"]["$defs"]
    for record in (records["FacesRecord"], records["OutlinesRecord"]):
        assert all(field["description"] for field in record["properties"].values())
    said = {name: field["description"] for name, field in records["FacesRecord"]["properties"].items()}
    assert "counter-clockwise" in said["corners"]
    assert "n.x = d" in said["plane"]
    assert "n.x > d" in said["children"]
