"""The public types of plug-ins, and that each is the product's own."""

import sys

import pytest
from programs import completed

import flyaround.plugins as public
from flyaround.simulator.runtime.plugins import GROUPS


@pytest.mark.parametrize("name", public.__all__)
def test_each_public_name_is_there(name):
    assert getattr(public, name).__name__ == name
    assert name in dir(public)


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="Teapot"):
        _ = public.Teapot


def test_nothing_slow_is_imported_before_it_is_used():
    code = "import sys, flyaround.plugins as p; print(sorted({'cv2', 'scipy', 'moderngl', 'numpy'} & set(sys.modules)))"
    done = completed(sys.executable, "-c", code, check=True)
    assert done.stdout.strip() == "[]"


def test_the_page_names_each_group_and_type():
    from pathlib import Path

    page = (Path(__file__).parents[2] / "docs" / "plugins.md").read_text()
    for group in GROUPS.values():
        assert group in page
    assert "flyaround.plugins" in page
