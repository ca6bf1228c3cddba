"""Pictures for training under any light: the craft by one lamp after another, to be mixed as the light of a laboratory.

    python -m tools.train.proposal_views tango -n 1 --earths 100 --seed 18101 -o DIR
    python -m tools.train.lit_views tango -n 5000 --paint tango-mockup -o DIR

Each view is drawn as `proposal_views` draws it, but ``LIGHTS`` times: ``SUNS`` times with the Sun elsewhere, then by
area lights near the craft, boxes and a lamp, each as strong at the craft as the Sun. Any sum of them is the craft in
the light of a laboratory. Written as arrays: ``lit.npy`` (N, LIGHTS, 72, 72) square roots of the signal under each
light over its brightest value, of 255; ``scale.npy`` (N, LIGHTS) that value; ``label.npy`` (N, 72, 72) number of the
surface, a part's side, 0 where there is none; ``cover.npy`` and ``pose.npy`` as of that module, which draws the
backgrounds (``earths.npy``).
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from flyaround.hil.evaluate.method_choice import board_model
from flyaround.simulator.imaging.exposure import integrate
from flyaround.simulator.imaging.image_formation import expose_scene
from flyaround.simulator.labels.surfaces import surfaces
from flyaround.simulator.render.renderer import Renderer
from flyaround.simulator.runtime.arrays import vec3
from flyaround.simulator.scene.illumination.area_light import DIFFUSE_DEG, AreaLight
from flyaround.simulator.targets.library import load_target
from flyaround.simulator.world.frames.rotation import matrix_from_quat
from tools.train.proposal_views import DRAWN_PX, VIEW_PX, plans, turned_to

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.scene.state import SceneState

# Lights a view is drawn by, the first of them the Sun, and how far from the camera's direction they may stand [rad].
LIGHTS, SUNS, FARTHEST_RAD = 6, 3, float(np.radians(125.0))

# Area lights: sides of a box and of a lamp's face, how far from the craft [m], and a lamp's half angle [deg].
BOX_M, LAMP_M, AWAY_M, LAMP_DEG = (0.3, 1.8), (0.08, 0.25), (1.0, 4.0), (12.0, 40.0)

SUN_M, SUN_W_M2 = 1.5e11, 1361.0


def lit_from(scene: SceneState, direction: FloatArray) -> SceneState:
    """The scene with the Sun in a direction of the camera's frame, and no other light."""
    R = matrix_from_quat(scene.q_camera_from_eci_wxyz)
    sun = np.asarray(scene.r_target_eci_m) + SUN_M * (R.T @ direction)
    return replace(scene, r_sun_eci_m=vec3(sun), sun_visible_fraction=1.0)


def lit_near(scene: SceneState, direction: FloatArray, rng: np.random.Generator, *, lamp: bool) -> SceneState:
    """The scene by an area light in a direction of the camera's frame from the craft, and no other light."""
    origin = np.asarray(scene.t_camera_from_target_m)
    away = float(rng.uniform(*AWAY_M))
    width, height = rng.uniform(*(LAMP_M if lamp else BOX_M), size=2)
    light = AreaLight(
        position_m=vec3(origin + away * direction),
        width_m=float(width),
        height_m=float(height),
        turn_deg=float(rng.uniform(0, 180)),
        radiance_w_m2_sr=float(SUN_W_M2 * away**2 / (width * height)),
        half_angle_deg=float(rng.uniform(*LAMP_DEG)) if lamp else DIFFUSE_DEG,
    )
    dark = msgspec.structs.replace(scene.environment, sunlight=False, earthshine=False)
    return replace(scene, lights=(light,), environment=dark)


def directions(rng: np.random.Generator) -> FloatArray:
    """(LIGHTS, 3) towards the lights, camera axes, uniform over the sphere but for what lies behind the craft."""
    cosine = rng.uniform(np.cos(FARTHEST_RAD), 1.0, LIGHTS)
    turn = rng.uniform(0, 2 * np.pi, LIGHTS)
    sine = np.sqrt(1 - cosine**2)
    return np.stack([sine * np.cos(turn), sine * np.sin(turn), -cosine], axis=1)


