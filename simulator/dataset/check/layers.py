"""Checks of the label layers: whole images against each other, and sampled pixels against rays on the CPU."""

from __future__ import annotations

import itertools
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from flyaround.simulator.dataset.check.geometry import differing_pixels, project_with_opencv, rays_with_opencv
from flyaround.simulator.dataset.check.mask_statistics import is_binary
from flyaround.simulator.dataset.check.ray_casting import (
    DEPTH_M,
    DEPTH_RELATIVE,
    Layers,
    RaySampler,
    SampledRays,
    ray_oracle,
    sample_pixels,
)
from flyaround.simulator.dataset.check.row_poses import pose_of_row
from flyaround.simulator.imaging.rolling_shutter import BAND_PX
from flyaround.simulator.labels.layers import layer_hash
from flyaround.simulator.labels.visibility import SURFACE_TOLERANCE_M
from flyaround.simulator.world.frames.pose import Pose

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from flyaround.simulator.labels.truth import KeypointLabel, Truth
    from flyaround.simulator.runtime.arrays import ByteArray, FloatArray, IntArray
    from flyaround.simulator.targets.model import Target

MAX_DIFFERING_PIXELS = (
    300  # differing pixels of a mask that rays may decide; each ray takes time, so it is bounded
)
MAX_REPORTED_PIXELS = 6  # wrong pixels after which the search stops
# Tolerance of a normal's length: half precision keeps it to 5e-4.
NORMAL_TOLERANCE = 2e-3

# Maximum angle between a normal and that of a face close to its pixel [rad]. Normals are interpolated over a facet: a
# smaller angle reports coarsely faceted curves, a larger one overlooks the normal of a neighbouring face.
NORMAL_ANGLE_RAD = 0.05

# Tolerance of the optical flow [px], and over the coordinate: rounding of the layer and of the depth in float32. Larger
# ones overlook a wrong pose of the next frame.
FLOW_PX, FLOW_RELATIVE = 2e-3, 2e-6

# Tolerance of the depth around a keypoint, relative, and absolute below a metre [m]: more than SURFACE_TOLERANCE_M,
# within which a surface does not hide a keypoint.
KEYPOINT_DEPTH = 3e-3

# Width over which depth varies at a rod's root or an edge [px].
KEYPOINT_REACH_PX = 1.5


def check_layers(truth: Truth, mask: ByteArray, layers: Layers, target: Target | None = None) -> list[str]:
    """Return all faults of a frame's layers, one sentence each.

    Parameters
    ----------
    truth : Truth
        Truth record of the frame.
    mask : (H, W) array
        Mask of the target.
    layers : Layers
        Layers by name, as drawn or read.
    target : Target, optional
        Model for ray tests where a pixel is too coarse to decide.
    """
    recorded = {name for name in truth.layers if name != "wireframe"}
    if recorded != set(truth.layer_sha256):
        return [f"layers are {sorted(recorded)}, their hashes are of {sorted(truth.layer_sha256)}"]
    faults = [f"layer {name} is missing" for name in sorted(recorded - set(layers))]
    faults += [
        f"layer {name} is not the one that the record describes"
        for name, layer in layers.items()
        if name in truth.layer_sha256 and layer_hash(name, layer, mask) != truth.layer_sha256[name]
    ]
    for name, layer in layers.items():
        shape = mask.shape if name not in {"normals", "flow", "clean"} else layer.shape[:2]
        if name != "amodal" and shape != mask.shape:
            faults.append(f"layer {name} is {layer.shape}, the image {mask.shape}")
    return faults or _check_support(truth, mask, layers, target) + _check_amodal(truth, mask, layers)


