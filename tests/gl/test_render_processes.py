"""Several renderers in processes of their own: what one draws, in order."""

import numpy as np
import pytest

from simulator.errors import UserError
from simulator.render.processes import RenderProcesses
from simulator.threads import usable_processors

pytestmark = pytest.mark.gl
COUNT = 2


def draw(renderer, scene, *, target, index):
    if index < 0:
        raise UserError("the lens cap is on; take it off")
    return index, renderer.render(scene, target).radiance


def test_two_draw_what_one_draws_in_order_and_say_what_went_wrong(renderer, draw_kit):
    target = draw_kit.target([draw_kit.plate("p", "white", (0, 0, 0), 0.5)], [draw_kit.white()])
    scenes = [draw_kit.scene(target, frame_index=k, t_m=(0.1 * k, 0, 5)) for k in range(7)]
    with RenderProcesses(draw, COUNT, capacity=2, first=scenes[0]) as processes:
        assert processes.info.renderer == renderer.info.renderer
        if renderer.info.is_software and renderer.info.threads == usable_processors() == COUNT:
            assert processes.info.threads == 0  # each draws by its own thread on its own processor
        drawn = list(processes.map((scene, {"target": target, "index": k}) for k, scene in enumerate(scenes)))
        assert [k for k, _ in drawn] == list(range(len(scenes)))
        for scene, (_, radiance) in zip(scenes, drawn, strict=True):
            assert np.array_equal(radiance, renderer.render(scene, target).radiance)
        with pytest.raises(UserError, match="lens cap"):
            list(processes.map([(scenes[0], {"target": target, "index": -1})]))


def test_none_cannot_draw():
    with pytest.raises(ValueError, match="at least one"):
        RenderProcesses(draw, 0)
