"""Differences between images of a real mock-up and renderings, with one cause replaced at a time.

    python -m tools.studies.real_gap FOLDER -o OUT                      # FOLDER: images and test.json in SPEED's format
    python -m tools.studies.real_gap FOLDER -o OUT --page docs/lab/2026-11-real-pictures.md

Each image gets a rendered twin: the craft at its pose under light fitted to the image, with the mock-up's surfaces and
the recipe's lens and noise. Then one property of the twin is replaced by another, or by that of the image:

| row | replacement |
|---|---|
| light: one box | only the strongest of the fitted boxes |
| light: of the recipe | the boxes of a frame of the recipe `lightbox` |
| light: theirs, smooth | the image's brightness, smoothed over 24 px |
| material: flight | the flight model's surfaces |
| lens: sharp | no blur and no glow |
| lens: soft | twice the blur and three times the glow |
| noise: none | no detector noise |
| background: theirs | the image's pixels outside the craft: noise, screen and stray light |
| inside: theirs | the image's pixels inside the craft |
| model: bent | the estimator's model distorted at random, 8 mm along each axis |

NCC is computed between the silhouette's pixels and the image; the estimator receives the model `tango`, not the truth.
No part of the images is saved.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import msgspec
import numpy as np

from flyaround.hil.board.estimation import CameraIntrinsics
from flyaround.hil.board.hybrid.decide.confidence import Evidence
from flyaround.hil.board.hybrid.estimator import PoseEstimator
from flyaround.hil.evaluate.method_choice import board_model
from flyaround.hil.evaluate.metrics import wilson_interval
from flyaround.hil.evaluate.pose_errors import COARSE_DEG, COARSE_SHARE, frame_errors
from flyaround.simulator.camera.lens.files import load_camera
from flyaround.simulator.compare.references import read_references
from flyaround.simulator.imaging.image_formation import digitise_scene, expose_scene
from flyaround.simulator.recipes.plan import plan_recipe
from flyaround.simulator.render.renderer import Renderer
from flyaround.simulator.runtime.arrays import vec3
from flyaround.simulator.scenario.poses import scene_with_pose
from flyaround.simulator.targets.library import load_target
from flyaround.simulator.world.frames.pose import Pose
from tools.studies.fitted_light.fit import RECIPE, fit_light, light_basis
from tools.studies.fitted_light.pairs import check_pictures, correlation
from tools.studies.paired_tables import write_into_page
from tools.studies.published_methods import wrong_model

if TYPE_CHECKING:
    from collections.abc import Sequence

    from flyaround.hil.board.estimation.result import PoseResult
    from flyaround.simulator.compare.references import Reference
    from flyaround.simulator.runtime.arrays import BoolArray, ByteArray
    from flyaround.simulator.scene.state import SceneState
    from flyaround.simulator.targets.model import Target

MOCKUP, FLIGHT = "tango-mockup", "tango"
BENT_M, SMOOTH_PX, SEED = 0.008, 24.0, 29601

# light above black of an image below which its ratio to the rendering is meaningless [DN]
MIN_DN = 4.0

# width of the columns in the picture of failures [px]
SHOWN_PX = 420


@dataclass(frozen=True, eq=False)
class SwapRow:
    """Similarity of one image of a row to the real one, and the estimator's result on it."""

    ncc: float
    deg: float
    share: float
    metres: float
    score: float
    accepted: bool

    @property
    def right(self) -> bool:
        """True if the pose is right."""
        return self.deg <= COARSE_DEG and self.share <= COARSE_SHARE


@dataclass(frozen=True, eq=False)
class Twin:
    """Twin of an image: the scene that renders it, the rendering and the silhouette."""

    reference: Reference
    scene: SceneState
    on: BoolArray
    image: ByteArray


def drawn(renderer: Renderer, scene: SceneState, target: Target) -> ByteArray:
    """Return the image of a scene with a given target."""
    named = replace(scene.target, name=target.name, sha256=target.sha256)
    scene = replace(scene, target=named)
    return np.asarray(
        digitise_scene(scene, expose_scene(scene, renderer.render(scene, target).radiance)), np.uint8
    )


def twin_of(renderer: Renderer, reference: Reference, target: Target) -> Twin:
    """Return the craft at an image's pose under the light fitted to the image."""
    basis = light_basis(renderer, reference, target)
    light = fit_light(basis)
    scene = replace(_with_black(basis.scene, light.black_dn), lights=light.lights)
    on = renderer.surfaces(scene, target, layers=False).depth_m
    return Twin(reference, scene, np.isfinite(on), drawn(renderer, scene, target))


def _with_black(scene: SceneState, black_dn: float) -> SceneState:
    detector = scene.sensor.detector
    if detector is None:
        return scene
    level = float(np.clip(black_dn, 0.0, 200.0))
    return replace(scene, sensor=replace(scene.sensor, detector=replace(detector, black_level_dn=level)))