def _check_support(truth: Truth, mask: ByteArray, layers: Layers, target: Target | None) -> list[str]:
    """Check for common support, unit normals towards the camera, valid parts, and keypoints at their depth."""
    faults, on_target = [], mask > 0
    if "depth" in layers:
        depth = layers["depth"]
        if depth.dtype != np.float32 or not np.array_equal(np.isfinite(depth), on_target):
            faults.append("depth is not finite exactly on the mask")
        elif on_target.any() and depth[on_target].min() <= 0:
            faults.append("depth is not in front of the camera")
        else:
            faults += [
                f"keypoint {k.name} is {k.state}, which the depth about it contradicts"
                for k in truth.keypoints
                if not depth_confirms_keypoint(truth, k, depth)
                and not (target is not None and ray_confirms_keypoint(truth, k, target))
            ]
    if "flow" in layers and (_in_any_channel(np.isfinite(layers["flow"])) & ~on_target).any():
        faults.append("there is optical flow off the mask")
    if "parts" in layers:
        parts = layers["parts"]
        if not np.array_equal(parts > 0, on_target):
            faults.append("the parts do not partition the mask")
        elif parts.max(initial=0) > len(truth.parts):
            faults.append(f"part {parts.max()} has no name among {len(truth.parts)}")
    if "normals" in layers:
        # as bits without the sign: comparing half floats is by far the slowest step
        bits = np.ascontiguousarray(layers["normals"], np.float16).view(np.uint16)
        has_normal = (_in_any_channel(bits) & 0x7FFF) > 0
        normals = layers["normals"][on_target].astype(float)
        if not np.array_equal(has_normal, on_target):
            faults.append("normals are not there exactly on the mask")
        elif not np.all(np.abs(np.linalg.norm(normals, axis=1) - 1) <= NORMAL_TOLERANCE):
            faults.append("normals are not of unit length")
        else:
            faults += _check_facing(truth, on_target, normals)
    return faults


def _in_any_channel(values: NDArray[Any]) -> NDArray[Any]:
    """Combine the channels of (H, W, C) bits or flags with a bitwise or. NumPy's reduction is slow along short axes."""
    combined = values[..., 0].copy()
    for k in range(1, values.shape[2]):
        combined |= values[..., k]
    return combined


def _check_facing(truth: Truth, on_target: NDArray[np.bool_], n: FloatArray) -> list[str]:
    """Check normals (K, 3) of the target's pixels, row by row, against the viewing rays."""
    rows, columns = np.nonzero(on_target)
    if not len(rows):
        return []
    rays = rays_with_opencv(truth.camera, np.stack([columns, rows], axis=1).astype(float))
    towards = (n[:, 0] * rays[:, 0] + n[:, 1] * rays[:, 1] + n[:, 2]) / np.hypot(1, np.hypot(*rays.T))
    n_away = int(np.count_nonzero(towards > NORMAL_TOLERANCE))
    return [f"{n_away} normals look away from the camera"] if n_away else []


def depth_confirms_keypoint(truth: Truth, keypoint: KeypointLabel, depth_m: NDArray[np.float32]) -> bool:
    """Return True if a keypoint's label agrees with the depths of the 3 x 3 pixels around it."""
    if keypoint.pixel_px is None or keypoint.state == "out_of_frame":
        return True
    pose = pose_of_row(truth, keypoint.pixel_px[1])
    z_m = float(pose.apply(np.array(keypoint.target_m))[2])
    u, v = (int(x) for x in np.rint(keypoint.pixel_px))
    patch = depth_m[max(v - 1, 0) : v + 2, max(u - 1, 0) : u + 2]
    if patch.size < 9 or not np.isfinite(patch).all():
        return True  # next to an outline, the hiding surface may lie between the pixels' centres
    pixel_m = z_m / min(truth.camera.fx_px, truth.camera.fy_px)
    tolerance = KEYPOINT_DEPTH * max(1.0, z_m) + KEYPOINT_REACH_PX * pixel_m
    if keypoint.state == "self_occluded":
        return bool(patch.min() < z_m + tolerance)
    # a thin tape seen end-on hides its neighbours' pixels, but not all around its tip
    larger_patch = depth_m[max(v - 2, 0) : v + 3, max(u - 2, 0) : u + 3]
    return bool(not np.isfinite(larger_patch).all() or larger_patch.max() > z_m - tolerance)


