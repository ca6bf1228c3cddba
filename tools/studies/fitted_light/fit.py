"""Estimation of the light in an image of known pose: boxes around the craft, their radiances by least squares.

Light is additive: the craft is rendered under each of many boxes at a small size, and the radiances are the
non-negative weights for which the sum is nearest to the image. Where the image is clipped, the sum is only required to
be clipped.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import cv2
import msgspec
import numpy as np
from scipy.optimize import nnls

from flyaround.simulator.camera.sections import crop_and_bin
from flyaround.simulator.compare.references import Reference
from flyaround.simulator.errors import UserError
from flyaround.simulator.imaging.image_formation import expose
from flyaround.simulator.labels.boxes import amodal_box
from flyaround.simulator.recipes.plan import plan_recipe
from flyaround.simulator.runtime.arrays import vec3
from flyaround.simulator.scenario.poses import scene_with_pose
from flyaround.simulator.scene.illumination.area_light import MAX_LIGHTS, AreaLight

if TYPE_CHECKING:
    from collections.abc import Sequence

    from flyaround.simulator.render.renderer import Renderer
    from flyaround.simulator.runtime.arrays import BoolArray, FloatArray, IntArray
    from flyaround.simulator.scene.state import SceneState
    from flyaround.simulator.targets.model import Target

RECIPE = "lightbox"
CANDIDATES = 48  # number of candidate boxes around the craft
DISTANCE_M, SIDE_M = 2.5, 1.0  # distance of the boxes from the craft, and their side
CLIPPED_DN = 245.0  # digital number from which a pixel counts as saturated
_UNIT = 1000.0  # radiance with which candidates are rendered [W m-2 sr-1]
_ACROSS_PX = 260  # width of the craft in the small images
_ROUNDS = 8  # iterations of the exclusion of clipped pixels
_MIN_SHARE = 0.02  # share of an image's light below which a box is omitted
_ALTERNATIONS = 4  # iterations between light and materials
_FACTORS = (0.2, 5.0)  # limits of the factor on a material's reflectance
_MIN_PIXELS = 30  # number of pixels below which a material is not fitted


@dataclass(frozen=True, eq=False)
class LightBasis:
    """A reduced image, and the craft rendered under each candidate box.

    Parameters
    ----------
    scene : SceneState
        Scene at full size, without lights.
    lights : tuple of AreaLight
        (K,) boxes of radiance `_UNIT`.
    drawn : (K, P) array
        Digital numbers above black of the craft's pixels under each box.
    seen : (P,) array
        Digital numbers above black of the image at these pixels.
    material : IntArray
        (P,) index into the target's materials.
    inner : BoolArray
        (P,) True if all neighbours have the same material.
    """

    scene: SceneState
    lights: tuple[AreaLight, ...]
    drawn: FloatArray
    seen: FloatArray
    material: IntArray
    inner: BoolArray


@dataclass(frozen=True, eq=False)
class FittedLight:
    """The boxes fitted to an image, its black level, and the residual [DN rms]."""

    lights: tuple[AreaLight, ...]
    black_dn: float
    residual_dn: float


def scene_at_pose(reference: Reference, target: Target) -> SceneState:
    """Return the laboratory scene with the craft at a reference's pose, without lights, in the reference's camera.

    Raises
    ------
    UserError
        If the pose of the image is unknown.
    """
    if reference.pose is None:
        raise UserError(f"{reference.path}: its pose is unknown; give the file of poses with --poses")
    scene = plan_recipe(RECIPE, 1, target=target.name).scene(0)
    environment = msgspec.structs.replace(scene.environment, earth=False, atmosphere=False)
    scene = replace(scene, camera=reference.camera, environment=environment, lights=msgspec.UNSET)
    return scene_with_pose(scene, target, reference.pose, 0)


def dn_per_radiance(scene: SceneState) -> float:
    """Return the digital numbers above black per unit of radiance [DN W-1 m2 sr]."""
    sensor, detector = scene.sensor, scene.sensor.detector
    signal = float(expose(np.ones((9, 9), np.float32), sensor, scene.exposure_s, optics=scene.optics)[4, 4])
    return signal * (2**sensor.bits - 1 if detector is None else sensor.saturation_e / detector.gain_e_per_dn)


def candidate_lights(
    scene: SceneState, count: int = CANDIDATES, distance_m: float = DISTANCE_M, side_m: float = SIDE_M
) -> list[AreaLight]:
    """Return boxes around the craft, uniform in solid angle, camera axes."""
    k = np.arange(count) + 0.5
    z, turn = 1 - 2 * k / count, k * np.pi * (3 - np.sqrt(5))
    ring = np.sqrt(1 - z * z)
    directions = np.stack([ring * np.cos(turn), ring * np.sin(turn), z], axis=1)
    origin = np.asarray(scene.t_camera_from_target_m)
    return [
        AreaLight(
            position_m=vec3(origin + distance_m * direction),
            width_m=side_m,
            height_m=side_m,
            radiance_w_m2_sr=_UNIT,
        )
        for direction in directions
    ]


def light_basis(
    renderer: Renderer, reference: Reference, target: Target, lights: Sequence[AreaLight] | None = None
) -> LightBasis:
    """Render the craft of a reference under each of ``lights``, by default the candidates."""
    scene = scene_at_pose(reference, target)
    lights = candidate_lights(scene) if lights is None else lights
    roi, binning = _window(scene, target)
    x0, y0, width, height = roi
    small = replace(
        scene, camera=crop_and_bin(scene.camera, roi, binning, str(reference.path)), quality="draft"
    )
    parts = renderer.surfaces(small, target, layers=True).parts
    if parts is None or not parts.any():
        raise UserError(f"{reference.path}: the craft is outside the image at its pose; check --poses")
    on = parts > 0
    names = [m.name for m in target.materials]
    of_part = np.array([0, *(names.index(p.material) for p in target.parts)])
    material = of_part[parts]
    window = reference.image[y0 : y0 + height, x0 : x0 + width].astype(np.float32)
    observed = cv2.resize(window, on.shape[::-1], interpolation=cv2.INTER_AREA)
    low, high = (
        morph(np.where(on, material + 1, 0).astype(np.uint8), np.ones((3, 3), np.uint8))
        for morph in (cv2.erode, cv2.dilate)
    )
    gain = dn_per_radiance(scene)
    drawn = [renderer.render(replace(small, lights=(light,)), target).radiance[on] * gain for light in lights]
    return LightBasis(
        scene,
        tuple(lights),
        np.array(drawn, float),
        observed[on].astype(float),
        material[on],
        (low == high)[on],
    )


def _window(scene: SceneState, target: Target) -> tuple[tuple[int, int, int, int], int]:
    """Return the window of the image around the craft, and the binning for the fit."""
    c = scene.camera
    box = amodal_box(scene, target)
    if box is None:
        return (0, 0, c.width_px, c.height_px), 1
    x0, y0, x1, y1 = np.clip(box, 0, [c.width_px, c.height_px] * 2).astype(int)
    binning = int(np.clip(round(max(x1 - x0, y1 - y0) / _ACROSS_PX), 1, 6))
    step = 16 * binning
    width, height = (max(-(-int(n) // step) * step, step) for n in (x1 - x0, y1 - y0))
    width, height = min(width, c.width_px // step * step), min(height, c.height_px // step * step)
    x, y = min(int(x0), c.width_px - width), min(int(y0), c.height_px - height)
    return (max(x, 0), max(y, 0), width, height), binning


def fit_light(basis: LightBasis, factors: FloatArray | None = None, most: int = MAX_LIGHTS) -> FittedLight:
    """Return the boxes whose light is closest to the image.

    Parameters
    ----------
    basis : LightBasis
        Renderings under each candidate light.
    factors : (M,) array, optional
        Factor of each material's brightness relative to the target's.
    most : int, optional
        Maximum number of boxes.
    """
    scale = np.ones(len(basis.seen)) if factors is None else factors[basis.material]
    columns = np.arange(len(basis.lights))
    weights, black = _weights(basis.drawn * scale, basis.seen)
    for keep in (most * 2, most):
        light = weights * basis.drawn[columns].mean(axis=1)
        strong = np.argsort(-light)[:keep]
        strong = strong[light[strong] > _MIN_SHARE * light.sum()]
        columns = columns[np.sort(strong)]
        weights, black = _weights(basis.drawn[columns] * scale, basis.seen)
    model = black + weights @ (basis.drawn[columns] * scale)
    residual = np.where(basis.seen > CLIPPED_DN, np.minimum(model - basis.seen, 0), model - basis.seen)
    lights = tuple(
        msgspec.structs.replace(basis.lights[k], radiance_w_m2_sr=float(np.clip(w * _UNIT, 1e-3, 1e8)))
        for k, w in zip(columns, weights, strict=True)
        if w > 0
    )
    return FittedLight(lights, float(black), float(np.sqrt(np.mean(residual * residual))))


def _weights(drawn: FloatArray, observed: FloatArray) -> tuple[FloatArray, float]:
    """Return non-negative weights (K,) of rows (K, P), and a constant, that fit the unclipped data (P,)."""
    design = np.vstack([drawn, np.ones(len(observed))])
    normal = design @ design.T
    ridge = 1e-6 * np.trace(normal) / len(normal) * np.eye(len(normal))
    root = np.linalg.cholesky(normal + ridge).T
    clipped, goal = observed > CLIPPED_DN, observed.copy()
    weights = np.zeros(len(design))
    for _ in range(_ROUNDS):
        weights, _ = nnls(root, np.linalg.solve(root.T, design @ goal))
        goal[clipped] = np.maximum((weights @ design)[clipped], observed[clipped])
    return weights[:-1], float(weights[-1])


def fit_materials(bases: Sequence[LightBasis], target: Target) -> FloatArray:
    """Return (M,) brightness factors of the materials over several images, fitted in turn with the images' light.


    The factor of the material with the most informative pixels is one, because the light's radiance sets the common
    scale.
    """
    count = len(target.materials)
    factors = np.ones(count)
    pixels = np.zeros(count)
    for _ in range(_ALTERNATIONS):
        over, under = np.full(count, 1e-9), np.full(count, 1e-9)
        pixels[:] = 0
        for basis in bases:
            fit = fit_light(basis, factors)
            rows = [basis.lights.index(_candidate(light)) for light in fit.lights]
            light = np.array([one.radiance_w_m2_sr / _UNIT for one in fit.lights]) @ basis.drawn[rows]
            use = basis.inner & (basis.seen < CLIPPED_DN)
            above = basis.seen - fit.black_dn
            over += np.bincount(basis.material[use], (light * above)[use], count)
            under += np.bincount(basis.material[use], (light * light)[use], count)
            pixels += np.bincount(basis.material[use], light[use] > 3.0, count)
        is_large = pixels > _MIN_PIXELS
        factors = np.where(is_large, np.clip(over / under, *_FACTORS), factors)
        factors[is_large] /= factors[int(np.argmax(pixels))]
        factors = np.clip(factors, *_FACTORS)
    return factors


def _candidate(light: AreaLight) -> AreaLight:
    return msgspec.structs.replace(light, radiance_w_m2_sr=_UNIT)


def repainted(target: Target, factors: FloatArray) -> Target:
    """Return the target with its materials' colours multiplied by factors (M,), at most 1."""
    materials = tuple(
        replace(m, base_color=vec3(np.minimum(np.asarray(m.base_color) * f, 1.0)))
        for m, f in zip(target.materials, factors, strict=True)
    )
    # a changed target needs another hash: the renderer caches targets by their file's hash
    digest = hashlib.sha256(target.sha256.encode() + np.asarray(factors, float).tobytes()).hexdigest()
    return replace(target, materials=materials, sha256=digest)
