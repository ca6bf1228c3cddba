"""Labels of one image: truth record, mask, and the requested layers."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np

from flyaround.simulator.labels.boxes import amodal_box, mask_box
from flyaround.simulator.labels.feasible import (
    infeasible_reason,
    mean_level,
    mono_signal,
    wireframe_step_share,
)
from flyaround.simulator.labels.keypoints import label_keypoints, pixel_or_none
from flyaround.simulator.labels.layers import (
    clean_twin,
    draw_layers,
    layer_hash,
    needs_surfaces,
    optical_flow,
    pixel_hash,
    visible_mask,
)
from flyaround.simulator.labels.surfaces import start_surfaces
from flyaround.simulator.labels.truth import Box, RowPose, Software, Truth, WireLabel
from flyaround.simulator.labels.wireframe import view_edges
from flyaround.simulator.runtime.arrays import ByteArray, Float32Array, vec3
from flyaround.simulator.scene.motion import propagated_scene
from flyaround.simulator.scene.record import SceneRecord
from flyaround.simulator.targets.joined_mesh import box_3d_m, joined_mesh

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from flyaround.simulator.labels.request import LabelRequest
    from flyaround.simulator.labels.wireframe import ProjectedEdge
    from flyaround.simulator.render.renderer import Renderer
    from flyaround.simulator.scene.state import SceneState
    from flyaround.simulator.targets.model import Target

ROW_POSES = 33  # number of rows whose pose is recorded with a rolling shutter


@dataclass(frozen=True, eq=False)
class Labels:
    """Labels of an image.

    Parameters
    ----------
    truth : Truth
        Truth record of the image.
    mask : (H, W) uint8 array
        255 on the target.
    depth_m : (H, W) array
        Camera z, NaN outside.
    layers : dict
        The label images that were requested, by name.
    """

    truth: Truth
    mask: ByteArray
    depth_m: Float32Array
    layers: dict[str, NDArray[Any]]


def label_picture(
    renderer: Renderer,
    scene: SceneState,
    target: Target,
    request: LabelRequest,
    signal: Float32Array,
    image: NDArray[np.unsignedinteger],
) -> Labels:
    """Label an image.

    Geometry is computed while the driver renders the label raster in its own threads. Another thread hashes finished
    arrays; it makes few long calls, which release Python's global lock, because reacquiring the lock is slow.

    Parameters
    ----------
    renderer : Renderer
        Renderer of the image.
    scene : SceneState
        Scene that the image shows.
    target : Target
        Model of the target.
    request : LabelRequest
        Label layers to render in addition to truth and mask.
    signal : (H, W[, 3]) array
        Noise-free signal, 1 at full scale.
    image : array
        Digital numbers of the image.

    Returns
    -------
    Labels
        Truth record, mask and requested layers.
    """
    mono = mono_signal(signal)
    clean = clean_twin(scene, signal) if "clean" in request.layers else None
    with ThreadPoolExecutor(1) as executor:
        level = executor.submit(mean_level, mono)
        image_hash = executor.submit(pixel_hash, image)
        clean_hash = None if clean is None else executor.submit(pixel_hash, clean)
        inside = renderer.silhouette_inside(scene, target)
        finish = start_surfaces(renderer, scene, target, layers=needs_surfaces(request))
        amodal = amodal_box(scene, target)
        truth = truth_record(
            scene,
            target,
            mono,
            level.result,
            silhouette_inside=inside,
            amodal=amodal,
            wireframe="wireframe" in request.layers,
            software=Software(flyaround=_flyaround_version(), gl_renderer=renderer.info.renderer),
        )
        surfaces = finish()
        mask = visible_mask(surfaces)
        mask_hash = executor.submit(pixel_hash, mask)
        layers, origin = draw_layers(renderer, scene, target, request, surfaces, mask, amodal)
        hashes = {
            # an amodal mask with nothing beyond the image is the mask itself
            name: mask_hash if layer is mask else executor.submit(layer_hash, name, layer, mask)
            for name, layer in layers.items()
        }
        if "flow" in request.layers and request.flow is not None:
            layers["flow"] = optical_flow(scene, request.flow, surfaces.depth_m, mask)
            hashes["flow"] = executor.submit(layer_hash, "flow", layers["flow"], mask)
        if clean is not None and clean_hash is not None:
            layers["clean"], hashes["clean"] = clean, clean_hash
        layers = {name: layers[name] for name in request.layers if name in layers}
        truth = msgspec.structs.replace(
            truth,
            box_px=mask_box(mask),
            image_sha256=image_hash.result(),
            mask_sha256=mask_hash.result(),
            parts=tuple(part.name for part in target.parts) if "parts" in layers else (),
            layers=tuple(name for name in request.layers if name in layers or name == "wireframe"),
            layer_sha256={name: hashes[name].result() for name in layers},
            amodal_origin_px=origin,
            flow=request.flow if "flow" in layers else None,
        )
    return Labels(truth, mask, surfaces.depth_m, layers)


def truth_record(
    scene: SceneState,
    target: Target,
    signal: Float32Array,
    level: Callable[[], float],
    *,
    silhouette_inside: float,
    amodal: Box | None,
    wireframe: bool,
    software: Software,
) -> Truth:
    """Build the truth record of a scene and its noise-free signal, without the hashes of the written images.

    Parameters
    ----------
    scene : SceneState
        Scene at mid-exposure.
    target : Target
        Target model.
    signal : (H, W) array
        Noise-free signal, 1 at full scale.
    level : callable
        Function that returns the mean of ``signal``.
    silhouette_inside : float
        Share of the target's silhouette inside the image.
    amodal : Box or None
        Bounding box of the whole target, or None.
    wireframe : bool
        True to list each edge with its visible intervals.
    software : Software
        Versions to record.
    """
    mesh = joined_mesh(target)
    views = view_edges(scene.camera, scene.camera_from_target, target, mesh)
    share = wireframe_step_share(scene, views, signal, level())
    reason = infeasible_reason(silhouette_inside, share, amodal)
    corners = box_3d_m(target)
    return Truth(
        epoch_utc=scene.epoch_utc,
        t_s=scene.t_s,
        frame_index=scene.frame_index,
        seed=scene.seed,
        q_camera_from_target_wxyz=scene.q_camera_from_target_wxyz,
        t_camera_from_target_m=scene.t_camera_from_target_m,
        camera=scene.camera,
        keypoints=label_keypoints(scene, target, mesh, signal),
        box_px=None,
        box_amodal_px=amodal,
        sun_direction_camera=scene.sun_direction_camera,
        sun_visible_fraction=scene.sun_visible_fraction,
        feasible=reason == "",
        infeasible_reason=reason,
        silhouette_inside=silhouette_inside,
        wireframe_step_share=share,
        image_sha256="",
        mask_sha256="",
        record=SceneRecord.from_scene(scene),
        software=software,
        exposure_s=scene.exposure_s,
        earth_direction_camera=scene.earth_direction_camera,
        box_3d_target_m=tuple(vec3(p) for p in corners),
        box_3d_px=tuple(
            pixel_or_none(p) for p in scene.camera.project(scene.camera_from_target.apply(corners))
        ),
        wireframe=tuple(_edge_label(view) for view in views) if wireframe else (),
        row_poses=row_poses(scene),
    )


def row_poses(scene: SceneState) -> tuple[RowPose, ...]:
    """Return the poses at `ROW_POSES` rows of a rolling shutter, from first to last; none for a global shutter.

    Rates are constant during the exposure, so linear interpolation of the position and spherical interpolation of the
    attitude give the exact pose of every row.
    """
    if not scene.shutter.is_rolling:
        return ()
    height = scene.camera.height_px
    rows = np.unique(np.rint(np.linspace(0, height - 1, min(height, ROW_POSES))).astype(int))
    poses = []
    for row in rows:
        dt = float(scene.shutter.row_time_s(row, height))
        row_scene = propagated_scene(scene, dt)
        poses.append(
            RowPose(
                row_px=int(row),
                dt_s=dt,
                q_camera_from_target_wxyz=row_scene.q_camera_from_target_wxyz,
                t_camera_from_target_m=row_scene.t_camera_from_target_m,
            )
        )
    return tuple(poses)


def _edge_label(view: ProjectedEdge) -> WireLabel:
    (x0, y0), (x1, y1) = (map(float, end) for end in view.ends_px)
    return WireLabel(name=view.edge.name, ends_px=((x0, y0), (x1, y1)), visible=view.intervals)


@cache
def _flyaround_version() -> str:
    return version("flyaround")
