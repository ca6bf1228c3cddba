"""The renderer's lists of passes: complete on both ways of drawing, and each pass of the target's is needed."""

from types import SimpleNamespace

import pytest

from flyaround.simulator.render.drawing import Drawing
from flyaround.simulator.render.drawing_path import PlainPath
from flyaround.simulator.render.frame_graph import FrameGraph, FrameGraphError
from flyaround.simulator.render.frame_resources import GIVEN_IRRADIANCE, MODEL, SCENE, TARGET
from flyaround.simulator.render.renderer import frame_passes
from flyaround.simulator.render.software.software_path import SoftwarePath

GIVEN = (SCENE, MODEL, GIVEN_IRRADIANCE)


@pytest.fixture
def draw():
    """What the passes call, without a driver: nothing of it is run."""
    return SimpleNamespace(**{name: print for name in vars(Drawing) if not name.startswith("_")})


@pytest.fixture
def software():
    """The software driver's way without a driver."""
    return SoftwarePath.__new__(SoftwarePath)


@pytest.mark.parametrize("with_target", [True, False])
def test_every_pass_reads_what_is_given_or_written_before(draw, software, with_target):
    given = GIVEN if with_target else (*GIVEN, TARGET)
    for path in (PlainPath(), software):
        names = [one.name for one in FrameGraph(path.adapt(frame_passes(draw, target=with_target)), given)]
        assert len(set(names)) == len(names)
        assert names[0] == "setup"
        assert names[-1] == "readback"
        assert ("target.shading" in names) is with_target


def test_the_plain_path_runs_the_list_as_it_reads(draw):
    passes = frame_passes(draw)
    assert PlainPath().adapt(passes) == passes


def test_the_software_path_adds_passes_and_leaves_none_out(draw, software):
    plain = [one.name for one in frame_passes(draw)]
    adapted = [one.name for one in software.adapt(frame_passes(draw))]
    assert [name for name in adapted if name in plain] == plain
    assert {name for name in adapted if name not in plain} == {
        "clear.rest",
        "earth.quad_packing",
    }


@pytest.mark.parametrize(
    "name",
    ["setup", "clear", "target.placement", "target.samples", "target.shadow", "target.edges", "target.light"],
)
def test_a_list_without_one_of_its_passes_is_refused(draw, name):
    with pytest.raises(FrameGraphError, match="which no pass before it writes"):
        FrameGraph([one for one in frame_passes(draw) if one.name != name], GIVEN)


def test_passes_in_another_order_are_refused(draw):
    passes = frame_passes(draw)
    names = [one.name for one in passes]
    shading = passes.pop(names.index("target.shading"))
    with pytest.raises(FrameGraphError, match="shading reads target light"):
        FrameGraph(
            [*passes[: names.index("target.light")], shading, *passes[names.index("target.light") :]], GIVEN
        )
