"""`take_frame` refuses a scene whose camera cannot exist, as `render_scene` does."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import pytest

import flyaround as fa

if TYPE_CHECKING:
    from flyaround.simulator.scene.state import SceneState


@pytest.fixture(scope="module")
def plan() -> fa.FlightPlan:
    return fa.plan_flight(fa.load_scenario("tango-flyaround"), n=1)


def _changed(scene: SceneState, part: str, **values: object) -> SceneState:
    return replace(scene, **{part: replace(getattr(scene, part), **values)})


@pytest.mark.gl
@pytest.mark.parametrize(
    ("part", "field", "value"),
    [
        ("sensor", "bits", 0),
        ("sensor", "full_scale_j_m2_sr", float("nan")),
        ("optics", "f_number", -1.0),
    ],
)
def test_a_camera_that_cannot_exist_is_refused_by_both(
    plan: fa.FlightPlan, part: str, field: str, value: float
) -> None:
    scene = _changed(plan.scene(0), part, **{field: value})
    with fa.Renderer() as renderer, pytest.raises(fa.UserError, match=f"cannot be drawn: .*{field}") as first:
        fa.take_frame(renderer, scene, plan.target)
    with pytest.raises(fa.UserError, match="cannot be drawn") as second:
        fa.render_scene(scene, plan.target)
    assert field in str(second.value)
    assert part in str(first.value)
