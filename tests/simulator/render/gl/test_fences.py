"""Fences of the software driver are kept until its threads have left them."""

import os
import platform
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import moderngl
import pytest

from flyaround.simulator.render.gl.fences import Fences, draw_to, flush
from flyaround.simulator.render.renderer import Renderer
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scenario.plan import plan_flight
from tests.harness.programs import completed

pytestmark = pytest.mark.gl

PICTURES = 15
MOST_HELD = 64


def _draw(renderer, count):
    """Small pictures of a scene with everything, at two sizes: batches are short and many. Each one's number."""
    plan = plan_flight(load_scenario("tango-flyaround"), n=count)
    for k in range(count):
        scene, share = plan.scene(k), 8 if k % 5 else 4
        camera = scene.camera
        camera = replace(
            camera,
            width_px=camera.width_px // share,
            height_px=camera.height_px // share,
            **{name: getattr(camera, name) / share for name in ("fx_px", "fy_px", "cx_px", "cy_px")},
        )
        renderer.render(replace(scene, camera=camera, quality="draft"), plan.target)
        yield k


def test_a_thread_held_up_while_it_tells_that_it_is_done_corrupts_nothing(renderer, tmp_path):
    if "llvmpipe" not in renderer.info.renderer or platform.machine() != "x86_64":
        pytest.skip("llvmpipe's threads are held up, by a name that the C library has on x86-64")
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("no C compiler (apt-get install gcc)")
    library = tmp_path / "slow_fences.so"
    source = Path(__file__).with_name("slow_fences.c")
    subprocess.run([compiler, "-shared", "-fPIC", str(source), "-o", str(library), "-ldl"], check=True)
    environment = {**os.environ, "LD_PRELOAD": str(library), "LP_NUM_THREADS": "2"}
    command = [sys.executable, "-X", "faulthandler", "-m", "tests.simulator.render.gl.test_fences"]
    done = completed(*command, env=environment)
    # without `Fences`: -6 or -11, "corrupted double-linked list", within six pictures in eight runs of eight
    assert done.returncode == 0, f"{done.returncode} after {done.stdout!r}: {done.stderr}"
    assert done.stdout == "".join(f"{k} " for k in range(PICTURES)) + "drawn"


def test_fences_are_held_and_freed_again(renderer):
    if not renderer.info.is_software:
        pytest.skip("of a software driver")
    context = moderngl.create_context(standalone=True, backend="egl")
    with Renderer(context=context) as own:
        assert len(list(_draw(own, PICTURES))) == PICTURES
        assert isinstance(context.extra, Fences)
        assert 0 < context.extra.held <= MOST_HELD
    context.release()
    renderer.make_current()


def test_another_owners_context_is_flushed_and_left_alone(renderer):
    context = moderngl.create_context(standalone=True, backend="egl")
    context.extra = "the owner's"
    image = context.framebuffer([context.texture((4, 4), 1)])
    draw_to(image)
    image.clear(1.0)
    flush(context)
    assert image.read(components=1) == b"\xff" * 16
    assert context.extra == "the owner's"
    context.release()
    renderer.make_current()


if __name__ == "__main__":
    with Renderer() as one:
        for drawn in _draw(one, PICTURES):
            sys.stdout.write(f"{drawn} ")
            sys.stdout.flush()  # should the process die: where
    sys.stdout.write("drawn")