def swaps(
    renderer: Renderer, twin: Twin, mockup: Target, flight: Target, number: int
) -> dict[str, ByteArray]:
    """Return the twin with one property replaced, by the name of the row."""
    scene, photograph = twin.scene, twin.reference.image
    strongest = max(scene.area_lights, key=lambda one: one.radiance_w_m2_sr)
    detector = scene.sensor.detector
    if detector is None:
        raise RuntimeError("the laboratory's sensor is in electrons")
    quiet = replace(scene.sensor, detector=replace(detector, read_noise_e=0.0))
    sharp = replace(
        scene,
        sensor=replace(scene.sensor, blur_sigma_px=0.3),
        optics=replace(scene.optics, glow_share=0.0),
    )
    soft = replace(
        scene,
        sensor=replace(scene.sensor, blur_sigma_px=2 * scene.sensor.blur_sigma_px),
        optics=replace(scene.optics, glow_share=min(3 * scene.optics.glow_share, 0.5)),
    )
    plain = drawn(renderer, replace(scene, sensor=quiet), mockup)
    inside, on = _soft(twin.on), twin.on
    return {
        "light: one box": drawn(renderer, replace(scene, lights=(strongest,)), mockup),
        "light: of the recipe": drawn(renderer, replace(scene, lights=_recipe_lights(scene, number)), mockup),
        "light: theirs, smooth": _with_their_light(photograph, twin.image, plain, on),
        "material: flight": drawn(renderer, scene, flight),
        "lens: sharp": drawn(renderer, sharp, mockup),
        "lens: soft": drawn(renderer, soft, mockup),
        "noise: none": plain,
        "background: theirs": _laid(twin.image, photograph, inside),
        "inside: theirs": _laid(photograph, twin.image, inside),
    }


def _recipe_lights(scene: SceneState, number: int) -> tuple[Any, ...]:
    """Return the light boxes of a frame of the recipe, around its craft."""
    plan = plan_recipe(RECIPE, number + 1, seed=SEED)
    recipe_scene = plan.scene(number)
    shift = np.asarray(scene.t_camera_from_target_m) - np.asarray(recipe_scene.t_camera_from_target_m)
    return tuple(
        msgspec.structs.replace(one, position_m=vec3(np.asarray(one.position_m) + shift))
        for one in recipe_scene.area_lights
    )


def _soft(on: BoolArray) -> np.ndarray[Any, Any]:
    """Return the coverage of each pixel by the craft, blurred slightly as by the lens."""
    wide = cv2.dilate(on.astype(np.uint8), np.ones((7, 7), np.uint8))
    return cv2.GaussianBlur(wide.astype(np.float32), (0, 0), 1.5)


def _laid(inside: ByteArray, outside: ByteArray, share: np.ndarray[Any, Any]) -> ByteArray:
    return np.rint(share * inside + (1 - share) * outside).astype(np.uint8)


def _with_their_light(
    photograph: ByteArray, rendering: ByteArray, plain: ByteArray, on: BoolArray
) -> ByteArray:
    """Return the rendering scaled to the real image's brightness over many pixels, with its own detail and noise."""
    black = float(np.percentile(plain[~on], 20)) if (~on).any() else 0.0
    their_black = float(np.percentile(photograph[~on], 20)) if (~on).any() else 0.0
    weight = on.astype(np.float32)

    def smooth(image: ByteArray, level: float) -> np.ndarray[Any, Any]:
        above = np.maximum(image.astype(np.float32) - level, 0) * weight
        total, share = (cv2.GaussianBlur(a, (0, 0), SMOOTH_PX) for a in (above, weight))
        return np.asarray(total / np.maximum(share, 1e-3))

    ratio = np.clip((smooth(photograph, their_black) + MIN_DN) / (smooth(plain, black) + MIN_DN), 0.1, 10.0)
    noise = rendering.astype(np.float32) - plain
    lit = black + np.where(on, ratio, 1.0) * (plain - black)
    return np.clip(np.rint(lit + noise), 0, 255).astype(np.uint8)


def swap_row(estimator: PoseEstimator, image: ByteArray, twin: Twin) -> tuple[SwapRow, PoseResult]:
    """Return the measurements of an image and the estimator's answer."""
    pose = twin.reference.pose
    if pose is None:
        raise RuntimeError("the pose of a twin is known")
    result = estimator.estimate(image)
    q, t = result.q_camera_from_target_wxyz, result.t_camera_from_target_m
    if q is None or t is None:
        errors = (9.0, 9.0, 180.0)
    else:
        errors = frame_errors(np.asarray(pose.q_wxyz), np.asarray(pose.t_m), q, t)
    evidence = result.evidence
    score = (evidence.score if isinstance(evidence, Evidence) else None) or 0.0
    like = correlation(twin.reference.image[twin.on], image[twin.on])
    return SwapRow(like, float(errors[2]), float(errors[1]), float(errors[0]), score, result.accepted), result


