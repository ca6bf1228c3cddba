"""Cameras of structure from motion, radiance fields and pose benchmarks: COLMAP, transforms.json, BOP.

COLMAP and transforms.json put (0, 0) at the top-left corner of the image, so half a pixel is subtracted from their
principal points. BOP counts from the centre of the first pixel.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from flyaround.simulator.camera.lens.formats.keys import Keys, camera_matrix, flat_numbers
from flyaround.simulator.camera.lens.formats.lens import camera_file, unsupported_model
from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.untrusted_files import whole_number

if TYPE_CHECKING:
    from flyaround.simulator.camera.lens.distortion import DistortionModel
    from flyaround.simulator.camera.lens.files_native import CameraFile
    from flyaround.simulator.camera.lens.formats.document import Document

# model: names of its parameters; 0 stands for a coefficient that COLMAP does not have
_COLMAP_MODELS: dict[str, tuple[DistortionModel, str, str]] = {
    "SIMPLE_PINHOLE": ("none", "f cx cy", ""),
    "PINHOLE": ("none", "fx fy cx cy", ""),
    "SIMPLE_RADIAL": ("brown_conrady", "f cx cy k1", "k1 0 0 0"),
    "RADIAL": ("brown_conrady", "f cx cy k1 k2", "k1 k2 0 0"),
    "OPENCV": ("brown_conrady", "fx fy cx cy k1 k2 p1 p2", "k1 k2 p1 p2"),
    "FULL_OPENCV": ("brown_conrady", "fx fy cx cy k1 k2 p1 p2 k3 k4 k5 k6", "k1 k2 p1 p2 k3 k4 k5 k6"),
    "OPENCV_FISHEYE": ("kannala_brandt", "fx fy cx cy k1 k2 k3 k4", "k1 k2 k3 k4"),
    "SIMPLE_RADIAL_FISHEYE": ("kannala_brandt", "f cx cy k1", "k1 0 0 0"),
    "RADIAL_FISHEYE": ("kannala_brandt", "f cx cy k1 k2", "k1 k2 0 0"),
}
_NERF_LENS = (
    *("camera_model", "fl_x", "fl_y", "cx", "cy", "w", "h", "k1", "k2", "k3", "k4", "p1", "p2", "is_fisheye"),
    *("camera_angle_x", "camera_angle_y", "sk_x", "sk_y"),
)
_NERF_SCENE = """
    frames aabb_scale aabb scale offset ply_file_path applied_transform applied_scale orientation_override
    integer_depth_scale depth_unit_scale_factor enable_depth_loading from_na train_filenames val_filenames
    test_filenames up white_transparent black_transparent frame_count
"""
_NERF_FRAME = """
    transform_matrix depth_file_path normal_file_path colmap_im_id camera_index rotation frame_index cam_id
    semantic_path timestamp time camera_id file_path mask_path sharpness
"""
_NERF = "NeRF's transforms.json"
_LENGTH_TOLERANCE = 2e-3  # relative tolerance between a focal length and an angle, which files round
CORNER_TO_CENTRE_PX = -0.5  # COLMAP's and NeRF's pixel (0, 0) is a corner, ours the centre of the first pixel


def is_colmap(document: Document) -> bool:
    """Return True for COLMAP's cameras.txt."""
    return document.syntax == "colmap"


