"""What the tests of windows share."""

from collections.abc import Iterator

import pytest


@pytest.fixture(scope="module")
def display() -> Iterator[str]:
    """Name of a virtual screen."""
    from tests.harness.screen import virtual_screen

    with virtual_screen() as name:
        yield name
