"""Pictures for training a learned proposal: the craft alone, small and without noise, and the Earth alone to lay it on.

    python -m tools.train.proposal_views tango -n 12000 -o DIR

Each view is one sample of the recipes `eval-black` and `eval-earth` (for any target), seen by a camera turned to the
craft's centre and as narrow as the craft's sphere, so that a picture of 72 pixels holds it wholly; in draft quality and
without the light of sea ice, which no picture of 72 pixels tells (Tango's were drawn with both). Written as arrays:
``views.npy`` (N, 72, 72) signal of the craft, premultiplied by ``cover.npy``, its share of each pixel; ``pose.npy``
(N, 8) attitude against the line of sight (w x y z), range over radius, direction to the Sun; ``earths.npy``
(M, 300, 480) signal.
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
from flyaround.simulator.camera.detector.presets import sensor_preset
from flyaround.simulator.camera.lens.camera_model import Camera
from flyaround.simulator.imaging.exposure import integrate
from flyaround.simulator.imaging.image_formation import expose_scene
from flyaround.simulator.labels.surfaces import surfaces
from flyaround.simulator.recipes.plan import RecipePlan
from flyaround.simulator.recipes.poses import resolved_range
from flyaround.simulator.render.renderer import Renderer
from flyaround.simulator.runtime.arrays import quat, vec3
from flyaround.simulator.scenario.load import load_recipe
from flyaround.simulator.scene.environments import Environment
from flyaround.simulator.targets.library import load_target
from flyaround.simulator.world.frames.rotation import matrix_from_quat, quat_from_matrix

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import Float32Array, FloatArray
    from flyaround.simulator.scene.state import SceneState
    from flyaround.simulator.targets.model import Target

# Side of a view, and the finer one it is drawn at for soft borders [px]; share of it that the craft's sphere fills.
VIEW_PX, DRAWN_PX, FILLED = 72, 144, 0.97

# Nothing but the craft, lit by the Sun and the Earth.
CRAFT_ALONE = Environment(earth=False, stars=False, sun=False, moon=False, planets=False, sea_ice=False)

# Backgrounds: the SPEED camera's picture at a quarter of its size [px].
EARTH_PX = (480, 300)


def turned_to(scene: SceneState, centre_m: FloatArray, radius_m: float, side_px: int) -> SceneState:
    """The scene by a narrow camera at the same place that inputs at the craft's centre and is filled by its sphere."""
    c = matrix_from_quat(scene.q_camera_from_target_wxyz) @ centre_m + np.asarray(
        scene.t_camera_from_target_m
    )
    distance = float(np.linalg.norm(c))
    z = c / distance
    # the shortest turn that brings the centre onto the axis: directions across the picture stay what they were
    axis = np.array([-z[1], z[0], 0.0])
    sine = float(np.hypot(z[0], z[1]))
    k = axis / max(sine, 1e-12)
    K = np.array([[0, -k[2], k[1]], [k[2], 0, -k[0]], [-k[1], k[0], 0]])
    turn = (np.eye(3) + sine * K + (1 - z[2]) * (K @ K)).T
    f = 0.5 * FILLED * side_px * float(np.sqrt(distance**2 - radius_m**2)) / radius_m
    middle = 0.5 * (side_px - 1)
    camera = Camera(width_px=side_px, height_px=side_px, fx_px=f, fy_px=f, cx_px=middle, cy_px=middle)
    return replace(
        scene,
        camera=camera,
        sensor=sensor_preset("ideal"),
        environment=CRAFT_ALONE,
        quality="draft",
        q_camera_from_target_wxyz=quat(
            quat_from_matrix(turn @ matrix_from_quat(scene.q_camera_from_target_wxyz))
        ),
        t_camera_from_target_m=vec3(turn @ np.asarray(scene.t_camera_from_target_m)),
        q_camera_from_eci_wxyz=quat(quat_from_matrix(turn @ matrix_from_quat(scene.q_camera_from_eci_wxyz))),
    )


