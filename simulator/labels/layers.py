"""Label layers: images of the camera's size (the amodal mask may be larger) with a value per pixel."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from flyaround.simulator.camera.detector.sensor import noiseless
from flyaround.simulator.imaging.image_formation import digitise_scene
from flyaround.simulator.labels.boxes import craft_window
from flyaround.simulator.labels.request import SURFACE_LAYERS
from flyaround.simulator.labels.surfaces import surfaces
from flyaround.simulator.runtime.arrays import ByteArray, Float32Array
from flyaround.simulator.world.frames.pose import Pose

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from flyaround.simulator.camera.lens.camera_model import Camera
    from flyaround.simulator.labels.request import LabelRequest
    from flyaround.simulator.labels.truth import Box, FlowLabel
    from flyaround.simulator.render.craft.label_raster import Surfaces
    from flyaround.simulator.render.renderer import Renderer
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.scene.state import SceneState
    from flyaround.simulator.targets.model import Target

MASKED_LAYERS = frozenset({"depth", "parts", "normals", "flow"})

# Rows computed at once; strips stay in the processor's cache.
STRIP_ROWS = 32
AMODAL_MARGIN = 1.0  # extent of the amodal mask beyond the image, in units of its larger side


@dataclass(frozen=True, eq=False)
class AmodalMask:
    """Mask (H', W') of the whole silhouette, 0 or 255; its first pixel is at ``origin_px`` of the image."""

    mask: ByteArray
    origin_px: tuple[int, int]


def visible_mask(surface: Surfaces) -> ByteArray:
    """Return (H, W) 255 where the craft covers a pixel's centre."""
    mask = np.zeros(surface.depth_m.shape, np.uint8)
    on_craft = np.isfinite(surface.depth_m[surface.window]).view(np.uint8)
    mask[surface.window] = np.negative(on_craft, out=on_craft)  # 1 becomes 255
    return mask


def draw_layers(
    renderer: Renderer,
    scene: SceneState,
    target: Target,
    request: LabelRequest,
    surface: Surfaces,
    mask: ByteArray,
    amodal_box: Box | None,
) -> tuple[dict[str, NDArray[Any]], tuple[int, int] | None]:
    """Draw the requested layers by name, except flow and clean twin. Return them with the amodal mask's origin.

    Parameters
    ----------
    renderer : Renderer
        Renderer of the images.
    scene : SceneState
        Scene at mid-exposure.
    target : Target
        Target model.
    request : LabelRequest
        Requested layers.
    surface : Surfaces
        Surface at the pixels' centres.
    mask : array
        Visible mask.
    amodal_box : Box or None
        Bounds of the projected craft.
    """
    layers: dict[str, NDArray[Any]] = {}
    origin = None
    for name in request.layers:
        if name == "depth":
            layers[name] = surface.depth_m
        elif name == "parts" and surface.parts is not None:
            layers[name] = surface.parts
        elif name == "normals" and surface.normals is not None:
            layers[name] = surface.normals
        elif name == "amodal":
            amodal = amodal_mask(renderer, scene, target, mask, amodal_box)
            layers[name], origin = amodal.mask, amodal.origin_px
    return layers, origin


def needs_surfaces(request: LabelRequest) -> bool:
    """Return True if the label pass must write normals and parts."""
    return not SURFACE_LAYERS.isdisjoint(request.layers)


def pixel_hash(image: NDArray[Any]) -> str:
    """Hash an image's pixels, row by row, independent of the file.

    Returns
    -------
    str
        SHA-256, 64 lower-case hexadecimal digits.
    """
    return hashlib.sha256(np.ascontiguousarray(image).data).hexdigest()


def layer_hash(name: str, layer: NDArray[Any], mask: ByteArray) -> str:
    """Hash a layer's values, row by row, independent of the file.

    Depth, parts, normals and flow are hashed where ``mask`` is set, because they are empty elsewhere. Other layers are
    hashed completely.

    Returns
    -------
    str
        SHA-256, 64 lower-case hexadecimal digits.
    """
    if name in MASKED_LAYERS and layer.shape[:2] == mask.shape:
        # viewing a pixel's values as one item makes the selection faster
        contiguous = np.ascontiguousarray(layer)
        pixels = contiguous.view(f"V{contiguous.itemsize * contiguous[0, 0].size}").reshape(mask.shape)
        window = craft_window(mask)
        layer = pixels[window][mask[window] > 0]
    return pixel_hash(layer)


def clean_twin(scene: SceneState, signal: Float32Array) -> NDArray[np.unsignedinteger]:
    """Return the image without noise: same optics, scale and bits."""
    return digitise_scene(scene, signal, noiseless(scene.sensor))


