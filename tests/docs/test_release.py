"""Agreement of version, changelog, citation and address."""

import re
import tomllib
from importlib.metadata import version
from pathlib import Path

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def test_version_stands_in_one_place_and_the_others_agree():
    assert version("flyaround") == PROJECT["version"]
    assert f"version: {PROJECT['version']}\n" in (ROOT / "CITATION.cff").read_text()
    assert re.search(
        rf"^## {re.escape(PROJECT['version'])} \(\d{{4}}-\d\d-\d\d\)$",
        (ROOT / "CHANGELOG.md").read_text(),
        re.MULTILINE,
    )


def test_the_address_is_the_same_everywhere():
    address = PROJECT["urls"]["Repository"]
    assert f'repository-code: "{address}"' in (ROOT / "CITATION.cff").read_text()
    assert f"repo_url: {address}\n" in (ROOT / "mkdocs.yml").read_text()


def test_the_readme_installs_from_the_checkout_until_there_is_a_release():
    first = (ROOT / "README.md").read_text().split("## Two commands")[0]
    assert "pip install '.[gui]'" in first
    assert "pip install 'flyaround" not in first
    assert "pip install 'flyaround[gui]'" in (ROOT / "docs" / "releasing.md").read_text()
