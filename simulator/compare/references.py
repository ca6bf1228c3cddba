"""Reference images and their known poses: from our records, or SPEED's label lists."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np

from flyaround.simulator.camera.encoding import decode
from flyaround.simulator.dataset.formats.posed_pictures import checked_pose, read_json
from flyaround.simulator.dataset.formats.speed_reader import POSITION, QUATERNION
from flyaround.simulator.errors import UserError
from flyaround.simulator.labels.truth import read_truth
from flyaround.simulator.world.frames.pose import Pose

if TYPE_CHECKING:
    from flyaround.simulator.camera.lens.camera_model import Camera
    from flyaround.simulator.runtime.arrays import ByteArray

SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff")
# label layers of our data sets
SKIPPED = (
    ".mask.png",
    ".amodal.png",
    ".parts.png",
    ".normals.png",
    ".clean.png",
)

# Longest side of a reference image [px]; larger ones are reduced.
MAX_SIDE_PX = 2048

# Shortest side of a reference image [px], that of a camera file's.
MIN_SIDE_PX = 16


@dataclass(frozen=True, eq=False)
class Reference:
    """A reference image.

    Parameters
    ----------
    path : Path
        Image file.
    image : (H, W) uint8 array
        Linear, shrunk to at most `MAX_SIDE_PX` a side.
    camera : Camera
        Assumed camera, at that size.
    pose : Pose or None
        Camera-from-target pose, if a record states it.
    """

    path: Path
    image: ByteArray
    camera: Camera
    pose: Pose | None


def read_references(folder: Path, camera: Camera, count: int, labels: Path | None = None) -> list[Reference]:
    """Read up to ``count`` images of a folder, evenly over the sorted names.

    Parameters
    ----------
    folder : Path
        Folder of the images.
    camera : Camera
        Assumed camera: its focal length is scaled to each image's width, its principal point keeps its offset from the
        centre. A truth record next to an image (same name, .json) takes precedence.
    count : int
        Maximum number of images.
    labels : Path, optional
        List of ``filename q_vbs2tango r_Vo2To_vbs_true`` in SPEED's or SPEED+'s format.

    Returns
    -------
    list of Reference
        Images, reduced to `MAX_SIDE_PX`, with camera and pose where they are known.

    Raises
    ------
    UserError
        If the folder, the list or an image cannot be read, the folder has no image, or one is too narrow.
    """
    if not folder.is_dir():
        raise UserError(f"there is no folder {folder}; name the folder of pictures with --reference")
    paths = sorted(
        p for p in folder.iterdir() if p.suffix.lower() in SUFFIXES and not p.name.endswith(SKIPPED)
    )
    if not paths:
        raise UserError(f"folder {folder} has no picture; allowed are files in {', '.join(SUFFIXES)}")
    if len(paths) > count:
        paths = [paths[k] for k in np.unique(np.linspace(0, len(paths) - 1, count).astype(int))]
    poses = {} if labels is None else read_speed_labels(labels)
    return [_read(path, camera, poses.get(path.name)) for path in paths]


def _read(path: Path, camera: Camera, pose: Pose | None) -> Reference:
    image = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION)
    if image is None:
        raise UserError(f"{path} is not a picture that OpenCV reads; take it out of the folder or convert it")
    record = path.with_suffix(".json")
    if pose is None and record.is_file():
        truth = read_truth(record)
        camera = truth.camera
        pose = Pose("camera", "target", truth.q_camera_from_target_wxyz, truth.t_camera_from_target_m)
    if camera.pixel_encoding != "linear":
        image = np.rint(255 * decode(np.arange(256) / 255, camera.pixel_encoding)).astype(np.uint8)[image]
        camera = replace(camera, encoding="linear")
    shrink = min(MAX_SIDE_PX / max(image.shape), 1.0)
    if shrink * min(image.shape) < MIN_SIDE_PX:
        raise UserError(
            f"{path} is {image.shape[1]} x {image.shape[0]} pixels: of one that fits into {MAX_SIDE_PX} pixels, the "
            f"shorter side must have {MIN_SIDE_PX}; take it out of the folder"
        )
    if shrink < 1:
        image = cv2.resize(image, None, fx=shrink, fy=shrink, interpolation=cv2.INTER_AREA)
    return Reference(
        path, np.asarray(image, np.uint8), resize_camera(camera, image.shape[1], image.shape[0]), pose
    )


def resize_camera(camera: Camera, width_px: int, height_px: int) -> Camera:
    """Return a camera at another image size: the same horizontal field of view, the same principal-point offset."""
    s = width_px / camera.width_px
    return replace(
        camera,
        width_px=width_px,
        height_px=height_px,
        fx_px=camera.fx_px * s,
        fy_px=camera.fy_px * s,
        cx_px=(width_px - 1) / 2 + s * (camera.cx_px - (camera.width_px - 1) / 2),
        cy_px=(height_px - 1) / 2 + s * (camera.cy_px - (camera.height_px - 1) / 2),
    )


def read_speed_labels(path: Path) -> dict[str, Pose]:
    """Return the poses by file name of a SPEED or SPEED+ list; ``q_vbs2tango`` is q_camera_from_target, scalar first.

    Raises
    ------
    UserError
        If the file is not such a list, or a pose in it is invalid.
    """
    rows = read_json(path)
    if not isinstance(rows, list):
        raise UserError(
            f"{path} is not a list of poses; give SPEED's list of filename, q_vbs2tango, r_Vo2To_vbs_true"
        )
    poses = {}
    for k, row in enumerate(rows):
        source = f"{path} entry {k + 1}"
        fields = row if isinstance(row, dict) else {}
        q = [fields[name] for name in QUATERNION.values() if name in fields]
        if not q or POSITION not in fields or not isinstance(fields.get("filename"), str):
            raise UserError(
                f"{source} has no pose; give SPEED's list of filename, "
                f"{' or '.join(sorted(set(QUATERNION.values())))}, {POSITION}"
            )
        poses[fields["filename"]] = checked_pose(q[0], fields[POSITION], source)
    return poses
