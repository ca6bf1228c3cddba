"""A processor without AVX draws the same image to float32 rounding."""

import os
import sys
from dataclasses import replace

import numpy as np
import pytest

from flyaround.simulator.render.renderer import Renderer
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scenario.plan import plan_flight
from tests.harness.programs import completed

pytestmark = pytest.mark.gl

SIZE_PX = 96


def _draw(renderer):
    scenario = load_scenario("tango-earth-10m-1024")
    plan = plan_flight(scenario, times=(30.0,))
    scene = plan.scene(0)
    share = SIZE_PX / scene.camera.width_px
    middle = (SIZE_PX - 1) / 2
    camera = replace(
        scene.camera,
        **dict.fromkeys(("width_px", "height_px"), SIZE_PX),
        **{name: getattr(scene.camera, name) * share for name in ("fx_px", "fy_px")},
        **dict.fromkeys(("cx_px", "cy_px"), middle),
    )
    return renderer.render(replace(scene, camera=camera), plan.target).radiance


@pytest.mark.slow  # a program of its own, with the Earth's maps
def test_vectors_of_128_bits_draw_the_same_picture(renderer, tmp_path):
    if "llvmpipe" not in renderer.info.renderer:
        pytest.skip("vectors are llvmpipe's")
    path = tmp_path / "narrow.npy"
    environment = {**os.environ, "LP_NATIVE_VECTOR_WIDTH": "128"}
    command = [sys.executable, "-m", "tests.simulator.render.gl.test_narrow_vectors", str(path)]
    done = completed(*command, env=environment)
    assert done.returncode == 0, done.stderr
    assert "128 bits" in done.stdout
    narrow, wide = np.load(path), _draw(renderer)
    assert np.percentile(np.abs(narrow - wide), 99.9) < 1e-5 * wide.max()
    # reciprocals rounded otherwise may move a sample across an edge
    assert np.abs(narrow - wide).max() < 0.01 * wide.max()


if __name__ == "__main__":
    with Renderer() as own:
        sys.stdout.write(own.info.renderer)
        np.save(sys.argv[1], _draw(own))
