"""Import of foreign images with known poses, as a data set for evaluating estimators."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import msgspec
import numpy as np

from flyaround.simulator.camera.lens.files import load_camera
from flyaround.simulator.dataset.card import CardTarget, DatasetCard, describe_machine
from flyaround.simulator.dataset.formats.exr import MAX_SIDE_PX
from flyaround.simulator.dataset.formats.native import EncodedFrame, encode_png
from flyaround.simulator.dataset.silhouette import silhouette
from flyaround.simulator.errors import UserError
from flyaround.simulator.labels.boxes import mask_box
from flyaround.simulator.labels.feasible import infeasible_reason
from flyaround.simulator.labels.imported import ImportedTruth
from flyaround.simulator.labels.keypoints import pixel_or_none
from flyaround.simulator.labels.layers import pixel_hash
from flyaround.simulator.labels.truth import KeypointLabel, KeypointState
from flyaround.simulator.labels.visibility import occluded_from_camera
from flyaround.simulator.runtime.arrays import vec3
from flyaround.simulator.runtime.untrusted_files import read_regular
from flyaround.simulator.targets.joined_mesh import box_3d_m, joined_mesh
from flyaround.simulator.targets.textures import picture_size

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from flyaround.simulator.camera.lens.camera_model import Camera
    from flyaround.simulator.dataset.formats.posed_pictures import PosedPicture, PosedPictures
    from flyaround.simulator.runtime.arrays import ByteArray
    from flyaround.simulator.targets.model import Target
    from flyaround.simulator.world.frames.pose import Pose

# Maximum size of an imported image [bytes].
MAX_PICTURE_BYTES = 500_000_000
COLOUR_SAMPLES = 8  # images tested for colour, evenly over the set
# an image is in colour if this share of pixels has bands this far apart, of 255
MIN_COLOURED_SHARE, MIN_COLOUR_SPREAD_DN = (
    0.01,
    16,
)

SCHEMA = "flyaround.imported"
"""Schema name of the card's scenario for imported images."""


def camera_of(picture_set: PosedPictures, camera_name: str | None) -> Camera:
    """Return the camera of imported images: the named one, the data set's own, or the default of its format.

    Raises
    ------
    UserError
        If the camera is unknown, or the images have another size.
    """
    if camera_name is not None:
        camera, name = load_camera(camera_name), f"camera {camera_name}"
    elif picture_set.camera is not None:
        camera, name = picture_set.camera, "the set's camera.json"
    elif picture_set.default_camera:
        camera, name = load_camera(picture_set.default_camera), f"camera {picture_set.default_camera}"
    else:
        raise UserError(
            f"{picture_set.labels.parent} has no camera.json; name the camera that took it with --camera"
        )
    for picture in picture_set.pictures:
        size = _size(picture)
        if size != (camera.width_px, camera.height_px):
            raise UserError(
                f"picture {picture.path} is {size[0]} x {size[1]} pixels, {name} {camera.width_px} x "
                f"{camera.height_px}; give the camera that took it with --camera"
            )
    lacks_encoding = picture_set.camera is None and camera.pixel_encoding == "linear"
    return replace(camera, encoding=picture_set.encoding) if lacks_encoding else camera


def is_coloured(image: NDArray[np.unsignedinteger]) -> bool:
    """Return True if an image (H, W) or (H, W, 3) is in colour.

    Returns
    -------
    bool
        True if colour is notable in more than `MIN_COLOURED_SHARE` of the pixels: a few in a grey image are ignored.
    """
    if image.ndim == 2:
        return False
    spread = image.max(axis=2).astype(np.int32) - image.min(axis=2)
    threshold = MIN_COLOUR_SPREAD_DN if image.dtype == np.uint8 else MIN_COLOUR_SPREAD_DN * 257
    return float(np.mean(spread > threshold)) > MIN_COLOURED_SHARE


def check_grey(picture_set: PosedPictures) -> None:
    """Raise if sampled images are in colour although the default camera of the format is monochrome.

    Raises
    ------
    UserError
        If an image is in colour, so that it was taken by another camera with an unknown lens.
    """
    if not picture_set.default_camera or not picture_set.pictures:
        return
    indices = np.linspace(
        0, len(picture_set.pictures) - 1, min(len(picture_set.pictures), COLOUR_SAMPLES)
    ).astype(int)
    for k in np.unique(indices):
        path = picture_set.pictures[int(k)].path
        if is_coloured(read_picture(path)):
            raise UserError(
                f"picture {path} is in colour and camera {picture_set.default_camera} expects grey ones; name the "
                "camera that took it with --camera, or save the pictures in grey"
            )


