"""The renderer in its own process: order, errors, crash, clean end."""

import os

import numpy as np
import pytest

from simulator.errors import UserError
from simulator.render.process import RenderProcess
from simulator.targets.model import Target

pytestmark = pytest.mark.gl


def draw(renderer, scene, *, target: Target, scale: float = 1.0):
    image = renderer.render(scene, target).radiance
    return scene.frame_index, image * np.float32(scale)


def fail(renderer, scene, *, how: str):
    if how == "user":
        raise UserError("the lens cap is on; take it off")
    if how == "die":
        os._exit(7)
    raise ValueError("a bug")


@pytest.fixture(scope="module")
def target(draw_kit):
    return draw_kit.target([draw_kit.plate("p", "white", (0, 0, 0), 0.5)], [draw_kit.white()])


def test_results_in_order_and_equal_to_ours(renderer, draw_kit, target):
    scenes = [draw_kit.scene(target, frame_index=k, t_m=(0.1 * k, 0, 5)) for k in range(5)]
    with RenderProcess(draw, capacity=2, first=scenes[0]) as process:
        assert process.info == renderer.info
        results = []
        for scene in scenes:
            if not process.has_room:
                results.append(process.result())
            process.submit(scene, target=target)
        results += process.results()
        process.submit(scenes[0], target=target, scale=2.0)
        process.submit(scenes[1], target=target)
        assert not process.has_room
        with pytest.raises(RuntimeError, match="in flight"):
            process.submit(scenes[2], target=target)
        assert process.ready(30)
        _, doubled = process.result()
        # one job is left behind on purpose: closing must not hang
    assert [index for index, _ in results] == [0, 1, 2, 3, 4]
    for scene, (_, image) in zip(scenes, results, strict=True):
        assert np.array_equal(image, renderer.render(scene, target).radiance)
    assert np.array_equal(doubled, 2 * results[0][1])


def test_errors_come_back_as_themselves(draw_kit, target):
    scene = draw_kit.scene(target)
    with RenderProcess(fail) as process:
        process.submit(scene, how="user")
        with pytest.raises(UserError, match="lens cap"):
            process.result()
        process.submit(scene, how="bug")
        with pytest.raises(RuntimeError, match="ValueError: a bug"):
            process.result()
        process.submit(scene, how="die")
        with pytest.raises(RuntimeError, match="exit code 7"):
            process.result()


def test_a_renderer_that_cannot_start_says_why(draw_kit, target):
    with RenderProcess(draw, device_index=97) as process:
        process.submit(draw_kit.scene(target), target=target)
        with pytest.raises(UserError, match="device 97"):
            process.result()
