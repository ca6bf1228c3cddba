"""Fixtures shared by all tests: one renderer per session, small plans."""

import pytest


@pytest.fixture(scope="session")
def renderer():
    """One GL context for all tests that draw."""
    from simulator.render.renderer import Renderer

    with Renderer() as shared:
        yield shared
