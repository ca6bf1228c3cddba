"""STL files as programs write them, binary and text."""

import struct
from pathlib import Path

import numpy as np
import pytest
import trimesh

from flyaround.simulator.errors import UserError
from flyaround.simulator.targets.importing.read.mesh_file import read_mesh

REPORTS = Path(__file__).parents[3] / "data" / "reports"
BOX = trimesh.creation.box((2.0, 1.0, 0.5))
BINARY = BOX.export(file_type="stl")
TEXT = (
    "solid box\n"
    + BOX.export(file_type="stl_ascii").split("\n", 1)[1].rpartition("endsolid")[0]
    + "endsolid box\n"
)
FACET = "facet normal 0 0 1 outer loop vertex {0} 0 0 vertex {1} 0 0 vertex {0} 1 0 endloop endfacet "


def model_of(path, data):
    path.write_bytes(data if isinstance(data, bytes) else data.encode())
    return read_mesh(path)


def extent(model):
    points = np.concatenate([p.positions_m for p in model.parts])
    return np.ptp(points, axis=0).tolist()


@pytest.mark.parametrize("name", ["stl_trailing/trailing92.stl", "stl_cr_only/cr.stl"])
def test_reported_files_are_read(name):
    model = read_mesh(REPORTS / name)
    assert model.triangle_count == 4
    assert extent(model) == [1, 1, 1]
    assert ["92 bytes after its 4 triangles" in note for note in model.notes] == [True] * ("trailing" in name)


@pytest.mark.parametrize(
    "data",
    [
        BINARY,
        b"solid binary" + BINARY[12:],
        b"solid facet normal" + bytes(62) + BINARY[80:],
        TEXT,
        TEXT.upper(),
        TEXT.replace("\n", "\r"),
        TEXT.replace("\n", "\r\n"),
        " ".join(TEXT.split()),
        "\n\n  " + TEXT.replace(" ", "\t"),
        "\ufeff" + TEXT,
        TEXT.encode("utf-16"),
        TEXT.replace("solid box", "solid"),
        TEXT.replace("solid box", "solid a facet of the vertex"),
        TEXT + "\n; exported by something\n",
    ],
    ids=["binary", "binary-solid", "binary-facet", "text", "capitals", "cr", "crlf", "one-line", "tabs", "bom", "utf16",
         "no-name", "odd-name", "tail"],
)  # fmt: skip
def test_one_box_however_it_is_written(tmp_path, data):
    model = model_of(tmp_path / "a.stl", data)
    assert model.triangle_count == 12
    assert extent(model) == pytest.approx([2, 1, 0.5])
    assert model.notes == []


def test_several_solids_are_parts_with_their_names(tmp_path):
    for joint in (" ", "\n", "\r"):
        text = (
            f"solid bus{joint}"
            + FACET.format(0, 1)
            + f"endsolid bus{joint}solid left wing{joint}"
            + FACET.format(2, 3)
        )
        model = model_of(tmp_path / "a.stl", text + "endsolid")
        if joint == " ":  # where a name ends cannot be told
            assert len(model.parts) == 2
        else:
            assert [p.name for p in model.parts] == ["bus", "left wing"]
        assert extent(model)[0] == 3


def test_what_follows_or_colours_a_binary_file_is_said(tmp_path):
    assert "7 bytes after its 12 triangles" in model_of(tmp_path / "a.stl", BINARY + b"trailer").notes[0]
    assert "500 bytes after" in model_of(tmp_path / "a.stl", BINARY + bytes(500)).notes[0]
    counted_none = BINARY[:80] + bytes(4) + BINARY[84:]
    model = model_of(tmp_path / "a.stl", counted_none)
    assert model.triangle_count == 12
    assert "counts no triangles" in model.notes[0]
    coloured = BINARY[:-2] + struct.pack("<H", 0xFC00)
    assert "colours of faces" in model_of(tmp_path / "a.stl", coloured).notes[0]


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (BINARY[:-1], "is cut short"),
        (BINARY[:60], "cut short or no STL"),
        (BINARY[:84], "is cut short"),
        (bytes(84), "holds no triangles"),
        (bytes(80) + b"\xff" * 4 + BINARY[84:], "is cut short"),
        (b"", "is empty"),
        ("solid x\nendsolid x\n", "holds no triangles"),
        (TEXT[: TEXT.index("endsolid")], "is cut short"),
        (TEXT.replace("vertex", "vertx", 1), "36|35 vertices"),
        (TEXT.replace("vertex ", "vertex x", 1), "not three numbers"),
        ("hello", "no STL"),
    ],
)
def test_what_is_no_whole_stl_is_refused(tmp_path, data, says):
    with pytest.raises(UserError, match=says):
        model_of(tmp_path / "a.stl", data)
