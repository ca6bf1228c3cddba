"""BOP: a scene of images with poses, masks, depth and the model as a mesh in millimetres.

``SPLIT/000000/rgb`` or ``gray``, ``mask``, ``mask_visib`` and, with the layer, ``depth``; ``scene_gt.json``,
``scene_gt_info.json`` and ``scene_camera.json``; ``models/obj_000001.ply`` and ``models_info.json``; ``camera.json``.
Nothing
stands before the craft, so that its whole mask within the image is its visible one. Pixel (0, 0) is a centre, as here.

References
----------
Hodan et al. (2018), BOP: Benchmark for 6D Object Pose Estimation; docs/bop_datasets_format.md of its toolkit.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial.distance import pdist

from simulator.dataset.formats.base import DatasetFormat, FormatOutput, FormatWriter, lens_problem
from simulator.dataset.formats.native import encode_png
from simulator.dataset.formats.speed_writer import json_bytes
from simulator.errors import UserError
from simulator.targets.joined_mesh import mesh_of
from simulator.targets.library import load_target
from simulator.world.frames.rotation import matrix_from_quat

if TYPE_CHECKING:
    from simulator.dataset.card import DatasetCard
    from simulator.dataset.formats.labelled_frame import LabelledFrame
    from simulator.targets.model import Target

MM = 1000.0
FOLDERS = {"": "train", "train": "train", "validation": "val", "test": "test"}
OBJECT_ID = 1


class BopWriter:
    """Writes BOP: one scene in each split."""

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

    def write(self, frame: LabelledFrame) -> None:
        """Picture, masks and depth; the rest is kept for the scene's files."""
        scene = f"{FOLDERS[frame.split]}/000000"
        k, truth = frame.number, frame.truth
        kind = "gray" if frame.image.ndim == 2 else "rgb"
        self._output.write(f"{scene}/{kind}/{k:06d}.png", frame.read("png"))
        for name in ("mask", "mask_visib"):
            self._output.write(f"{scene}/{name}/{k:06d}_000000.png", frame.read("mask.png"))
        scale = 1.0
        if "depth" in frame.layers:
            depth_mm = np.nan_to_num(frame.layer("depth") * MM)
            # 16 bits reach 65 m at 1 mm, and less coarse for nearer ones
            scale = max(np.ceil(float(depth_mm.max()) / 65535 * 10) / 10, 0.1)
            self._output.write(
                f"{scene}/depth/{k:06d}.png", encode_png(np.rint(depth_mm / scale).astype(np.uint16))
            )
        R = matrix_from_quat(truth.q_camera_from_target_wxyz)
        files = self._scenes.setdefault(scene, {"scene_gt": {}, "scene_gt_info": {}, "scene_camera": {}})
        files["scene_gt"][str(k)] = [
            {
                "cam_R_m2c": R.ravel().tolist(),
                "cam_t_m2c": [v * MM for v in truth.t_camera_from_target_m],
                "obj_id": OBJECT_ID,
            }
        ]
        files["scene_gt_info"][str(k)] = [_info(frame)]
        files["scene_camera"][str(k)] = {"cam_K": frame.camera.K.ravel().tolist(), "depth_scale": scale}

    def finish(self) -> None:
        """The scenes' files, the model and the camera."""
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
        }
        self._output.write("camera.json", json_bytes(table))
        self._output.write(f"models/obj_{OBJECT_ID:06d}.ply", mesh_ply(self._target))
        self._output.write("models/models_info.json", json_bytes({str(OBJECT_ID): model_info(self._target)}))


def _info(frame: LabelledFrame) -> dict[str, Any]:
    truth = frame.truth
    visible = int(np.count_nonzero(frame.mask))
    whole, seen = _whole_box(truth.box_amodal_px), _whole_box(truth.box_px)
    inside = truth.silhouette_inside
    return {
        "bbox_obj": whole,
        "bbox_visib": seen,
        "px_count_all": round(visible / inside) if inside > 0 else 0,
        "px_count_valid": visible,
        "px_count_visib": visible,
        "visib_fract": inside,
    }


def _whole_box(box: tuple[float, float, float, float] | None) -> list[int]:
    """X y width height in whole pixels that a box touches; BOP's for nothing."""
    if box is None:
        return [-1, -1, -1, -1]
    x0, y0 = np.floor(np.asarray(box[:2]) + 0.5).astype(int).tolist()
    x1, y1 = np.ceil(np.asarray(box[2:]) + 0.5).astype(int).tolist()
    return [x0, y0, x1 - x0, y1 - y0]


def mesh_ply(target: Target) -> bytes:
    """The mesh of a target as binary PLY, millimetres."""
    import trimesh  # noqa: PLC0415 - slow to import

    mesh = mesh_of(target)
    solid = trimesh.Trimesh(mesh.positions_m * MM, mesh.triangles, process=False)
    return bytes(solid.export(file_type="ply"))


def model_info(target: Target) -> dict[str, Any]:
    """Size and symmetries of a target as ``models_info.json`` has them, millimetres."""
    mesh = mesh_of(target)
    low, high = mesh.positions_m.min(axis=0) * MM, mesh.positions_m.max(axis=0) * MM
    info: dict[str, Any] = {"diameter": float(pdist(mesh.hull_m).max()) * MM}
    for axis, start, size in zip("xyz", low.tolist(), (high - low).tolist(), strict=True):
        info |= {f"min_{axis}": start, f"size_{axis}": size}
    turns = []
    for q in target.symmetry:
        pose = np.eye(4)
        pose[:3, :3] = matrix_from_quat(q)
        if not np.allclose(pose, np.eye(4)):
            turns.append(pose.ravel().tolist())
    return info | ({"symmetries_discrete": turns} if turns else {})


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
