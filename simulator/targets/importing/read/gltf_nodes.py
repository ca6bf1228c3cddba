"""The node tree of a glTF scene: its meshes with their transforms, and a check of their total size."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from flyaround.simulator.targets.importing.read.gltf_extensions import INSTANCING, VISIBILITY

if TYPE_CHECKING:
    from collections.abc import Callable

    from flyaround.simulator.runtime.arrays import FloatArray, IntArray


MAX_ROWS = 4_000_000
"""Largest number of vertices and corners of all placed meshes, unless the file holds more."""

MAX_PLACED = 100_000
"""Largest number of placed meshes: a few nested nodes of a small file can place a mesh exponentially often."""
INSTANCE_KEYS = {"TRANSLATION": "translation", "ROTATION": "rotation", "SCALE": "scale"}

PlacedMesh = tuple[str, int, "FloatArray"]
"""Name, mesh number, and (4, 4) scene from mesh."""


def meshes_in_scene(
    document: dict[str, Any], notes: list[str], read: Callable[[int], FloatArray]
) -> list[PlacedMesh]:
    """Return the meshes of the default scene with their transforms, in tree order.

    Parameters
    ----------
    document : dict
        The glTF document.
    notes : list of str
        Remarks for the user; extended in place.
    read : callable
        Returns the values of an accessor (EXT_mesh_gpu_instancing).

    Raises
    ------
    ValueError, LookupError, TypeError, AttributeError
        If the document violates glTF, for example a node has two parents.
    """
    nodes, meshes = document.get("nodes", []), list[PlacedMesh]()
    stack = [(int(k), np.eye(4)) for k in reversed(_roots(document, notes))]
    visited: set[int] = set()
    n_hidden = 0
    while stack:
        number, parent = stack.pop()
        if number in visited:
            raise ValueError(f"node {number} is reached twice: nodes form no tree")
        visited.add(number)
        node = nodes[number]
        extensions = node.get("extensions", {})
        if not extensions.get(VISIBILITY, {}).get("visible", True):
            n_hidden += 1
            continue
        matrix = parent @ node_matrix(node)
        if "mesh" in node:
            mesh = document["meshes"][node["mesh"]]
            name = str(node.get("name") or mesh.get("name") or "")
            instances = _instances(extensions[INSTANCING], read) if INSTANCING in extensions else [np.eye(4)]
            meshes += [(name, int(node["mesh"]), matrix @ place) for place in instances]
            if len(meshes) > MAX_PLACED:
                raise ValueError(f"its nodes place more than {MAX_PLACED:,} meshes")
        stack += [(int(child), matrix) for child in reversed(node.get("children", []))]
    if n_hidden:
        notes.append(f"left out {n_hidden:,} nodes that {VISIBILITY} hides, with all below them")
    return meshes


def _instances(extension: dict[str, Any], read: Callable[[int], FloatArray]) -> list[FloatArray]:
    """Return the (4, 4) transform of each instance relative to its node."""
    attributes = {
        key: read(number) for key, number in extension["attributes"].items() if key in INSTANCE_KEYS
    }
    counts = {len(values) for values in attributes.values()}
    if len(counts) != 1 or max(counts) > MAX_PLACED:
        raise ValueError(f"instances have {' and '.join(map(str, sorted(counts))) or 'no'} places")
    return [
        node_matrix({INSTANCE_KEYS[key]: values[k] for key, values in attributes.items()})
        for k in range(max(counts))
    ]


def check_size(document: dict[str, Any], meshes: list[PlacedMesh], n_bytes: int) -> None:
    """Check, before any mesh is read, that instances do not multiply the meshes far beyond the file's size.

    Parameters
    ----------
    document : dict
        The glTF document.
    meshes : list of PlacedMesh
        Meshes of the scene.
    n_bytes : int
        Size of the file's buffers: each row takes at least one byte.

    Raises
    ------
    ValueError, LookupError, TypeError, AttributeError
        If they have far more rows than the file holds, or the document violates glTF.
    """
    accessors = document.get("accessors", [])
    rows: dict[int, int] = {}
    for mesh in {number for _, number, _ in meshes}:
        rows[mesh] = 0
        for primitive in document["meshes"][mesh]["primitives"]:
            vertices = int(accessors[primitive["attributes"]["POSITION"]]["count"])
            indices = int(accessors[primitive["indices"]]["count"]) if "indices" in primitive else vertices
            rows[mesh] += vertices + indices
    total = sum(rows[number] for _, number, _ in meshes)
    if total > max(MAX_ROWS, n_bytes):
        raise ValueError(f"its nodes place {total:,} vertices and indices, far more than it holds")


def _roots(document: dict[str, Any], notes: list[str]) -> list[int]:
    scenes = document.get("scenes", [])
    if scenes:
        if len(scenes) > 1:
            notes.append(f"{len(scenes)} scenes in the file: only the first shown one is read")
        return list(scenes[document.get("scene", 0)].get("nodes", []))
    nodes = document.get("nodes", [])
    children = {c for n in nodes for c in n.get("children", [])}
    return [k for k in range(len(nodes)) if k not in children]


TRIANGLES, STRIP, FAN = 4, 5, 6
"""Primitive modes of indices."""


def node_matrix(node: dict[str, Any]) -> FloatArray:
    """Return the (4, 4) transform of a node: a column-major matrix, or translation, rotation (xyzw), scale."""
    if "matrix" in node:
        return np.asarray(node["matrix"], float).reshape(4, 4).T
    matrix = np.eye(4)
    x, y, z, w = np.asarray(node.get("rotation", [0, 0, 0, 1]), float)
    R = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    matrix[:3, :3] = R * np.asarray(node.get("scale", [1, 1, 1]), float)
    matrix[:3, 3] = node.get("translation", [0, 0, 0])
    return matrix


def as_triangles(index: IntArray, mode: int) -> IntArray:
    """Convert indices of a primitive to the (N, 3) corners of triangles.

    Raises
    ------
    ValueError
        If the number of indices of separate triangles is not a multiple of three.
    """
    if mode == TRIANGLES:
        if len(index) % 3:
            raise ValueError(f"{len(index)} indices do not form whole triangles")
        return index.reshape(-1, 3)
    if mode == FAN:
        first = np.full(max(len(index) - 2, 0), index[0] if len(index) else 0)
        return np.stack([first, index[1:-1], index[2:]], axis=1)
    t = np.stack([index[:-2], index[1:-1], index[2:]], axis=1)
    t[1::2] = t[1::2, ::-1]  # every second triangle of a strip is reversed
    return t