def import_card(picture_set: PosedPictures, camera: Camera, target: Target, form: str) -> DatasetCard:
    """Return the card of a data set of imported images, marked incomplete."""
    source = f"{picture_set.labels.resolve().parent.name}/{picture_set.labels.name}"
    return DatasetCard(
        scenario_name=source,
        scenario={"schema": SCHEMA, "format": form, "source": source},
        seed=0,
        n_frames=len(picture_set.pictures),
        every_s=None,
        complete=False,
        formats=("native",),
        camera=camera,
        image_bits=8 * read_picture(picture_set.pictures[0].path).itemsize,
        target=CardTarget.from_target(target),
        machine=describe_machine("", "", ""),
        licence="pictures and poses are those of the set that they were imported from, and under its licence",
    )


def imported_frames(
    picture_set: PosedPictures, camera: Camera, target: Target
) -> Iterator[tuple[int, EncodedFrame]]:
    """Yield the frames of imported images, in order, with their numbers.

    Raises
    ------
    UserError
        If an image cannot be read.
    """
    for k, picture in enumerate(picture_set.pictures):
        image = read_picture(picture.path)
        truth, mask = label_imported(k, picture, image, camera, target)
        record = msgspec.json.format(msgspec.json.encode(truth), indent=1) + b"\n"
        yield k, EncodedFrame(encode_png(image), encode_png(mask), record, {})


def read_picture(path: Path) -> NDArray[np.unsignedinteger]:
    """Read an image of 8 or 16 bits; transparency is dropped.

    Returns
    -------
    (H, W) or (H, W, 3) array
        Mono or RGB, uint8 or uint16; three equal bands give a mono image.

    Raises
    ------
    UserError
        If it is not an image, or too large.
    """
    data = _data(path)
    image: Any = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED) if data else None
    if image is None or image.dtype.type not in (np.uint8, np.uint16):
        raise UserError(f"cannot read picture {path}; save it as JPEG or PNG with 8 or 16 bits")
    if image.ndim == 2:
        return np.asarray(image)
    bands = image[..., 2::-1] if image.shape[2] >= 3 else image[..., :1]
    is_grey = bool((bands == bands[..., :1]).all())
    return np.ascontiguousarray(bands[..., 0] if is_grey else bands)


def label_imported(
    k: int, picture: PosedPicture, image: NDArray[np.unsignedinteger], camera: Camera, target: Target
) -> tuple[ImportedTruth, ByteArray]:
    """Return the record of image k and its mask (H, W), derived from pose, camera and model."""
    pose = picture.camera_from_target
    outline = silhouette(camera, pose, target)
    reason = infeasible_reason(outline.inside, 1.0, outline.box_amodal_px)
    corners = box_3d_m(target)
    truth = ImportedTruth(
        source=picture.name,
        t_s=picture.t_s,
        frame_index=k,
        q_camera_from_target_wxyz=pose.q_wxyz,
        t_camera_from_target_m=pose.t_m,
        camera=camera,
        keypoints=_keypoints(camera, pose, target),
        box_px=mask_box(outline.mask),
        box_amodal_px=outline.box_amodal_px,
        feasible=reason == "",
        infeasible_reason=reason,
        silhouette_inside=outline.inside,
        image_sha256=pixel_hash(image),
        mask_sha256=pixel_hash(outline.mask),
        box_3d_target_m=tuple(vec3(p) for p in corners),
        box_3d_px=tuple(pixel_or_none(p) for p in camera.project(pose.apply(corners))),
    )
    return truth, outline.mask


def _keypoints(camera: Camera, pose: Pose, target: Target) -> tuple[KeypointLabel, ...]:
    points = np.array([k.position_m for k in target.keypoints], float).reshape(-1, 3)
    pixels = camera.project(pose.apply(points))
    inside = camera.contains(pixels)
    is_hidden = np.zeros(len(points), bool)
    is_hidden[inside] = occluded_from_camera(joined_mesh(target), points[inside], pose)
    states: list[KeypointState] = [
        "out_of_frame" if not on else "self_occluded" if behind else "visible"
        for on, behind in zip(inside, is_hidden, strict=True)
    ]
    return tuple(
        KeypointLabel(name=k.name, target_m=k.position_m, pixel_px=pixel_or_none(pixel), state=state)
        for k, pixel, state in zip(target.keypoints, pixels, states, strict=True)
    )


def _data(path: Path) -> bytes:
    try:
        data = read_regular(path, MAX_PICTURE_BYTES)
    except OSError as error:
        raise UserError(
            f"cannot read picture {path}: {error.strerror or error}; check the data set"
        ) from error
    size = picture_size(data)
    return b"" if size is None or max(size) > MAX_SIDE_PX else data


def _size(picture: PosedPicture) -> tuple[int, int]:
    try:
        with picture.path.open("rb") as file:
            size = picture_size(file.read(1 << 20))
    except OSError as error:
        raise UserError(
            f"cannot read picture {picture.path}: {error.strerror or error}; check the data set"
        ) from error
    if size is None:
        raise UserError(f"cannot read picture {picture.path}; save it as JPEG or PNG with 8 or 16 bits")
    return size
