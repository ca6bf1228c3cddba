"""Paths of the checkout that documents name exist; history (the lab, the list of moved names) may name former ones."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PATH = re.compile(r"`((?:assets|docs|examples|flyaround|gui|hil|shaders|simulator|tests|tools)/[\w./-]+)`")
PAGES = [
    page
    for page in (*sorted((ROOT / "docs").rglob("*.md")), ROOT / "README.md", ROOT / "CONTRIBUTING.md")
    if page.parent.name != "lab" and page.name != "migration.md"
]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_every_path_that_a_page_names_exists(page):
    named = set(PATH.findall(page.read_text())) - {"flyaround/NAME"}
    assert [path for path in sorted(named) if not (ROOT / path).exists()] == []