def read_colmap(document: Document, source: str) -> CameraFile:
    """Read cameras.txt, whose cameras must be equal.

    Raises
    ------
    UserError
        If they differ, or the lens is not supported.
    """
    cameras = document.table["cameras"]
    number = cameras[0][0]
    name, size, values = lens = _colmap_lens(cameras[0], source)
    if any(_colmap_lens(camera, source) != lens for camera in cameras[1:]):
        raise UserError(f"{source} holds {len(cameras)} cameras that differ; keep the line of one")
    if name not in _COLMAP_MODELS:
        raise unsupported_model(
            f"{source}: COLMAP's model of camera {number}", name, ", ".join(_COLMAP_MODELS)
        )
    model, parameters, order = _COLMAP_MODELS[name]
    if len(values) != len(parameters.split()):
        raise UserError(f"{source}: camera {number} has {len(values)} parameters, {name} takes {parameters}")
    table = {"0": 0.0} | dict(zip(parameters.split(), values, strict=True))
    f = table.get("f", 0.0)
    centre = (table["cx"] + CORNER_TO_CENTRE_PX, table["cy"] + CORNER_TO_CENTRE_PX)
    return camera_file(
        Keys({}, source, "COLMAP's cameras.txt"),
        size,
        (table.get("fx", f), table.get("fy", f), *centre),
        model,
        [table[key] for key in order.split()],
    )


def _colmap_lens(camera: list[str], source: str) -> tuple[str, tuple[int, int], list[float]]:
    """Return model, image size and parameters of a line of cameras.txt."""
    number, name, *side_words = camera[:4]
    where = f"{source}: camera {number[:20]}"
    width, height = map(whole_number, side_words)
    if width is None or height is None:
        raise UserError(f"{where} has an image size of too many digits; correct it")
    return name, (width, height), flat_numbers(camera[4:], where)


def is_nerf(document: Document) -> bool:
    """Return True for transforms.json of instant-ngp and nerfstudio."""
    frames = document.table.get("frames")
    return any(key in document.table for key in ("fl_x", "camera_angle_x")) or (
        isinstance(frames, list)
        and bool(frames)
        and isinstance(frames[0], dict)
        and ("transform_matrix" in frames[0] or "fl_x" in frames[0])
    )


def read_nerf(document: Document, source: str) -> CameraFile:
    """Read the one camera of transforms.json.

    Raises
    ------
    UserError
        If a key is unknown, frames have different cameras, or the lens is not supported.
    """
    keys = Keys(_common_lens(document.table, source), source, _NERF)
    if not keys.find("w") or not keys.find("h"):
        raise keys.error("lacks w and h, the size of its images in pixels; add them")
    width, height = keys.count("w"), keys.count("h")
    for skew in ("sk_x", "sk_y"):
        keys.allow(skew, 0, advice="calibrate with the skew fixed at 0")
    fx = _nerf_focal_px(keys, "fl_x", "camera_angle_x", width)
    fy = _nerf_focal_px(keys, "fl_y", "camera_angle_y", height)
    if fx is None:
        raise keys.error("lacks fl_x or camera_angle_x; add one")
    intrinsics = (
        fx,
        fx if fy is None else fy,
        keys.number("cx", default=width / 2) + CORNER_TO_CENTRE_PX,
        keys.number("cy", default=height / 2) + CORNER_TO_CENTRE_PX,
    )
    model, coefficients = _nerf_lens(keys)
    return camera_file(keys, (width, height), intrinsics, model, coefficients)


def _common_lens(table: dict[str, Any], source: str) -> dict[str, Any]:
    """Return the intrinsics common to all frames; a frame's own take precedence over those of the file."""
    keys = Keys(table, source, _NERF)
    frames = keys.get("frames")
    if not isinstance(frames, list | None):
        raise keys.error("has frames that are not a list; write one")
    common = _lens_keys(keys, _NERF_SCENE)
    lenses = [
        common | _lens_keys(Keys(frame, source, _NERF, f"frames[{k}]."), _NERF_FRAME)
        for k, frame in enumerate(frames or [])
    ]
    if any(lens != lenses[0] for lens in lenses[1:]):
        raise UserError(f"{source} has frames with different cameras; keep the frames of one")
    return lenses[0] if lenses else common


def _lens_keys(keys: Keys, others: str) -> dict[str, Any]:
    """Return the values of the lens under the names of `_NERF_LENS`; raise for a key that is not in ``others``."""
    lens = {name: keys.get(name) for name in _NERF_LENS if keys.find(name)}
    keys.ignore(others)
    keys.done()
    return lens