def amodal_mask(
    renderer: Renderer, scene: SceneState, target: Target, mask: ByteArray, box: Box | None
) -> AmodalMask:
    """Return the whole silhouette, up to an image's larger side beyond the edges.

    Inside the image it equals the visible mask, because nothing occludes the craft. A lens distortion is calibrated
    inside the image only, so with such a lens the mask is not extended.

    Parameters
    ----------
    renderer : Renderer
        Renderer of the images.
    scene : SceneState
        Scene at mid-exposure.
    target : Target
        Target model.
    mask : (H, W) array
        Mask of the target.
    box : Box or None
        Bounds of the projected craft; None if part of it is behind the camera.
    """
    height, width = mask.shape
    reach = int(AMODAL_MARGIN * max(width, height))
    x0, y0, x1, y1 = box or (-np.inf, -np.inf, np.inf, np.inf)
    overhang_px = max(-0.5 - x0, -0.5 - y0, x1 - width + 0.5, y1 - height + 0.5)
    if overhang_px <= 0 or not mask.any() or not scene.camera.distortion.is_none:
        return AmodalMask(mask, (0, 0))
    margin = int(min(np.ceil(overhang_px), reach))
    amodal = visible_mask(surfaces(renderer, scene, target, layers=False, margin_px=margin))
    rows, columns = np.flatnonzero(amodal.any(axis=1)), np.flatnonzero(amodal.any(axis=0))
    top, left = min(margin, int(rows[0])), min(margin, int(columns[0]))
    bottom = max(margin + height, int(rows[-1]) + 1)
    right = max(margin + width, int(columns[-1]) + 1)
    canvas = amodal[top:bottom, left:right].copy()
    origin = (left - margin, top - margin)
    # the larger raster may round edge pixels differently, so the image's own mask is kept
    canvas[-origin[1] : -origin[1] + height, -origin[0] : -origin[0] + width] = mask
    return AmodalMask(canvas, origin)


def optical_flow(scene: SceneState, flow: FlowLabel, depth_m: Float32Array, mask: ByteArray) -> Float32Array:
    """Return the (H, W, 2) displacement of each pixel's surface point to the next frame [px], x right, y down.

    NaN off the craft, and if the point is behind the camera in the next frame. Only for a global shutter.
    """
    pose = scene.camera_from_target
    next_pose = Pose.from_arrays(
        "camera", "target", flow.q_camera_from_target_wxyz, flow.t_camera_from_target_m
    )
    R = next_pose.R @ pose.R.T
    t = np.asarray(next_pose.t_m) - R @ np.asarray(pose.t_m)
    out = np.full((*depth_m.shape, 2), np.nan, np.float32)
    window = craft_window(mask)
    if scene.camera.distortion.is_none:
        out[window] = _pinhole_flow(scene.camera, R, t, depth_m, window)
        return out
    rows, columns = np.nonzero(mask[window])
    rows, columns = rows + window[0].start, columns + window[1].start
    pixels = np.stack([columns, rows], axis=1).astype(float)
    z = depth_m[rows, columns].astype(float)
    x, y = scene.camera.unproject(pixels).T
    points = np.stack([x * z, y * z, z], axis=1)
    out[rows, columns] = scene.camera.project(points @ R.T + t) - pixels
    return out


def _pinhole_flow(
    camera: Camera, R: FloatArray, t: FloatArray, depth_m: Float32Array, window: tuple[slice, slice]
) -> Float32Array:
    """Return the flow (h, w, 2) of a window for a pinhole camera; NaN without depth.

    Parameters
    ----------
    camera : Camera
        Camera of the image.
    R : (3, 3) array
        Rotation from the camera frame to that of the next frame, for points on the target.
    t : (3,) array
        Translation of the same motion [m].
    depth_m : (H, W) array
        Depth of the frame [m].
    window : tuple of slice
        Rows and columns of the window.
    """
    v, u = (np.arange(part.start, part.stop, dtype=float) for part in window)
    x, y = (u - camera.cx_px) / camera.fx_px, ((v - camera.cy_px) / camera.fy_px)[:, None]
    # rows of the projection matrix. A rotated ray is the sum of a term of its image row and a term of its column
    rows = [
        f * R[k] + c * R[2] for k, f, c in ((0, camera.fx_px, camera.cx_px), (1, camera.fy_px, camera.cy_px))
    ]
    offsets = (camera.fx_px * t[0] + camera.cx_px * t[2], camera.fy_px * t[1] + camera.cy_px * t[2])
    flow = np.empty((len(v), len(u), 2), np.float32)
    for first in range(0, len(v), STRIP_ROWS):  # strips stay in the processor's cache
        strip = slice(first, first + STRIP_ROWS)
        z = depth_m[window][strip].astype(float)
        next_z = ((R[2, 0] * x + R[2, 2]) + R[2, 1] * y[strip]) * z + t[2]
        next_z[next_z <= 1e-9] = np.nan
        for k, pixel in enumerate((u, v[strip, None])):
            projected = ((rows[k][0] * x + rows[k][2]) + rows[k][1] * y[strip]) * z
            projected += offsets[k]
            projected /= next_z
            projected -= pixel
            flow[strip, :, k] = projected
    return flow
