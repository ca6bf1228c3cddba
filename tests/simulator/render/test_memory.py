"""GPU memory: freed when a renderer closes, and when other targets replace one."""

import ctypes
import gc
import resource
import weakref
from dataclasses import replace
from pathlib import Path

import moderngl
import numpy as np
import pytest

from flyaround.simulator.camera.lens.camera_model import Distortion
from flyaround.simulator.frame import take_frame
from flyaround.simulator.render.craft.resident_targets import MAX_RESIDENT
from flyaround.simulator.render.gl.context import create_context
from flyaround.simulator.render.renderer import Renderer
from flyaround.simulator.scene.environments import Environment
from flyaround.simulator.world.frames.rotation import matrix_from_quat

pytestmark = pytest.mark.gl


def _resident_mb():
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * resource.getpagesize() / 1e6


def _settled_mb():
    """Without what the C library keeps of freed memory: how much that is depends on where it lies."""
    gc.collect()
    ctypes.CDLL(None).malloc_trim(0)
    return _resident_mb()


def _plate(draw_kit, k):
    """A target that no other test has."""
    half_m = 0.3 + 1e-6 * k  # much the same: a lens asks for as many pieces of each
    corner = draw_kit.plate(f"corner {k}", "white", (half_m, half_m, 0), 0.05)
    return draw_kit.target(
        [draw_kit.plate(f"plate {k}", "white", (0, 0, 0), half_m), corner],
        [draw_kit.white(base_color=(0.5, 0.4, 0.001 * k))],
    )


def _in_use(kind, size=None):
    """Objects of the driver's that are not freed; textures of one size."""
    found = [one for one in gc.get_objects() if type(one) is kind]
    found = [one for one in found if not isinstance(one.mglo, moderngl.InvalidObject)]
    return sum(size is None or one.size == size for one in found)


def test_closed_renderer_frees_its_maps(draw_kit):
    target = draw_kit.target([draw_kit.plate("plate", "white", (0, 0, 0), 0.3)], [draw_kit.white()])
    scene = replace(draw_kit.scene(target, t_m=(0, 0, 4.0)), environment=Environment())
    scene = scene.with_body("moon", r_eci_m=tuple(np.asarray(scene.r_camera_eci_m) + _ahead_m(scene, 3.8e8)))
    context = create_context()
    try:
        with Renderer(context=context) as passing:
            passing.render(scene, target)
            held = _maps_in_use(context)
        assert held >= 3, "the Earth's maps and the Moon's were drawn from"
        assert _maps_in_use(context) == 0
        assert context.error == "GL_NO_ERROR"
    finally:
        context.release()


def _maps_in_use(context):
    """Textures of a context that are maps of a globe and not freed."""
    found = [one for one in gc.get_objects() if type(one) is moderngl.Texture and one.ctx is context]
    return sum(not isinstance(one.mglo, moderngl.InvalidObject) and one.width >= 2000 for one in found)


def _ahead_m(scene, distance_m):
    """Along the boresight, inertial axes [m]."""
    return matrix_from_quat(scene.q_camera_from_eci_wxyz)[2] * distance_m


def test_renderers_one_after_another_take_the_memory_of_one(draw_kit):
    camera = draw_kit.camera.resized(96)
    held = []
    for k in range(5):
        target = _plate(draw_kit, 100 + k)
        scene = draw_kit.scene(target, t_m=(0, 0, 4.0), camera=camera, environment=Environment())
        with Renderer() as passing:
            passing.render(scene, target, labels=True)
        held.append(_settled_mb())
    assert max(held[2:]) < held[1] + 50


@pytest.mark.parametrize(
    "distortion", [Distortion(), Distortion("brown_conrady", (-0.2, 0.0, 0.0, 0.0, 0.0))]
)
def test_targets_that_others_follow_are_forgotten(renderer, draw_kit, distortion):
    camera = replace(draw_kit.camera.resized(96), distortion=distortion)
    begun, in_use = 0, []
    targets = weakref.WeakSet()

    def draw(k):
        target = _plate(draw_kit, k)
        targets.add(target)
        scene = draw_kit.scene(target, t_m=(0, 0, 4.0), camera=camera)
        assert np.max(take_frame(renderer, scene, target).radiance) > 0

    for round_of in range(3):
        for k in range(begun, begun + MAX_RESIDENT + 1):
            draw(k)
        begun += MAX_RESIDENT + 1
        gc.collect()
        in_use.append([_in_use(kind) for kind in (moderngl.Buffer, moderngl.VertexArray, moderngl.Texture)])
        assert len(targets) <= MAX_RESIDENT, round_of
    assert in_use[1] == in_use[2]