def _nerf_focal_px(keys: Keys, length: str, angle: str, count: int) -> float | None:
    by_length = keys.number(length) if keys.find(length) else None
    if not keys.find(angle):
        return by_length
    angle_rad = keys.number(angle)
    if not 0 < angle_rad < math.pi:
        raise UserError(
            f"{keys.where}: key {angle} is {angle_rad:g} rad, allowed: more than 0 and less than pi"
        )
    by_angle = count / (2 * math.tan(angle_rad / 2))
    if by_length is None:
        return by_angle
    if abs(by_length - by_angle) > _LENGTH_TOLERANCE * abs(by_length):
        raise UserError(
            f"{keys.where}: key {length} is {by_length:g} px, by {angle} it is {by_angle:g} px; delete one"
        )
    return by_length


def _nerf_lens(keys: Keys) -> tuple[DistortionModel, list[float] | None]:
    model_name = str(keys.get("camera_model") or "").upper()
    fisheye = keys.flag("is_fisheye") or model_name == "OPENCV_FISHEYE"
    if model_name not in ("", "OPENCV", "OPENCV_FISHEYE", "PINHOLE", "SIMPLE_PINHOLE", "PERSPECTIVE"):
        raise unsupported_model(
            f"{keys.where}: key camera_model", model_name, "OPENCV, OPENCV_FISHEYE, PINHOLE"
        )
    if fisheye and model_name not in ("", "OPENCV_FISHEYE"):
        raise UserError(
            f"{keys.where}: keys camera_model and is_fisheye name different lenses; delete the wrong one"
        )
    coefficient_names = [name for name in ("k1", "k2", "k3", "k4", "p1", "p2") if keys.find(name)]
    k1, k2, k3, k4, p1, p2 = (keys.number(name, default=0.0) for name in ("k1", "k2", "k3", "k4", "p1", "p2"))
    if fisheye:
        if p1 or p2:
            raise UserError(f"{keys.where}: keys p1 and p2 do not apply to a fish-eye; delete them")
        return "kannala_brandt", [k1, k2, k3, k4] if coefficient_names else None
    if k4:
        raise UserError(
            f"{keys.where}: key k4 is {k4:g}, a term of the eighth power, which is not supported; calibrate without it"
        )
    if not coefficient_names:
        return "brown_conrady" if model_name == "OPENCV" else "none", None
    return "none" if "PINHOLE" in model_name else "brown_conrady", [k1, k2, p1, p2, k3]


def is_bop(document: Document) -> bool:
    """Return True for BOP's camera.json and scene_camera.json."""
    table = document.table
    return {"fx", "fy", "cx", "cy", "width", "height"} <= table.keys() or _is_scene_camera(table)


def _is_scene_camera(table: dict[str, Any]) -> bool:
    return bool(table) and all(isinstance(v, dict) and "cam_K" in v for v in table.values())


def read_bop(document: Document, source: str) -> CameraFile:
    """Read BOP's camera.json.

    Raises
    ------
    UserError
        If a key is unknown, or it is a scene_camera.json, which has no image size.
    """
    if _is_scene_camera(document.table):
        matrices = [
            camera_matrix(flat_numbers(v["cam_K"], source), f"{source}: cam_K")
            for v in document.table.values()
        ]
        description = "of one camera" if len(set(matrices)) == 1 else "of cameras that differ"
        raise UserError(
            f"{source} is BOP's scene_camera.json {description}, without an image size: give the data set's "
            "camera.json, or write one: width, height, fx, fy, cx, cy"
        )
    keys = Keys(document.table, source, "BOP's camera.json")
    size = (keys.count("width"), keys.count("height"))
    intrinsics = [keys.number(name) for name in ("fx", "fy", "cx", "cy")]
    keys.ignore("depth_scale")
    return camera_file(keys, size, intrinsics, "none", None)
