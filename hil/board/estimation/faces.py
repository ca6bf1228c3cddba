"""Planar faces of the target with their materials, and the BSP tree that sorts them by depth from any viewpoint."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Dict, Tuple

import numpy as np

from flyaround.hil.board.json_values import SMALLEST_M, indices, number, numbers, unpack

Array = np.ndarray

# Quantisation steps of each normal component when faces are grouped by brightness: default, and for curved bodies,
# on which brightness varies with direction as much as between materials.
NORMAL_STEPS, CURVED_NORMAL_STEPS = 3, 6

# Maximum number of groups: a byte numbers each of them lit and in shadow, and the background.
MAX_GROUPS = 127


@dataclass(frozen=True, eq=False)
class Faces:
    """Planar faces with materials, and a BSP tree for back-to-front order from any viewpoint.

    Parameters
    ----------
    corners : (T, 4, 3) array
        Corners of convex planar faces [m]; triangles repeat their last corner.
    normals : (T, 3) array
        Outward unit normals.
    offset : (T,) array
        Signed distance of each face's plane from the origin: n.x = offset.
    group : (T,) array
        Brightness group of each face: faces of one material and nearly one normal.
    groups : int
        Number of brightness groups.
    material : (T,) array
        Material index of each face.
    plane : (N, 4) array
        Splitting plane of each node; zero at leaves.
    children : (N, 2) array
        Child nodes in front of and behind the plane; -1 for none.
    members : tuple of array
        Indices of the faces of each node; node 0 is the root.
    steps : int
        Quantisation steps of the normals by which the faces are grouped.
    """

    corners: Array
    normals: Array
    offset: Array
    group: Array
    groups: int
    material: Array
    plane: Array
    children: Array
    members: Tuple[Array, ...]
    steps: int = NORMAL_STEPS

    @staticmethod
    def from_dict(record: Dict[str, Any]) -> Faces:
        """Make faces from the ``faces`` object of a board model file.

        Raises
        ------
        KeyError, OverflowError, TypeError, ValueError
            If a field is missing, a number is impossible or an index is out of range.
        """
        material = indices(record["material"], -1)
        steps = np.frombuffer(unpack(record["corners"], material.size * 4 * 3 * 2), "<i2")
        corners = number(record["step_m"], least=SMALLEST_M) * steps.astype(float).reshape(-1, 4, 3)
        children = indices(record["children"], -1, 2)
        plane = numbers(record["plane"], -1, 4)
        members = tuple(indices(m, -1) for m in record["members"])
        listed = np.concatenate([np.zeros(0, int), *members])
        if not len(plane) == len(children) == len(members):
            raise ValueError("the nodes of the tree of faces differ in number between its fields")
        below = np.arange(len(children))[:, None]
        if np.any((children >= len(children)) | ((children >= 0) & (children <= below))):
            raise ValueError("a node of the tree of faces refers to a node that is not below it")
        if np.any((listed < 0) | (listed >= len(corners))):
            raise ValueError("the tree of faces refers to a face that does not exist")
        n = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
        n = n / np.maximum(np.linalg.norm(n, axis=1, keepdims=True), 1e-18)
        group, groups = _brightness_groups(material, n, NORMAL_STEPS)
        offset = np.einsum("ij,ij->i", n, corners[:, 0])
        return Faces(corners, n, offset, group, groups, material, plane, children, members)

    def grouped(self, steps: int) -> Faces:
        """Return the faces regrouped by material and by normals quantised to ``steps`` steps per component."""
        group, groups = _brightness_groups(self.material, self.normals, steps)
        return replace(self, group=group, groups=groups, steps=steps)

    @cached_property
    def coarser(self) -> Faces:
        """The same faces in fewer groups: by coarser normals, or finally by `MAX_GROUPS` groups of materials."""
        if self.steps > 0:
            return self.grouped(self.steps - 1)
        return replace(self, group=self.material % MAX_GROUPS, groups=MAX_GROUPS)

    @cached_property
    def labels(self) -> Array:
        """(T + 1,) label of each face, its group plus 1; the first entry is 0, for the background."""
        return np.concatenate([[0], self.group + 1]).astype(np.uint16)

    @cached_property
    def area_m2(self) -> Array:
        """Area of each face (T,) [m^2]."""
        c = self.corners
        return np.asarray(0.5 * np.linalg.norm(np.cross(c[:, 2] - c[:, 0], c[:, 3] - c[:, 1]), axis=1))

    @cached_property
    def middles(self) -> Array:
        """Centroid of each face's corners (T, 3) [m]."""
        return np.asarray(self.corners.mean(axis=1))


def _brightness_groups(material: Array, normals: Array, steps: int) -> Tuple[Array, int]:
    """Return each face's brightness group (one material and nearly one normal) and the number of groups."""
    key = np.concatenate([material[:, None], np.rint(normals * steps)], axis=1).astype(int)
    unique, group = np.unique(key, axis=0, return_inverse=True)
    return group.ravel(), len(unique)