def surface_labels(parts: NDArray[np.uint16], normals: NDArray[np.float16]) -> NDArray[np.uint16]:
    """A number for each part's side: its part and the octant-like direction in which it faces the camera's axes."""
    n = np.rint(1.5 * normals.astype(np.float32)).astype(np.int32)
    side = (n[..., 0] + 2) * 25 + (n[..., 1] + 2) * 5 + n[..., 2] + 2
    _, number = np.unique(parts.astype(np.int64) * 125 + side, return_inverse=True)
    number = number.reshape(parts.shape)
    return np.where(parts > 0, number + 1, 0).astype(np.uint16)


def main() -> None:
    """Draw the views of one target."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parser.add_argument("target")
    parser.add_argument("-n", type=int, default=6000, help="views")
    parser.add_argument("--paint", help="a target of the same shape in another paint, for every second view")
    parser.add_argument("--seed", type=int, default=18001)
    parser.add_argument("-o", "--output", required=True, type=Path)
    options = parser.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    target = load_target(options.target)
    paints = [target] if options.paint is None else [target, load_target(options.paint)]
    model = board_model(target)
    n = options.n
    black = [plans(paint, n, options.seed)[0] for paint in paints]
    rng = np.random.default_rng(options.seed)

    def array(name: str, kind: type, *shape: int) -> np.memmap:
        return np.lib.format.open_memmap(options.output / f"{name}.npy", "w+", kind, (n, *shape))

    square = (VIEW_PX, VIEW_PX)
    lit, scale = array("lit", np.uint8, LIGHTS, *square), array("scale", np.float32, LIGHTS)
    cover, label = array("cover", np.uint8, *square), array("label", np.uint8, *square)
    pose = array("pose", np.float32, 8)
    start = time.process_time()
    f = DRAWN_PX // VIEW_PX
    with Renderer() as renderer:
        for k in range(n):
            craft, plan = paints[k % len(paints)], black[k % len(paints)]
            near = turned_to(plan.scene(k), model.centre_m, model.radius_m, DRAWN_PX)
            for j, d in enumerate(directions(rng)):
                scene = lit_from(near, d) if j < SUNS else lit_near(near, d, rng, lamp=j == LIGHTS - 1)
                signal = np.asarray(
                    expose_scene(scene, integrate(renderer, scene, craft).radiance), np.float32
                )
                if j == 0:
                    seen = surfaces(renderer, scene, craft, layers=True)
                    there = np.isfinite(seen.depth_m)
                    cover[k] = np.rint(255 * there.reshape(VIEW_PX, f, VIEW_PX, f).mean(axis=(1, 3)))
                    if seen.parts is None or seen.normals is None:
                        raise RuntimeError("a label raster with layers has parts and normals")
                    label[k] = surface_labels(seen.parts, seen.normals)[::f, ::f] % 256
                small = (signal * there).reshape(VIEW_PX, f, VIEW_PX, f).mean(axis=(1, 3))
                top = max(float(small.max()), 1e-6)
                # square roots: eight bits hold what is dark as well
                lit[k, j], scale[k, j] = np.rint(255 * np.sqrt(np.maximum(small / top, 0))), top
            centre = matrix_from_quat(near.q_camera_from_target_wxyz) @ model.centre_m + np.asarray(
                near.t_camera_from_target_m
            )
            pose[k, :4] = near.q_camera_from_target_wxyz
            pose[k, 4] = centre[2] / model.radius_m
            if k % 500 == 499:
                for a in (lit, scale, cover, label, pose):
                    a.flush()
                print(f"{k + 1} views, {time.process_time() - start:.0f} s of processor time", flush=True)


if __name__ == "__main__":
    main()