def draw_view(renderer: Renderer, scene: SceneState, target: Target) -> tuple[Float32Array, Float32Array]:
    """(72, 72) signal of the craft alone, premultiplied, and its share of each pixel."""
    signal = expose_scene(scene, integrate(renderer, scene, target).radiance)
    cover = np.isfinite(surfaces(renderer, scene, target, layers=False).depth_m).astype(np.float32)
    return _reduced(signal * cover), _reduced(cover)


def _reduced(picture: Float32Array) -> Float32Array:
    f = DRAWN_PX // VIEW_PX
    return np.asarray(picture, np.float32).reshape(VIEW_PX, f, VIEW_PX, f).mean(axis=(1, 3))


def plans(target: Target, n: int, seed: int) -> tuple[RecipePlan, RecipePlan]:
    """The two recipes of evaluation with this target."""
    camera = Camera(
        width_px=EARTH_PX[0],
        height_px=EARTH_PX[1],
        fx_px=3003.4129692832766 / 4,
        fy_px=3003.4129692832766 / 4,
        cx_px=0.5 * (EARTH_PX[0] - 1),
        cy_px=0.5 * (EARTH_PX[1] - 1),
    )
    black, earth = (
        RecipePlan(
            recipe=msgspec.structs.replace(r, target=target.name, range=resolved_range(r.range, target)),
            target=target,
            camera=camera,
            n_frames=n,
            seed=seed,
        )
        for r in (load_recipe("eval-black"), load_recipe("eval-earth"))
    )
    return black, earth


def main() -> None:
    """Draw the views and the backgrounds of one target."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parser.add_argument("target")
    parser.add_argument("-n", type=int, default=12000, help="views")
    parser.add_argument("--earths", type=int, default=240, help="backgrounds")
    parser.add_argument("--seed", type=int, default=7001)
    parser.add_argument("-o", "--output", required=True, type=Path)
    options = parser.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    target = load_target(options.target)
    model = board_model(target)
    n = options.n
    black, earth = plans(target, n, options.seed)
    shape = (n, VIEW_PX, VIEW_PX)
    views = np.lib.format.open_memmap(options.output / "views.npy", "w+", np.float16, shape)
    cover = np.lib.format.open_memmap(options.output / "cover.npy", "w+", np.uint8, shape)
    pose = np.lib.format.open_memmap(options.output / "pose.npy", "w+", np.float32, (n, 8))
    start = time.process_time()
    with Renderer() as renderer:
        earths = np.zeros((options.earths, EARTH_PX[1], EARTH_PX[0]), np.float16)
        for k in range(options.earths):
            scene = replace(earth.scene(n + k), sensor=sensor_preset("ideal"))
            # the craft out of sight
            away = replace(scene, t_camera_from_target_m=(0.0, 0.0, 1e6))
            earths[k] = np.minimum(expose_scene(away, integrate(renderer, away, target).radiance), 8.0)
        np.save(options.output / "earths.npy", earths)
        for k in range(n):
            scene = (earth if k % 2 else black).scene(k)
            near = turned_to(scene, model.centre_m, model.radius_m, DRAWN_PX)
            drawn, share = draw_view(renderer, near, target)
            views[k] = np.minimum(drawn, 30.0)
            cover[k] = np.rint(255 * share)
            centre = matrix_from_quat(near.q_camera_from_target_wxyz) @ model.centre_m + np.asarray(
                near.t_camera_from_target_m
            )
            pose[k, :4] = near.q_camera_from_target_wxyz
            pose[k, 4] = centre[2] / model.radius_m
            pose[k, 5:] = near.sun_direction_camera
            if k % 500 == 499:
                views.flush()
                print(f"{k + 1} views, {time.process_time() - start:.0f} s of processor time", flush=True)


if __name__ == "__main__":
    main()