def ray_confirms_keypoint(truth: Truth, keypoint: KeypointLabel, target: Target) -> bool:
    """Return True if a ray to a keypoint confirms its label: the ray is blocked if, and only if, the label is hidden.

    A surface thinner than a pixel, such as a wing seen edge-on, may hide a point without covering a pixel's centre.
    """
    if keypoint.pixel_px is None:
        return False
    pose = pose_of_row(truth, keypoint.pixel_px[1])
    point = pose.apply(np.array(keypoint.target_m))
    z_m = float(point[2])
    hits = ray_oracle(target, pose).hits(point / z_m).z_m
    surface_m = SURFACE_TOLERANCE_M * z_m / float(np.linalg.norm(point))
    is_hidden = bool(len(hits) and hits[0] < z_m - surface_m)
    return is_hidden == (keypoint.state == "self_occluded")


def _check_amodal(truth: Truth, mask: ByteArray, layers: Layers) -> list[str]:
    """Check that the amodal mask contains the image and equals the visible mask there."""
    if "amodal" not in layers:
        return []
    amodal, origin = layers["amodal"], truth.amodal_origin_px
    height, width = mask.shape
    if origin is None or max(origin) > 0:
        return [f"the amodal mask starts at {origin}, inside the image"]
    x, y = -origin[0], -origin[1]
    if amodal.ndim != 2 or not np.array_equal(amodal[y : y + height, x : x + width], mask):
        return ["the amodal mask is not the visible mask on the image"]
    if not is_binary(amodal):
        return ["the amodal mask has values other than 0 and 255"]
    return []


def check_against_mesh(truth: Truth, mask: ByteArray, layers: Layers, target: Target) -> list[str]:
    """Check mask, amodal mask and sampled pixels of all layers against the mesh."""
    sampler = RaySampler(truth, target)
    if "amodal" in layers and truth.amodal_origin_px is not None:
        # inside the image it is the visible mask
        amodal = np.asarray(layers["amodal"], np.uint8)
        faults = _check_mask(truth, amodal, truth.amodal_origin_px, target, sampler, "amodal mask")
    else:
        faults = _check_mask(truth, mask, (0, 0), target, sampler, "mask")
    if "parts" in layers and truth.parts != tuple(part.name for part in target.parts):
        faults.append("the parts' names are not the target's")
    pixels = sample_pixels(truth, mask, layers, sampler)
    for name, is_right in (
        ("mask", _mask_agrees),
        ("depth", partial(_depth_agrees, _depth_in_a_band(truth))),
        ("parts", _part_agrees),
    ):
        layer = mask if name == "mask" else layers.get(name)
        if layer is not None:
            faults += _sentence(
                name, (p for p in pixels if not sampler.agrees(p, partial(is_right, layer[p[1], p[0]])))
            )
    if "normals" in layers and len(pixels):
        rays = rays_with_opencv(truth.camera, pixels.astype(float))
        mismatches = (
            p
            for p, ray in zip(pixels, rays, strict=True)
            if mask[p[1], p[0]]
            and not sampler.agrees(p, partial(_normal_agrees, layers["normals"][p[1], p[0]], ray))
        )
        faults += _sentence("normals", mismatches)
    if "flow" in layers:
        faults += _check_flow(truth, layers["flow"], pixels, sampler)
    return faults


def _sentence(name: str, mismatches: Iterable[IntArray]) -> list[str]:
    """Return a sentence with the first wrong pixels; the search stops after a few."""
    first = list(itertools.islice(mismatches, MAX_REPORTED_PIXELS))
    if not first:
        return []
    number = f"{MAX_REPORTED_PIXELS} or more" if len(first) == MAX_REPORTED_PIXELS else str(len(first))
    return [f"{name} is not the mesh's at {number} sampled pixels, the first at {tuple(map(int, first[0]))}"]


def _mask_agrees(value: int, rays: SampledRays) -> bool:
    return bool(len(rays.z_m)) if value else rays.misses


def _depth_in_a_band(truth: Truth) -> float:
    """Return the relative change of depth during the exposure of one band of a rolling shutter."""
    return BAND_PX / 2 / min(truth.camera.fx_px, truth.camera.fy_px) if truth.row_poses else 0.0


def _depth_agrees(in_band: float, z_m: float, rays: SampledRays) -> bool:
    if not np.isfinite(z_m):
        return rays.misses
    tolerance = (DEPTH_RELATIVE + in_band) * z_m + DEPTH_M
    return bool(len(rays.z_m)) and rays.z_m.min() - tolerance <= z_m <= rays.z_m.max() + tolerance


