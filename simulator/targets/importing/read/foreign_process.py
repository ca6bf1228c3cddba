"""Subprocess that converts .ply .off .dae .3mf .step to binary glTF, with trimesh and cascadio.

Its arguments are the format and the path, from whose folder alone textures are read; standard input is the file.
Standard output is a line of JSON followed by the glTF. Its keys are ``metres`` per unit and ``up`` axis, null if the
format defines neither, and ``lost``, a list of what was not carried over. If a library is missing, the last line of
standard error begins with `MISSING`.
"""

from __future__ import annotations

import io
import json
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

from flyaround.simulator.targets.importing.read.bounded_process import bound_memory, finish
from flyaround.simulator.targets.importing.read.named_files import NotReadError, read_named

MISSING = "MISSING"
NO_MESH = "it holds no mesh"
MAX_MEMORY_BYTES = 4 << 30  # of this process, against archives that unpack to any size
MAX_TEXTURE_BYTES = 64 << 20  # of one texture file: 4096 x 4096 pixels of 4 bytes
STEP_TOLERANCE_MM = 0.1  # largest distance of the mesh from the solid: below a pixel of a camera near a craft
LIBRARIES = {
    "ply": ["trimesh"],
    "off": ["trimesh"],
    "dae": ["trimesh", "collada"],
    "3mf": ["trimesh", "lxml", "networkx"],
    "step": ["cascadio"],
}
# metres per unit of a 3MF file; trimesh returns "millimeters" if the file states none
METRES = {
    "meters": 1.0,
    "micron": 1e-6,
    "millimeter": 1e-3,
    "millimeters": 1e-3,
    "centimeter": 1e-2,
    "inch": 0.0254,
    "foot": 0.3048,
    "meter": 1.0,
}


class ContentError(Exception):
    """The file has content that cannot be converted; the message says what."""


def main(kind: str, path: Path) -> int:
    """Convert standard input; return 0, or 1 with the reason on standard error."""
    try:
        for library in LIBRARIES[kind]:  # before memory is limited
            import_module(library)
    except ImportError as error:
        return finish(f"{MISSING} {error}")
    bound_memory(MAX_MEMORY_BYTES)
    data = sys.stdin.buffer.read()
    try:
        facts, glb = _step(data) if kind == "step" else _by_trimesh(kind, path, data)
    except MemoryError:
        return finish("it unpacks to more than is read")
    except ContentError as error:
        return finish(str(error))
    except Exception as error:  # noqa: BLE001 - readers raise their own types
        return finish(f"{type(error).__name__}: {' '.join(str(error).split())[:200]}")
    sys.stdout.buffer.write(json.dumps(facts).encode() + b"\n" + glb)
    return finish(None)


def _step(data: bytes) -> tuple[dict[str, Any], bytes]:
    import cascadio  # noqa: PLC0415 - an optional part

    glb = cascadio.load(data, "step", tol_linear=STEP_TOLERANCE_MM, include_materials=False)
    if not glb:
        raise ContentError("it holds no shape that can be meshed")
    # cascadio keeps the axes of STEP, z up; it does not turn them to y up, as glTF would need
    return {"metres": 1.0, "up": "z", "lost": []}, glb


def _by_trimesh(kind: str, path: Path, data: bytes) -> tuple[dict[str, Any], bytes]:
    import trimesh  # noqa: PLC0415 - an optional part

    lost: list[str] = []

    class FolderResolver(trimesh.resolvers.Resolver):  # type: ignore[misc]
        """Resolver of textures in the model's folder."""

        def __init__(self) -> None:
            pass

        def get(self, name: str) -> bytes:
            try:
                return read_named(
                    model=path, owner=path, name=name, what="texture", max_bytes=MAX_TEXTURE_BYTES
                )[1]
            except NotReadError as error:
                lost.append(str(error))
                raise KeyError(name) from error

        def namespaced(self, namespace: str) -> FolderResolver:  # noqa: ARG002 - base class signature
            return self

        def write(self, name: str, data: bytes) -> None:
            raise NotImplementedError

        def keys(self) -> list[str]:
            return []

    options: dict[str, Any] = {"ignore_broken": False} if kind == "dae" else {}
    axes = _collada_axes(data) if kind == "dae" else {"metres": None, "up": None}
    try:
        scene = trimesh.load_scene(
            io.BytesIO(data), file_type=kind, resolver=FolderResolver(), process=False, **options
        )
    except KeyError as error:
        if kind == "3mf" and error.args == ("world",):  # the root of a scene graph without nodes
            raise ContentError(NO_MESH) from error
        raise
    for name, mesh in list(scene.geometry.items()):
        if not isinstance(mesh, trimesh.Trimesh):
            lost.append("points and curves")
            scene.delete_geometry(name)
        elif mesh.visual.kind == "face":
            mesh.unmerge_vertices()  # a vertex with two colours would get their mean
    if not scene.geometry:
        raise ContentError(NO_MESH)
    if kind == "3mf":
        axes = _3mf_axes(scene)
    return {**axes, "lost": lost}, trimesh.exchange.gltf.export_glb(scene)


def _3mf_axes(scene: Any) -> dict[str, Any]:  # noqa: ANN401 - of trimesh
    """Return metres per unit and the up axis of a 3MF file; raise `ContentError` if its unit is unknown."""
    unit = str(next(iter(scene.geometry.values())).metadata.get("units", "millimeters"))
    if unit not in METRES:
        raise ContentError(f"its unit {unit[:40]!r} is not a unit of 3MF")
    return {"metres": METRES[unit], "up": "z"}


def _collada_axes(data: bytes) -> dict[str, Any]:
    """Return metres per unit and the up axis of a COLLADA file; raise `ContentError` if it has no scene, or X is up."""
    import collada  # noqa: PLC0415 - an optional part

    document = collada.Collada(io.BytesIO(data))
    if document.scene is None:
        raise ContentError(NO_MESH)
    asset = document.assetInfo
    axis = {"Y_UP": "y", "Z_UP": "z", None: "y"}.get(asset.upaxis)
    if axis is None:
        raise ContentError(
            f"its axis {asset.upaxis} points up, which is not supported; export it with Y or Z up"
        )
    return {"metres": float(asset.unitmeter or 1.0), "up": axis}


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], Path(sys.argv[2])))
