"""BOP: a scene of images with poses, masks, depth and the model as a mesh in millimetres.

``SPLIT/000000/rgb`` or ``gray``, ``mask``, ``mask_visib`` and, with the layer, ``depth``; ``scene_gt.json``,
``scene_gt_info.json`` and ``scene_camera.json``; ``models/obj_000001.ply`` (one for each shape that ``model_error_mm``
made) and ``models_info.json``; ``camera.json``. Nothing occludes the craft, so its whole mask within the image is its
visible one. Pixel (0, 0) is a centre, as here.

References
----------
Hodan et al. (2018), BOP: Benchmark for 6D Object Pose Estimation; docs/bop_datasets_format.md of its toolkit.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import cv2
import msgspec
import numpy as np
from scipy.spatial.distance import pdist

from flyaround.simulator.dataset.formats.base import (
    DatasetFormat,
    FormatOutput,
    FormatWriter,
    encoding_key,
    lens_problem,
)
from flyaround.simulator.dataset.formats.native import encode_png
from flyaround.simulator.dataset.formats.speed_writer import json_bytes
from flyaround.simulator.errors import UserError
from flyaround.simulator.geometry.triangle_fill import filled_mask
from flyaround.simulator.labels.boxes import NEAREST_M
from flyaround.simulator.labels.truth import Truth
from flyaround.simulator.targets.joined_mesh import joined_mesh
from flyaround.simulator.targets.library import load_target
from flyaround.simulator.world.frames.rotation import matrix_from_quat

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from flyaround.simulator.camera.lens.camera_model import Camera
    from flyaround.simulator.dataset.card import DatasetCard
    from flyaround.simulator.dataset.formats.labelled_frame import LabelledFrame
    from flyaround.simulator.runtime.arrays import FloatArray
    from flyaround.simulator.targets.model import Target
    from flyaround.simulator.world.frames.pose import Pose

# Millimetres per metre: BOP stores millimetres.
MM = 1000.0
_CANVAS_PX = 2048  # larger canvases around the image are counted on a coarser grid
FOLDERS = {"": "train", "train": "train", "validation": "val", "test": "test"}


class BopWriter:
    """Writer of data sets in the BOP format: one scene per split, and a model for each rendered shape.

    Raises
    ------
    UserError
        If the data set's target is not the one of that name here.
    """

    def __init__(self, output: FormatOutput, card: DatasetCard) -> None:
        self._output, self._card = output, card
        target = load_target(card.target.name)
        if target.sha256 != card.target.sha256:
            raise UserError(
                f"format bop cannot hold this data set: its model is target {target.name} "
                f"{card.target.sha256[:12]}, here that is {target.sha256[:12]}"
            )
        self._target = target
        self._scenes: dict[str, dict[str, dict[str, Any]]] = {}
        self._models: dict[tuple[float, ...], int] = {}
        self._infos: dict[str, dict[str, Any]] = {}

    def write(self, frame: LabelledFrame) -> None:
        """Write image, masks and depth; the rest is collected for the scene's files."""
        scene = f"{FOLDERS[frame.split]}/000000"
        k, truth = frame.number, frame.truth
        kind = "gray" if frame.image.ndim == 2 else "rgb"
        self._output.write(f"{scene}/{kind}/{k:06d}.png", frame.read("png"))
        for name in ("mask", "mask_visib"):
            self._output.write(f"{scene}/{name}/{k:06d}_000000.png", frame.read("mask.png"))
        scale = 1.0
        if "depth" in frame.layers:
            depth_mm = np.nan_to_num(frame.layer("depth") * MM)
            # 16 bits reach 65 m in steps of 1 mm; nearer craft get finer steps
            scale = max(np.ceil(float(depth_mm.max()) / 65535 * 10) / 10, 0.1)
            self._output.write(
                f"{scene}/depth/{k:06d}.png", encode_png(np.rint(depth_mm / scale).astype(np.uint16))
            )
        R = matrix_from_quat(truth.q_camera_from_target_wxyz)
        target = truth.scene.target.drawn(self._target) if isinstance(truth, Truth) else self._target
        files = self._scenes.setdefault(scene, {"scene_gt": {}, "scene_gt_info": {}, "scene_camera": {}})
        files["scene_gt"][str(k)] = [
            {
                "cam_R_m2c": R.ravel().tolist(),
                "cam_t_m2c": [v * MM for v in truth.t_camera_from_target_m],
                "obj_id": self._model_of(frame, target),
            }
        ]
        files["scene_gt_info"][str(k)] = [gt_info(frame, target)]
        files["scene_camera"][str(k)] = {"cam_K": frame.camera.K.ravel().tolist(), "depth_scale": scale}

    def _model_of(self, frame: LabelledFrame, target: Target) -> int:
        """Return the number of the shape in a frame; a new one is written."""
        truth = frame.truth
        variation = truth.scene.target.variation if isinstance(truth, Truth) else msgspec.UNSET
        stretch = (
            () if isinstance(variation, msgspec.UnsetType) else tuple(np.ravel(variation.stretch).tolist())
        )
        shape = stretch if any(stretch) else ()
        if shape not in self._models:
            number = self._models[shape] = len(self._models) + 1
            self._output.write(f"models/obj_{number:06d}.ply", mesh_ply(target))
            self._infos[str(number)] = model_info(target)
        return self._models[shape]

    def finish(self) -> None:
        """Write the scenes' files, the models' sizes and the camera."""
        for scene, files in self._scenes.items():
            for name, value in files.items():
                self._output.write(f"{scene}/{name}.json", json_bytes(value))
        camera = self._card.camera
        table = {
            "fx": camera.fx_px,
            "fy": camera.fy_px,
            "cx": camera.cx_px,
            "cy": camera.cy_px,
            "width": camera.width_px,
            "height": camera.height_px,
            "depth_scale": 1.0,
            **encoding_key(camera),
        }
        self._output.write("camera.json", json_bytes(table))
        self._output.write("models/models_info.json", json_bytes(self._infos))


