"""The frame graph: passes may use only declared resources, and read only written ones."""

from types import SimpleNamespace

import pytest

from flyaround.simulator.render.frame_graph import FrameGraph, FrameGraphError, FrameResources, Pass, Resource

DEPTH: Resource[list[str]] = Resource("depth")
COLOR: Resource[list[str]] = Resource("color")
MOON: Resource[str] = Resource("moon")
CONTEXT = SimpleNamespace(extra=None, finish=lambda: None)


class Step(Pass):
    """A pass made of a function."""

    def __init__(self, name, run, reads=(), writes=(), optional=()):
        self.name, self.run, self.reads, self.writes, self.optional = name, run, reads, writes, optional


def _draw_depth(resources):
    resources[DEPTH] = ["depth"]


def _shade(resources):
    resources[COLOR] = [*resources[DEPTH], "color"]


def _run(*passes, given=None):
    resources = FrameResources()
    for resource, value in (given or {}).items():
        resources[resource] = value
    spent = FrameGraph(passes, given or ()).run(CONTEXT, resources)
    return resources, spent


DEPTH_PASS = Step("depth", _draw_depth, writes=(DEPTH,))
SHADE_PASS = Step("shade", _shade, reads=(DEPTH,), writes=(COLOR,))


def test_passes_hand_on_what_they_write():
    resources, spent = _run(DEPTH_PASS, SHADE_PASS)
    assert resources[COLOR] == ["depth", "color"]
    assert list(spent) == ["depth", "shade"]


@pytest.mark.parametrize("passes", [[SHADE_PASS], [SHADE_PASS, DEPTH_PASS]])
def test_pass_reading_an_unwritten_resource_is_refused(passes):
    with pytest.raises(FrameGraphError, match="pass shade reads depth, which no pass before it writes"):
        FrameGraph(passes)


def test_an_optional_resource_must_be_known_too():
    with pytest.raises(FrameGraphError, match="reads moon"):
        FrameGraph([Step("sun", lambda _: None, optional=(MOON,))])


def test_given_resource_needs_no_writer():
    resources, _ = _run(SHADE_PASS, given={DEPTH: ["given"]})
    assert resources[COLOR] == ["given", "color"]


def test_pass_without_its_inputs_is_skipped_with_its_dependents():
    seen = []
    last = Step("last", lambda r: seen.append(r.find(MOON)), reads=(), optional=(MOON,))
    after = Step("after", lambda _: seen.append("after"), reads=(COLOR,))
    resources, spent = _run(SHADE_PASS, after, last, given={DEPTH: None, MOON: None})
    assert list(spent) == ["last"]
    assert seen == [None]
    assert resources.find(COLOR) is None


def test_skipping_a_pass_keeps_the_output_of_others():
    draw_moon = Step("moon", lambda _: None, reads=(MOON, COLOR), writes=(COLOR,))
    resources, _ = _run(DEPTH_PASS, SHADE_PASS, draw_moon, given={MOON: None})
    assert resources[COLOR] == ["depth", "color"]


@pytest.mark.parametrize(
    ("run", "does"),
    [
        (lambda r: r[COLOR], "reads color"),
        (lambda r: r.find(COLOR), "reads color"),
        (lambda r: r.__setitem__(COLOR, []), "writes color"),
    ],
)
def test_a_pass_may_touch_only_what_it_declared(run, does):
    with pytest.raises(FrameGraphError, match=f"pass thief {does}, which it did not declare"):
        _run(Step("thief", run, reads=(DEPTH,), writes=(DEPTH,)), given={DEPTH: [], COLOR: []})
