"""Target model of the board: wireframe, occluders, contours, faces and trained network."""

from __future__ import annotations

import base64
import json
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Dict, Optional, Tuple, Union

import numpy as np

from flyaround.hil.board.errors import BoardModelError
from flyaround.hil.board.estimation.faces import Faces
from flyaround.hil.board.estimation.occluding_contours import Outlines
from flyaround.hil.board.files import read_bounded
from flyaround.hil.board.json_values import BAD_VALUE, indices, number, numbers

Array = np.ndarray

SCHEMA = "flyaround.board_model"
VERSION = 1  # of the file format; a file of another version is refused

# Largest accepted size of a board model file [bytes].
MAX_BYTES = 100_000_000


@dataclass(frozen=True)
class WireEdge:
    """Straight edge of the wireframe.

    Parameters
    ----------
    name : str
        Name of the edge.
    a_m : (3,) array
        First end, target frame [m].
    b_m : (3,) array
        Second end, target frame [m].
    normals : (N, 3) array
        Outward normals of the adjacent faces; N = 0 for members visible from everywhere.
    radius_m : float, optional
        Radius of a round member, whose outline is used instead of its axis.
    """

    name: str
    a_m: Array
    b_m: Array
    normals: Array
    radius_m: float = 0.0


@dataclass(frozen=True, eq=False)
class BoardModel:
    """Model of the target as the estimators use it.

    Parameters
    ----------
    name : str
        Name of the target.
    sha256 : str
        Hash of the target file.
    keypoints : dict of str to (3,) array
        Positions by name, target frame [m].
    wireframe : tuple of WireEdge
        Edges.
    vertices_m : (V, 3) array
        Vertices of the closed mesh that occludes edges [m]; may be empty.
    triangles : (T, 3) array
        Vertex indices of its triangles.
    symmetry_wxyz : (N, 4) array
        Rotations under which the target looks nearly the same.
    mass_kg : float, optional
        Mass; 0 if unknown.
    outlines : Outlines, optional
        Occluding contours from all sides; None in older files.
    faces : Faces, optional
        Outer faces in BSP order; None if there are too many.
    network : bytes, optional
        File of the keypoint head trained for this target, see ``keypoints.head``.
    """

    name: str
    sha256: str
    keypoints: Dict[str, Array]
    wireframe: Tuple[WireEdge, ...]
    vertices_m: Array
    triangles: Array
    symmetry_wxyz: Array
    mass_kg: float = 0.0
    outlines: Optional[Outlines] = None
    faces: Optional[Faces] = None
    network: Optional[bytes] = None

    @staticmethod
    def read(path: Union[str, Path]) -> BoardModel:
        """Read a board model file.

        Returns
        -------
        BoardModel
            Model in the target frame [m].

        Raises
        ------
        BoardModelError
            If the file is missing, too large, not a regular file, not JSON, or not a board model of a known version.
        """
        try:
            data = json.loads(read_bounded(path, MAX_BYTES).decode("utf-8"))
        except OSError as error:
            raise BoardModelError(f"board model {path} cannot be read: {error.strerror}") from error
        except (ValueError, RecursionError) as error:
            raise BoardModelError(f"board model {path} is not JSON: {error}") from error
        return BoardModel.from_dict(data)

    @staticmethod
    def from_dict(data: Dict[str, Any]) -> BoardModel:
        """Make a model from the parsed JSON object.

        Returns
        -------
        BoardModel
            Model in the target frame [m].

        Raises
        ------
        BoardModelError
            If a field is missing, has the wrong shape or holds an impossible number.
        """
        if not isinstance(data, dict) or data.get("schema") != SCHEMA or data.get("version") != VERSION:
            raise BoardModelError(f"not a board model: expected schema {SCHEMA!r}, version {VERSION}")
        try:
            edges = tuple(
                WireEdge(
                    str(e["name"]),
                    numbers(e["a_m"], 3),
                    numbers(e["b_m"], 3),
                    numbers(e.get("normals", []), -1, 3),
                    number(e.get("radius_m", 0.0), least=0.0),
                )
                for e in data["wireframe"]
            )
            occluders = data.get("occluders") or {}
            vertices = numbers(occluders.get("vertices_m", []), -1, 3)
            triangles = indices(occluders.get("triangles", []), -1, 3)
            model = BoardModel(
                name=str(data["name"]),
                sha256=str(data["sha256"]),
                keypoints={str(k["name"]): numbers(k["position_m"], 3) for k in data.get("keypoints", [])},
                wireframe=edges,
                vertices_m=vertices,
                triangles=triangles,
                symmetry_wxyz=_rotations(data.get("symmetry_wxyz", [])),
                mass_kg=number(data.get("mass_kg", 0.0), least=0.0),
                outlines=None if data.get("outlines") is None else Outlines.from_dict(data["outlines"]),
                faces=None if data.get("faces") is None else Faces.from_dict(data["faces"]),
                network=None
                if data.get("network") is None
                else base64.b64decode(data["network"], validate=True),
            )
        except BAD_VALUE as error:
            raise BoardModelError(f"board model has a bad field: {error!r:.200}") from error
        if not edges:
            raise BoardModelError("board model has no wireframe edges")
        if triangles.size and (triangles.min() < 0 or triangles.max() >= len(vertices)):
            raise BoardModelError("board model: a triangle refers to a missing vertex")
        return model

    @property
    def centre_m(self) -> Array:
        """Centre of the wireframe's bounding box (3,) [m]."""
        p = self.ends_m
        return 0.5 * (p.min(axis=0) + p.max(axis=0))

    @property
    def radius_m(self) -> float:
        """Radius of the sphere about ``centre_m`` that contains the wireframe [m]."""
        return float(np.linalg.norm(self.ends_m - self.centre_m, axis=1).max())

    @cached_property
    def ends_m(self) -> Array:
        """Ends of all edges (2E, 3) [m]."""
        return np.array([p for e in self.wireframe for p in (e.a_m, e.b_m)])


def _rotations(value: Any) -> Array:  # noqa: ANN401 - parsed JSON
    quaternions = numbers(value, -1, 4)
    # a thousandth allows for rounding in the file
    if not np.all(np.abs(np.linalg.norm(quaternions, axis=1) - 1) < 1e-3):
        raise ValueError("a symmetry is not a unit quaternion")
    return quaternions
