"""Reading mesh files into raw parts: by what the file holds, which must be what its ending says."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.untrusted_files import read_regular
from flyaround.simulator.targets.glb.read import LARGEST_FILE_BYTES
from flyaround.simulator.targets.importing.read.foreign import KINDS, read_foreign
from flyaround.simulator.targets.importing.read.gltf import read_gltf
from flyaround.simulator.targets.importing.read.named_files import split_word, text_lines
from flyaround.simulator.targets.importing.read.obj import read_obj
from flyaround.simulator.targets.importing.read.stl import is_stl, read_stl
from flyaround.simulator.targets.importing.read.textures import bake_colours

if TYPE_CHECKING:
    from pathlib import Path

    from flyaround.simulator.targets.importing.read.raw_model import RawModel

ENDINGS = ("glb", "gltf", "obj", "stl", *KINDS)
OBJ_WORDS = {"v", "vn", "vt", "f", "o", "g", "mtllib", "usemtl", "s", "vp", "l", "p"}
MARKS = {b"ply": "ply", b"OFF": "off", b"COFF": "off", b"NOFF": "off", b"ISO-10303-21": "step"}
OTHERS = {
    b"version https://git-lfs": "a Git LFS pointer instead of the mesh (`git lfs pull` brings it)",
    b"PK": "a ZIP archive (USDZ or packed files)",
    b"\x89PN": "a PNG image",
    b"\xff\xd8": "a JPEG image",
    b"Kayd": "a binary FBX model",
    b"BLEN": "a Blender scene",
    b"<": "XML (X3D or a web page)",
}


def read_mesh(path: Path) -> RawModel:
    """Read a mesh file as it is, colours of vertices gathered into a few materials.

    Raises
    ------
    UserError
        If it cannot be read, is not what its ending says, or names files that are missing.
    """
    kind = path.suffix.lower().lstrip(".")
    if kind not in ENDINGS:
        raise UserError(
            f"{path}: meshes of kind {path.suffix or 'without ending'} are not read; export it as .glb"
        )
    try:
        data = read_regular(path, LARGEST_FILE_BYTES)
    except OSError as error:
        raise UserError(f"cannot read {path}: {error.strerror}; check the path") from error
    if not data.strip():
        raise UserError(f"{path} is empty; export the model again")
    found = detected_format(data)
    kind = "step" if kind == "stp" else kind
    # a binary STL has no mark of its own
    if found != kind and not (found == "" and kind == "stl"):
        what = f"a .{found} file" if found in ENDINGS else found or "no mesh that is known"
        hint = (
            f"rename it to {path.with_suffix('.' + found).name}" if found in ENDINGS else "export it as .glb"
        )
        raise UserError(f"{path} ends in .{kind} but holds {what}; {hint}")
    match kind:
        case "glb" | "gltf":
            model = read_gltf(path, data)
        case "obj":
            model = read_obj(path, data)
        case "stl":
            model = read_stl(path, data)
        case _:
            model = read_foreign(path, kind, data)
    model.parts = [p for p in model.parts if len(p.triangles)]
    if not model.parts:
        raise UserError(f"{path} holds no triangles; export the model as a mesh, not as points or curves")
    bake_colours(model)
    return model


def detected_format(data: bytes) -> str:
    """The ending that a file's content deserves, or a few words on what it is, or nothing."""
    if data[:4] == b"glTF":
        return "glb"
    if is_stl(data):
        return "stl"
    head = data[:4096].removeprefix(b"\xef\xbb\xbf").lstrip()
    if head[:1] == b"{":
        return "gltf"
    for magic, kind in MARKS.items():
        if head.startswith(magic):
            return kind
    if head[:1] == b"<" and b"<COLLADA" in head:
        return "dae"
    if data[:2] == b"PK" and b"3D/" in data:
        return "3mf"
    for magic, what in OTHERS.items():
        if head.startswith(magic):
            return what
    words = [split_word(line)[0].lower() for line in text_lines(data[:65536])[:-1] or text_lines(data)]
    real = [w for w in words if w and not w.startswith("#")]
    if not real or sum(w in OBJ_WORDS for w in real) > len(real) // 2:
        return "obj"
    return ""
