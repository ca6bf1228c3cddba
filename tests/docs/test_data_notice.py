"""``assets/NOTICE.md`` says of every file of data where it comes from."""

import tomllib
from fnmatch import fnmatch
from pathlib import Path

ROOT = Path(__file__).parents[2]
ASSETS = ROOT / "assets"
OWN = ("scenarios", "recipes", "cameras", "__pycache__")
"""Folders of assets that Flyaround's authors wrote."""
ROWS = [
    [cell.strip() for cell in line.split("|")[1:4]]
    for line in (ASSETS / "NOTICE.md").read_text().splitlines()
    if line.startswith("| ")
][1:]


def data_files():
    paths = (path.relative_to(ASSETS) for path in ASSETS.rglob("*") if path.is_file())
    return [str(path) for path in paths if len(path.parts) > 1 and path.parts[0] not in OWN]


def test_every_file_of_data_has_a_row():
    assert [file for file in data_files() if not any(fnmatch(file, row[0]) for row in ROWS)] == []


def test_every_row_has_a_file_an_origin_and_terms():
    for pattern, what, origin in ROWS:
        assert any(fnmatch(file, pattern) for file in data_files()), pattern
        assert what
        assert origin
        assert "GPL" not in origin, pattern


def test_the_notice_goes_with_the_licence_and_the_licence_names_its_data():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert project["license-files"] == ["LICENSE", "assets/NOTICE.md"]
    assert f"`{project['license']}`" in (ASSETS / "NOTICE.md").read_text()
