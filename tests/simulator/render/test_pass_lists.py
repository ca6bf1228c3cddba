"""The lists of passes: complete on both paths, and each pass of the target's is needed."""

from unittest.mock import MagicMock

import pytest

from flyaround.simulator.render.craft.placement import TARGET
from flyaround.simulator.render.frame_graph import FrameGraph, FrameGraphError
from flyaround.simulator.render.frame_passes import plain_passes
from flyaround.simulator.render.software.software_path import software_passes
from flyaround.simulator.render.view import GIVEN_IRRADIANCE, MODEL, SCENE

GIVEN = (SCENE, MODEL, GIVEN_IRRADIANCE)


def _made(path):
    """Return the passes of a path without a driver: none of them is run."""
    return path(MagicMock(), MagicMock())


def _names(passes):
    return [one.name for one in passes]


@pytest.mark.parametrize("path", [plain_passes, software_passes])
@pytest.mark.parametrize(("target", "first"), [(True, False), (True, True), (False, False), (False, True)])
def test_every_pass_reads_what_is_given_or_written_before(path, target, first):
    given = GIVEN if target else (*GIVEN, TARGET)
    names = _names(FrameGraph(_made(path).frame(target=target, first=first), given))
    assert len(set(names)) == len(names)
    assert names[0] == "setup"
    assert names[-1] == "readback"
    assert ("target.shading" in names) is target
    assert ("earth.programs" in names) is first


@pytest.mark.parametrize("path", [plain_passes, software_passes])
def test_the_craft_alone_is_drawn_without_the_sky(path):
    names = _names(FrameGraph(_made(path).craft(), GIVEN))
    assert names[-1] == "target.shading"
    assert not {"earth.surface", "stars", "moon", "sun"} & set(names)


def test_the_software_path_adds_passes_and_leaves_none_out():
    plain, software = (_names(_made(path).frame()) for path in (plain_passes, software_passes))
    assert [name for name in software if name in plain] == plain
    assert set(software) - set(plain) == {"clear.rest", "earth.quad_packing"}


@pytest.mark.parametrize(
    "name",
    ["setup", "clear", "target.placement", "target.samples", "target.shadow", "target.edges", "target.light"],
)
def test_a_list_without_one_of_its_passes_is_refused(name):
    with pytest.raises(FrameGraphError, match="which no pass before it writes"):
        FrameGraph([one for one in _made(plain_passes).frame() if one.name != name], GIVEN)


def test_passes_in_another_order_are_refused():
    passes = _made(plain_passes).frame()
    light = _names(passes).index("target.light")
    passes[light : light + 2] = reversed(passes[light : light + 2])
    with pytest.raises(FrameGraphError, match="shading reads target light"):
        FrameGraph(passes, GIVEN)
