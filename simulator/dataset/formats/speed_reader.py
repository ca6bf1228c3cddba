"""Readers of folders like SPEED, SPEED+ and SHIRT: a JSON list of file names, quaternions and positions.

SPEED: ``train.json`` beside ``images/train/``. SPEED+: ``camera.json``, and in each of ``synthetic``, ``lightbox`` and
``sunlamp`` its lists beside ``images/``. SHIRT: ``roe1/roe1.json`` beside ``roe1/lightbox/images/`` and
``roe1/synthetic/images/``. ``q_vbs2tango`` is q_camera_from_target, scalar first, and is copied.

References
----------
Kisantal et al. (2020), Satellite Pose Estimation Challenge. Park et al. (2022), SPEED+: Next-Generation Dataset for
Spacecraft Pose Estimation across Domain Gap. Park and D'Amico (2023), Adaptive Neural-Network-Based Unscented Kalman
Filter for Robust Pose Tracking of Noncooperative Spacecraft (SHIRT).
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from flyaround.simulator.dataset.formats.posed_pictures import (
    PosedPicture,
    PosedPictures,
    checked_pose,
    find_camera,
    find_picture,
    read_json,
)
from flyaround.simulator.errors import UserError

NOT_LISTS = ("camera.json", "dataset.json", "split.json")
QUATERNION = {"speed": "q_vbs2tango", "speedplus": "q_vbs2tango_true", "shirt": "q_vbs2tango_true"}
POSITION = "r_Vo2To_vbs_true"
SHIRT_SPACING_S = 5.0  # between pictures of a trajectory
SHIRT_LISTS = ("roe1.json", "roe2.json")


def read_speed(place: Path) -> PosedPictures | None:
    """Read a folder like SPEED; None for another kind. Raises as `read_speedplus` does."""
    return _read(place, "speed")


def read_speedplus(place: Path) -> PosedPictures | None:
    """Read a domain's folder of SPEED+ or one of its lists; None for a folder of another kind.

    Raises
    ------
    UserError
        If it is one of several such sets, has images without poses, or an image is missing.
    """
    return _read(place, "speedplus")


def read_shirt(place: Path) -> PosedPictures | None:
    """Read a trajectory's folder of SHIRT, `lightbox` or `synthetic`; None for a folder of another kind.

    Raises as `read_speedplus` does.
    """
    return _read(place, "shirt")


def _read(place: Path, kind: str) -> PosedPictures | None:
    lists = [place] if place.is_file() else _lists(place, kind)
    if kind == "shirt":
        lists = [path for path in lists if path.name in SHIRT_LISTS]
    else:
        lists = [path for path in lists if path.name not in SHIRT_LISTS]
    rows = {path: _rows(path) for path in lists if path.suffix == ".json"}
    list_kind = "speed" if kind == "speed" else "speedplus"
    readable = {
        path: rows_of_list
        for path, rows_of_list in rows.items()
        if rows_of_list and _kind(rows_of_list) == list_kind
    }
    if not readable:
        bare = [path for path, rows_of_list in rows.items() if rows_of_list and _kind(rows_of_list) == ""]
        if bare and kind == "speedplus":
            raise UserError(
                f"{bare[0]} has no poses (the public test lists have none); give a list with poses, such as train.json"
            )
        return None
    if len(readable) > 1:
        names = ", ".join(str(path) for path in readable)
        raise UserError(f"{place} holds several sets ({names}); give one of these lists")
    (labels, rows_of_list), *_ = readable.items()
    folders = _picture_folders(place, labels, kind)
    pictures = []
    for k, row in enumerate(rows_of_list):
        source = f"{labels} entry {k + 1}"
        if not isinstance(row, dict) or QUATERNION[kind] not in row or POSITION not in row:
            raise UserError(f"{source} has no {QUATERNION[kind]} or no {POSITION}; give a list with poses")
        pose = checked_pose(row[QUATERNION[kind]], row[POSITION], source)
        name = row.get("filename")
        t_s = SHIRT_SPACING_S * k if kind == "shirt" else 0.0
        pictures.append(PosedPicture(str(name), find_picture(labels, folders, name), pose, t_s))
    return PosedPictures(labels, tuple(pictures), find_camera(labels.parent), list_kind, "tango")


def _lists(folder: Path, kind: str) -> list[Path]:
    """Return the lists of a folder or its subfolders; for a SHIRT image folder the list above it."""
    levels = [folder.glob("*.json"), folder.glob("*/*.json")]
    if kind == "shirt":
        levels.insert(0, folder.parent.glob("*.json"))
    for level in levels:
        lists = sorted(path for path in level if path.name not in NOT_LISTS and path.is_file())
        if lists:
            return lists
    return []


def _rows(path: Path) -> list[Any]:
    value = read_json(path)
    return value if isinstance(value, list) else []


def _kind(rows: list[Any]) -> str | None:
    """Return the kind of a list by its first entry: empty for one without poses, None for an unknown one."""
    first = rows[0]
    if not isinstance(first, dict) or "filename" not in first:
        return None
    for name in ("speedplus", "speed"):
        if QUATERNION[name] in first:
            return name
    return ""


def _picture_folders(place: Path, labels: Path, kind: str) -> list[Path]:
    folder = labels.parent
    if kind == "shirt":
        if place.is_dir() and place != folder:
            return [place / "images", place]
        domains = [name for name in ("lightbox", "synthetic") if (folder / name).is_dir()]
        if len(domains) > 1:
            raise UserError(
                f"{place} has pictures of {' and '.join(domains)}; give one of these folders within it"
            )
        return [*(folder / name / "images" for name in domains), folder / "images", folder]
    return [folder / "images" / labels.stem, folder / "images", folder]
