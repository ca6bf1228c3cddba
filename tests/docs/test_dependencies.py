"""The page of dependencies names what `pyproject.toml` does."""

import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "reference" / "dependencies.md").read_text()
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
OURS = {"formats-test", "scale-test", "console-test", "dev"}
"""Extras of those who change Flyaround; the page is for those who use it."""


def names(requirements):
    return {re.split(r"[<>=;\[ ]", one)[0] for one in requirements}


def rows(part):
    table = PAGE.split(f"## {part}")[1].split("##")[0]
    return [line.split("|")[1:] for line in table.splitlines() if line.startswith("| ")][1:]


def test_each_dependency_has_its_row():
    listed = {name for row in rows("Installed always") for name in row[0].replace(" ", "").split(",")}
    assert listed == names(PROJECT["dependencies"])


def test_each_extra_has_its_row():
    listed = {row[0].strip(" `"): {one.strip() for one in row[1].split(",")} for row in rows("Extras")}
    wanted = {k: names(v) for k, v in PROJECT["optional-dependencies"].items() if k not in OURS}
    assert listed == wanted