def gt_info(frame: LabelledFrame, target: Target) -> dict[str, Any]:
    """Return an entry of ``scene_gt_info.json`` by the definitions of the toolkit's `calc_gt_info.py`.

    Boxes are x, y of the first pixel and the offset of the last, -1 if nothing is visible; the silhouette is clipped at
    the image's size beyond the image.
    """
    rows, columns = np.nonzero(frame.mask)
    visible, inside = len(rows), frame.truth.silhouette_inside
    amodal, visible_box, obj = visible, [-1, -1, -1, -1], [-1, -1, -1, -1]
    bounds = np.full((2, 2), np.nan)
    if inside < 1 or not visible:
        outside = pixels_beside(frame.camera, frame.pose, target)
        if outside is None:  # no raster reaches behind the camera
            amodal = round(visible / (inside or 1.0))
        else:
            amodal, bounds = visible + outside[0], outside[1]
    if visible:
        image_box = np.array([[columns.min(), rows.min()], [columns.max(), rows.max()]])
        visible_box = _box_entry(*image_box)
        obj = _box_entry(np.fmin(image_box[0], bounds[0]), np.fmax(image_box[1], bounds[1]))
    return {
        "bbox_obj": obj,
        "bbox_visib": visible_box,
        "px_count_all": amodal,
        "px_count_valid": visible,  # depth is valid on the whole mask
        "px_count_visib": visible,
        "visib_fract": visible / amodal if amodal else 0.0,
    }


def pixels_beside(camera: Camera, pose: Pose, target: Target) -> tuple[int, FloatArray] | None:
    """Return the silhouette's pixels outside a pinhole's image, up to its own size beyond each edge.

    Returns
    -------
    tuple or None
        Their number, and the (2, 2) x, y of the first and last column and row, NaN if there are none; None near the
        camera.
    """
    mesh = joined_mesh(target)
    in_camera = pose.apply(mesh.positions_m)
    if in_camera[:, 2].min() <= NEAREST_M:
        return None
    size = np.array([camera.width_px, camera.height_px])
    vertices = camera.project(in_camera) + size + 0.5  # in a canvas of three by three images
    extent = np.diff(np.clip([vertices.min(axis=0), vertices.max(axis=0)], 0, 3 * size), axis=0)
    scale = min(1.0, _CANVAS_PX / max(float(np.sqrt(extent.prod())), 1.0))
    width, height = np.ceil(3 * size * scale).astype(int).tolist()
    grid = filled_mask(vertices[mesh.triangles] * scale - 0.5, (width, height))
    grid[tuple(slice(*np.rint(np.array([n, 2 * n]) * scale).astype(int)) for n in size[::-1])] = 0
    x, y, width, height = cv2.boundingRect(grid)
    bounds = np.array([[x, y], [x + width - 1, y + height - 1]]) / scale - size
    count = round(int(np.count_nonzero(grid)) / scale**2)
    return count, bounds if count else np.full((2, 2), np.nan)


def _box_entry(first: NDArray[Any], last: NDArray[Any]) -> list[int]:
    """Return x, y, width and height as the toolkit does: the differences between first and last pixel."""
    return [round(float(v)) for v in (*first, *(last - first))]


def mesh_ply(target: Target) -> bytes:
    """Return the mesh of a target as binary PLY, millimetres."""
    mesh = joined_mesh(target)
    vertices = (mesh.positions_m * MM).astype("<f4")
    faces = np.zeros(len(mesh.triangles), [("corners", "u1"), ("vertices", "<i4", 3)])
    faces["corners"], faces["vertices"] = 3, mesh.triangles
    head = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(vertices)}\n"
        "property float x\nproperty float y\nproperty float z\n"
        f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    return head.encode() + vertices.tobytes() + faces.tobytes()


def model_info(target: Target) -> dict[str, Any]:
    """Return size and symmetries of a target for ``models_info.json``, millimetres."""
    mesh = joined_mesh(target)
    low, high = mesh.positions_m.min(axis=0) * MM, mesh.positions_m.max(axis=0) * MM
    info: dict[str, Any] = {"diameter": float(pdist(mesh.hull_m).max()) * MM}
    for axis, start, size in zip("xyz", low.tolist(), (high - low).tolist(), strict=True):
        info |= {f"min_{axis}": start, f"size_{axis}": size}
    rotations = []
    for q in target.symmetry:
        pose = np.eye(4)
        pose[:3, :3] = matrix_from_quat(q)
        if not np.allclose(pose, np.eye(4)):
            rotations.append(pose.ravel().tolist())
    return info | ({"symmetries_discrete": rotations} if rotations else {})


def _bop(output: FormatOutput, card: DatasetCard) -> FormatWriter:
    return BopWriter(output, card)


BOP = DatasetFormat(
    name="bop",
    title="BOP",
    carries="image, pose, masks, depth where the layer is, the camera's matrix, and the model as a mesh in millimetres",
    lacks="keypoints, lens distortion, materials and other layers",
    writer=_bop,
    problem=lens_problem,
)
