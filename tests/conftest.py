"""Fixtures shared by all tests: one renderer per session, small plans."""

import pytest


@pytest.fixture(scope="session")
def renderer():
    """One GL context for all tests that draw."""
    from simulator.render.renderer import Renderer

    with Renderer() as shared:
        yield shared


@pytest.fixture(autouse=True)
def shared_context(request):
    """The shared renderer's context is current: an earlier test may have made a renderer of its own."""
    if "renderer" in request.fixturenames:
        request.getfixturevalue("renderer").make_current()


@pytest.fixture(autouse=True)
def no_targets_of_the_user(tmp_path_factory, monkeypatch):
    """Tests neither see nor touch targets that whoever runs them has added."""
    monkeypatch.setenv("FLYAROUND_DATA_DIR", str(tmp_path_factory.mktemp("data")))
