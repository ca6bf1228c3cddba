"""Fixtures shared by all tests: one renderer at a time, small plans."""

import os
from types import SimpleNamespace

import hypothesis
import pytest

from flyaround.simulator.runtime.threads import share_processors

MOST_PROGRAMS = 120
"""A driver keeps three megabytes for each until its context goes: the suite's four hundred were over a gigabyte."""


# how long an example takes is a matter of the machine and of what else it does
hypothesis.settings.register_profile("any machine", deadline=None)
hypothesis.settings.load_profile("any machine")


def pytest_configure():
    """Let workers that draw at once (pytest-xdist) share the processors, and one large cache."""
    # the tests draw every craft: under the size that users have they would bake each anew
    os.environ.setdefault("FLYAROUND_CACHE_MB", "20000")
    share_processors(int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1")))


@pytest.fixture(scope="session")
def renderers():
    """The renderer that tests share, in a list: another takes its place when it has drawn in too many ways."""
    shared = []
    yield shared
    for one in shared:
        one.close()


@pytest.fixture(scope="module")
def renderer(renderers, request):
    """One GL context for all tests of a file that draw, and for those of the files after it.

    A file of tests of what is left out or interpolated says SOFTWARE_PATH = True: with a GPU nothing is.
    """
    from flyaround.simulator.render.renderer import Renderer

    software_path = getattr(request.module, "SOFTWARE_PATH", None)
    if renderers:
        wanted = renderers[0].info.is_software if software_path is None else software_path
        if renderers[0].uses_software_path != wanted or len(renderers[0].device.programs) > MOST_PROGRAMS:
            renderers.pop().close()
    if not renderers:
        renderers.append(Renderer(software_path=software_path))
    return renderers[0]


@pytest.fixture(autouse=True)
def shared_context(request):
    """The shared renderer's context is current: an earlier test may have made a renderer of its own."""
    if "renderer" in request.fixturenames:
        request.getfixturevalue("renderer").make_current()


@pytest.fixture(autouse=True)
def no_targets_of_the_user(tmp_path_factory, monkeypatch):
    """Tests neither see nor touch targets that whoever runs them has added."""
    monkeypatch.setenv("FLYAROUND_DATA_DIR", str(tmp_path_factory.mktemp("data")))


@pytest.fixture
def coarse_proposals(monkeypatch):
    """Propose labels of imported meshes from small pictures: large ones take most of an import's time."""
    from flyaround.simulator.targets.importing.propose import edge_contrast

    monkeypatch.setattr(edge_contrast, "SIZE_PX", 96)
    monkeypatch.setattr(edge_contrast, "POINTS", 40_000)


@pytest.fixture(scope="session")
def draw_kit():
    """Builders of scenes and targets, for tests that draw."""
    import scene_kit

    return SimpleNamespace(
        scene=scene_kit.build_scene,
        target=scene_kit.build_target,
        plate=scene_kit.plate,
        quad=scene_kit.quad,
        white=scene_kit.white,
        camera=scene_kit.CAMERA,
        lens_camera=scene_kit.LENS_CAMERA,
        nothing=scene_kit.NOTHING,
    )
