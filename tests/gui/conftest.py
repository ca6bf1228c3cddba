"""Fixtures of the console's tests: a virtual screen, and Dear ImGui without a window."""

from collections.abc import Iterator

import pytest

from tests.harness.headless_imgui import HeadlessWindow


@pytest.fixture(scope="module")
def display() -> Iterator[str]:
    """Name of a virtual screen."""
    from tests.harness.screen import virtual_screen

    with virtual_screen() as name:
        yield name


@pytest.fixture
def window() -> Iterator[HeadlessWindow]:
    """A window in which panels are laid out, but not drawn."""
    made = HeadlessWindow()
    yield made
    made.close()