def table(rows: dict[str, Sequence[SwapRow]]) -> str:
    """Return a row for each replacement, in Markdown."""
    lines = [
        "| picture | NCC | right (95 %) | median error of the right ones | explained | accepted, wrong |",
        "|---|---|---|---|---|---|",
    ]
    for name, some in rows.items():
        good = [r for r in some if r.right]
        low, high = wilson_interval(len(good), len(some)) or (0.0, 1.0)
        error = "-"
        if good:
            deg, metres = (float(np.median([getattr(r, k) for r in good])) for k in ("deg", "metres"))
            error = f"{deg:.2f} deg, {1e3 * metres:.0f} mm"
        accepted = [r for r in some if r.accepted]
        wrong = sum(not r.right for r in accepted)
        explained = float(np.median([r.score for r in some]))
        like = float(np.median([r.ncc for r in some]))
        lines.append(
            f"| {name} | {like:.2f} | {len(good)} of {len(some)} ({100 * low:.0f}-{100 * high:.0f} %) | {error} | "
            f"{explained:.2f} | {len(accepted)}, {wrong} |"
        )
    return "\n".join(lines)


def failures_picture(
    renderer: Renderer, lost: Sequence[tuple[Twin, PoseResult]], target: Target
) -> ByteArray | None:
    """Return the rendering at the true pose next to that at the returned pose, one row per failure."""
    lines = []
    for twin, result in lost:
        q, t = result.q_camera_from_target_wxyz, result.t_camera_from_target_m
        if q is None or t is None:
            continue
        estimated_scene = scene_with_pose(twin.scene, target, Pose.from_arrays("camera", "target", q, t), 0)
        shift = np.asarray(t) - np.asarray(twin.scene.t_camera_from_target_m)
        lights = tuple(
            msgspec.structs.replace(one, position_m=vec3(np.asarray(one.position_m) + shift))
            for one in twin.scene.area_lights
        )
        estimated_image = drawn(renderer, replace(estimated_scene, lights=lights), target)
        on_estimate = np.isfinite(renderer.surfaces(estimated_scene, target, layers=False).depth_m)
        either = twin.on | on_estimate
        rows, columns = np.flatnonzero(either.any(axis=1)), np.flatnonzero(either.any(axis=0))
        size = int(1.15 * max(np.ptp(rows), np.ptp(columns))) + 20
        x, y = int(columns.mean()) - size // 2, int(rows.mean()) - size // 2
        cut = [_window(image, x, y, size) for image in (twin.image, estimated_image)]
        rim = np.full((SHOWN_PX, 4), 255, np.uint8)
        lines += [np.hstack([cut[0], rim, cut[1]]), np.full((4, 2 * SHOWN_PX + 4), 255, np.uint8)]
    return np.vstack(lines[:-1]) if lines else None


def _window(image: ByteArray, x: int, y: int, size: int) -> ByteArray:
    """Return a square window of the image, moved inside its borders, at the displayed size."""
    height, width = image.shape
    x, y = min(max(x, 0), max(width - size, 0)), min(max(y, 0), max(height - size, 0))
    padded = cv2.copyMakeBorder(image, size, size, size, size, cv2.BORDER_CONSTANT, value=0)
    part = padded[y + size : y + 2 * size, x + size : x + 2 * size]
    method = cv2.INTER_AREA if size > SHOWN_PX else cv2.INTER_CUBIC
    return np.asarray(cv2.resize(part, (SHOWN_PX, SHOWN_PX), interpolation=method), np.uint8)


def main() -> None:
    """Run the study on the images of a folder."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("-o", "--output", required=True, type=Path)
    parser.add_argument("--camera", default="speedplus")
    parser.add_argument("-n", type=int, default=1000, help="maximum number of images")
    parser.add_argument("--page", type=Path, default=None, help="page with a place for the table")
    options = parser.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    camera, mockup, flight = load_camera(options.camera), load_target(MOCKUP), load_target(FLIGHT)
    references = read_references(options.folder, camera, options.n, options.folder / "test.json")
    check_pictures(references, camera)
    model = board_model(flight)
    intrinsics = CameraIntrinsics.from_dict(msgspec.to_builtins(references[0].camera))
    estimator, bent = (PoseEstimator(m, intrinsics) for m in (model, wrong_model(model, BENT_M)))
    rows: dict[str, list[SwapRow]] = {}
    lost: list[tuple[Twin, PoseResult]] = []
    with Renderer() as renderer:
        for k, reference in enumerate(references):
            twin = twin_of(renderer, reference, mockup)
            row, result = swap_row(estimator, reference.image, twin)
            rows.setdefault("theirs", []).append(row)
            if not row.right:
                lost.append((twin, result))
                print(f"{reference.path.name}: {row.deg:.1f} deg, {100 * row.share:.1f} %", flush=True)
            rows.setdefault("the twin", []).append(swap_row(estimator, twin.image, twin)[0])
            for name, image in swaps(renderer, twin, mockup, flight, k).items():
                rows.setdefault(name, []).append(swap_row(estimator, image, twin)[0])
            rows.setdefault("model: bent", []).append(swap_row(bent, twin.image, twin)[0])
        picture = failures_picture(renderer, lost, mockup)
    if picture is not None:
        cv2.imwrite(str(options.output / "failures.jpg"), picture)
    text = table({name: tuple(some) for name, some in rows.items()})
    (options.output / "table.md").write_text(text + "\n", encoding="utf-8")
    print(text)
    if options.page is not None:
        write_into_page(options.page, "real-gap", "swaps", text)


if __name__ == "__main__":
    main()