def _part_agrees(part: int, rays: SampledRays) -> bool:
    return rays.misses if part == 0 else int(part) in rays.parts


def _normal_agrees(normal: NDArray[np.float16], ray: FloatArray, rays: SampledRays) -> bool:
    """Return True if the normal is that of a surface there, towards the camera and not beyond the horizon."""
    ray_direction = np.array([*ray, 1.0]) / np.sqrt(ray @ ray + 1)
    candidates = np.concatenate([rays.normals, -rays.normals])
    candidates = candidates - np.maximum(candidates @ ray_direction, 0)[:, None] * ray_direction
    candidates /= np.maximum(np.linalg.norm(candidates, axis=1, keepdims=True), 1e-9)
    n = normal.astype(float)
    if np.any(np.linalg.norm(candidates - n, axis=1) < NORMAL_ANGLE_RAD):
        return True
    return rays.candidates is not None and rays.candidates.has_normal(n, ray_direction, NORMAL_ANGLE_RAD)


def _check_flow(truth: Truth, flow: NDArray[np.float32], pixels: IntArray, sampler: RaySampler) -> list[str]:
    """Check sampled pixels: the point that a ray hits, projected with the next frame's pose."""
    if truth.flow is None:
        return ["there is optical flow, and the record does not say to which frame"]
    pose_now = pose_of_row(truth, 0)
    pose_next = Pose.from_arrays(
        "camera", "target", truth.flow.q_camera_from_target_wxyz, truth.flow.t_camera_from_target_m
    )
    R = pose_next.R @ pose_now.R.T
    t = np.asarray(pose_next.t_m) - R @ np.asarray(pose_now.t_m)
    with_flow = pixels[np.isfinite(flow[pixels[:, 1], pixels[:, 0]]).any(axis=1)]
    without_flow = pixels[~np.isfinite(flow[pixels[:, 1], pixels[:, 0]]).all(axis=1)]

    def has_none(pixel: IntArray, rays: SampledRays) -> bool:
        ray = np.array([*rays_with_opencv(truth.camera, pixel[None].astype(float))[0], 1.0])
        return rays.misses or bool(np.all((rays.z_m[:, None] * ray @ R.T + t)[:, 2] <= 1e-9))

    def is_right(pixel: IntArray, ray: FloatArray, rays: SampledRays) -> bool:
        points = rays.z_m[:, None] * np.array([*ray, 1.0]) @ R.T + t
        points = points[points[:, 2] > 1e-9]
        if not len(points):
            return False
        next_px = project_with_opencv(truth.camera, points, (1.0, 0.0, 0.0, 0.0), np.zeros(3))
        # from the nearest to the farthest surface that the pixel may show
        low, high = (f(next_px, axis=0) - pixel for f in (np.min, np.max))
        tolerance = FLOW_PX + FLOW_RELATIVE * np.abs(next_px).max()
        value = flow[pixel[1], pixel[0]]
        return bool(np.all((value >= low - tolerance) & (value <= high + tolerance)))

    rays = rays_with_opencv(truth.camera, with_flow.astype(float)) if len(with_flow) else np.zeros((0, 2))
    mismatches = (
        p for p, ray in zip(with_flow, rays, strict=True) if not sampler.agrees(p, partial(is_right, p, ray))
    )
    missing = (p for p in without_flow if not sampler.agrees(p, partial(has_none, p)))
    return _sentence("flow", itertools.chain(mismatches, missing))


def _check_mask(
    truth: Truth, mask: ByteArray, origin_px: tuple[int, int], target: Target, sampler: RaySampler, name: str
) -> list[str]:
    """Check a mask against the triangles filled on the CPU; isolated differing pixels are decided by rays."""
    doubts = differing_pixels(truth, mask, target, origin_px)
    if len(doubts) > MAX_DIFFERING_PIXELS:
        return [f"{name} differs from the projected craft at {len(doubts)} pixels"]
    mismatches = (
        p
        for p in doubts
        if not sampler.agrees(p + np.array(origin_px), partial(_mask_agrees, mask[p[1], p[0]]))
    )
    return _sentence(name, mismatches)
