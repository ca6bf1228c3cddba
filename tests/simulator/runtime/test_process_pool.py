"""Several renderers in processes of their own: what one draws, in order."""

import numpy as np
import pytest

from flyaround.simulator.errors import UserError
from flyaround.simulator.loop import OpenRenderer
from flyaround.simulator.runtime.threads import usable_processors
from flyaround.simulator.runtime.worker_pool import WorkerPool

pytestmark = pytest.mark.gl
COUNT = 2


def draw(renderer, scene, *, target, index):
    if index < 0:
        raise UserError("the lens cap is on; take it off")
    return index, renderer.render(scene, target).radiance


def test_two_draw_what_one_draws_in_order_and_say_what_went_wrong(renderer, draw_kit, monkeypatch):
    monkeypatch.setenv("LP_NUM_THREADS", "")
    monkeypatch.delenv("LP_NUM_THREADS")
    target = draw_kit.target([draw_kit.plate("p", "white", (0, 0, 0), 0.5)], [draw_kit.white()])
    scenes = [draw_kit.scene(target, frame_index=k, t_m=(0.1 * k, 0, 5)) for k in range(7)]
    with WorkerPool(
        draw, COUNT, open_resource=OpenRenderer(first=scenes[0], processes=COUNT), capacity=2
    ) as processes:
        assert processes.info.renderer == renderer.info.renderer
        if renderer.info.is_software:  # on two processors each draws by its own thread alone
            share = usable_processors() // COUNT
            assert processes.info.threads == (0 if usable_processors() <= COUNT else share)
        drawn = []
        for k, scene in enumerate(scenes):
            if not processes.submit(scene, target=target, index=k):
                drawn.append(processes.result())
                assert processes.submit(scene, target=target, index=k)
        drawn += [processes.result() for _ in range(processes.in_flight)]
        assert [k for k, _ in drawn] == list(range(len(scenes)))
        for scene, (_, radiance) in zip(scenes, drawn, strict=True):
            assert np.array_equal(radiance, renderer.render(scene, target).radiance)
        for index in (-1, 1, 2):
            processes.submit(scenes[0], target=target, index=index)
        with pytest.raises(UserError, match="lens cap"):
            processes.result()
        assert [processes.result()[0] for _ in range(2)] == [1, 2]


def test_none_cannot_draw():
    with pytest.raises(ValueError, match="at least 1"):
        WorkerPool(draw, 0, open_resource=OpenRenderer())
