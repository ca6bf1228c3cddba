"""OBJ and MTL files as programs write them: white space, names, options, polygons, reports."""

import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest

from flyaround.simulator.errors import UserError
from flyaround.simulator.targets.importing.read.mesh_file import read_mesh
from flyaround.simulator.targets.importing.read.textures import decode_image

REPORTS = Path(__file__).parents[3] / "data" / "reports"
SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
FACE = "usemtl skin\nf 1/1 2/2 3/3 4/4\n"


def model_of(folder, text, mtl=None, name="a.obj"):
    """The model of an OBJ with these lines, and of a library a.mtl."""
    if mtl is not None:
        (folder / "a.mtl").write_text(mtl) if isinstance(mtl, str) else (folder / "a.mtl").write_bytes(mtl)
    path = folder / name
    path.write_text(text) if isinstance(text, str) else path.write_bytes(text)
    return read_mesh(path)


def picture(path, rgb=(255, 0, 0)):
    path.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(path), np.full((4, 4, 3), rgb[::-1], np.uint8))


def drawn(model, part=0):
    """The material of a part's first face."""
    return model.materials[int(model.parts[part].face_material[0])]


def area(model):
    corners = np.concatenate([p.positions_m[p.triangles] for p in model.parts])
    return float(
        np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum()
        / 2
    )


def test_statements_split_by_tabs():
    model = read_mesh(REPORTS / "tab_obj" / "two_cubes_tab.obj")
    points = np.concatenate([p.positions_m for p in model.parts])
    assert np.ptp(points, axis=0).tolist() == [6, 2, 2]


@pytest.mark.parametrize(
    "text",
    [
        SQUARE.replace(" ", "\t") + FACE.replace(" ", "\t"),
        SQUARE.replace(" ", " \t  ") + FACE,
        (SQUARE + FACE).replace("\n", "\r\n"),
        (SQUARE + FACE).replace("\n", "\r"),
        SQUARE + "usemtl skin\nf 1/1 2/2 \\\n 3/3 4/4\n",
        SQUARE + "usemtl skin\r\nf 1/1 2/2 \\ \r\n 3/3 4/4\r\n",
        SQUARE + "usemtl skin\nf -4/-4 -3/-3 -2/-2 -1/-1\n",
        SQUARE + "usemtl skin\nfo 1/1 2/2 3/3 4/4\n",
        SQUARE.upper() + "USEMTL skin\nF 1/1 2/2 3/3 4/4\n",
        "\ufeff" + SQUARE + FACE,
        (SQUARE + FACE).encode("utf-16"),
        SQUARE.replace("v 1 0 0", "v 1 0 0 # corner") + FACE.replace("4/4", "4/4 # square"),
        "  " + (SQUARE + FACE).replace("\n", "\n   "),
        SQUARE + 'usemtl "skin"\nf 1/1 2/2 3/3 4/4',
    ],
    ids=["tabs", "mixed", "crlf", "cr", "continued", "continued-crlf", "negative", "fo", "capitals", "bom", "utf16",
         "comments", "indented", "quotes"],
)  # fmt: skip
def test_one_square_however_it_is_written(tmp_path, text):
    model = model_of(tmp_path, text)
    assert area(model) == pytest.approx(1.0)
    assert model.notes == ["material 'skin' is named, but no .mtl file: drawn grey"]


def test_lines_that_are_not_understood_are_counted(tmp_path):
    model = model_of(tmp_path, SQUARE + "foo 1 2\nbar\nfoo\n" + FACE + "call other.obj\ns off\n")
    assert model.notes[:1] == [
        "4 lines begin with a word that OBJ does not have and were not read (the first is 'foo', line 9)"
    ]


def test_vertices_with_too_few_numbers_are_refused(tmp_path):
    with pytest.raises(UserError, match="v line 2 has 2 numbers where 3 are needed"):
        model_of(tmp_path, SQUARE.replace("v 1 0 0", "v 1 0") + FACE)


@pytest.mark.parametrize("rows", ["v 1 0 0 0.5", "v 1 0 0 0.5\nv 9 9 9 1", "v 1 0 0 2"])
def test_weights_of_vertices_are_said(tmp_path, rows):
    model = model_of(tmp_path, SQUARE.replace("v 1 0 0", rows) + "f 1 2 3\n")
    assert any("weights of vertices" in note for note in model.notes)


def test_concave_polygons_keep_their_outline(tmp_path):
    """An L, a star and a dart, whose fans would cover more than they do."""
    t = np.linspace(0, 2 * np.pi, 10, endpoint=False)
    r = np.where(np.arange(10) % 2, 0.4, 1.0)
    star = np.stack([r * np.cos(t), r * np.sin(t)], axis=1)
    for outline in (
        [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)],
        star,
        [(0, 0), (1, 1), (2, 0), (1, 3)],
        [(2, 0), (1, 3), (0, 0), (1, 1)],
    ):
        x, y = np.array(outline).T
        expected = abs(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))) / 2
        for order in (1, -1):
            lines = "".join(f"v {a} 0.5 {b}\n" for a, b in zip(x[::order], y[::order], strict=True))
            model = model_of(tmp_path, lines + "f " + " ".join(str(k + 1) for k in range(len(x))) + "\n")
            assert model.triangle_count == len(x) - 2
            assert area(model) == pytest.approx(expected)
            corners = model.parts[0].positions_m[model.parts[0].triangles]
            turns = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 1]
            assert len(set(np.sign(turns))) == 1


def test_polygons_of_too_many_corners_are_refused(tmp_path):
    """A comb of 3000 corners, and two thousand discs of 200."""
    comb = "".join(f"v {k} {k % 2 * 5} 0\n" for k in range(2999)) + "v 0 -9 0\n"
    face = "f " + " ".join(str(k + 1) for k in range(3000)) + "\n"
    with pytest.raises(
        UserError, match="a concave polygon of 3,000 corners, too many to cut; export it as triangles"
    ):
        model_of(tmp_path, comb + face)
    t = np.linspace(0, 2 * np.pi, 200, endpoint=False)
    disc = "".join(f"v {np.cos(a)} {np.sin(a)} 0\n" for a in t)
    face = "f " + " ".join(str(k + 1) for k in range(200)) + "\n"
    assert model_of(tmp_path, disc + face).triangle_count == 198
    with pytest.raises(UserError, match="too many polygons of many corners"):
        model_of(tmp_path, disc + 2000 * face)


def test_colours_of_vertices(tmp_path):
    red = "v 0 0 0 1 0 0\nv 1 0 0 1 0 0\nv 0 1 0 1 0 0\nv 0 0 1 0 0 1\nv 1 0 1 0 0 1\nv 0 1 1 0 0 1\n"
    model = model_of(tmp_path, red + "f 1 2 3\nf 4 5 6\n")
    colours = {model.materials[int(k)].base_color for k in model.parts[0].face_material}
    assert colours == {(1, 0, 0), (0, 0, 1)}


def test_options_of_map_kd_move_the_coordinates(tmp_path):
    model = read_mesh(REPORTS / "obj_map_kd_options" / "o_opt_s.obj")
    assert np.ptp(model.parts[0].corner_uv.reshape(-1, 2), axis=0).tolist() == [2, 2]
    picture(tmp_path / "my skin.png")
    for options, low, high in (
        ("-s 2 3 1", (0, 1 - 3), (2, 1)),
        ("-o 0.5 0.25", (0.5, -0.25), (1.5, 0.75)),
        ("-s 2 -o 1", (1, 0), (3, 1)),
        ("-blendu on -s 1 1 1 -clamp off", (0, 0), (1, 1)),
    ):
        model = model_of(
            tmp_path, "mtllib a.mtl\n" + SQUARE + FACE, f"newmtl skin\nmap_Kd {options} my skin.png\n"
        )
        uv = model.parts[0].corner_uv.reshape(-1, 2)
        assert (uv.min(axis=0).tolist(), uv.max(axis=0).tolist()) == (list(low), list(high)), options
        assert model.notes == []
    for options in ("-clamp on", "-mm 0.2 0.5", "-t 0.1 0.1 0.1", "-cc on", "-imfchan r"):
        model = model_of(
            tmp_path, "mtllib a.mtl\n" + SQUARE + FACE, f"newmtl skin\nmap_Kd {options} my skin.png\n"
        )
        assert f"option {options.split()[0]} of map_Kd" in model.notes[0]
        assert len(model.pictures) == 1


@pytest.mark.parametrize(
    ("file", "name"),
    [
        ("my skin (1).png", "my skin (1).png"),
        ("skin.png", '"skin.png"'),
        ("tex/skin.png", "tex\\skin.png"),
        ("tex/skin.png", ".\\tex\\\\skin.png"),
        ("tex/skin.png", "mtl/../tex/skin.png"),
        ("Skin.PNG", "skin.png"),
        ("skin.png", "C:\\Users\\someone\\skin.png"),
        ("skin.png", "/home/someone/skin.png"),
        ("skin.png", "textures/skin.png"),
        ("häut.png", "häut.png"),
    ],
)
def test_names_of_textures(tmp_path, file, name):
    picture(tmp_path / file)
    (tmp_path / "mtl").mkdir()
    model = model_of(tmp_path, "mtllib a.mtl\n" + SQUARE + FACE, f"newmtl\tskin\n\tmap_Kd\t{name}\n")
    assert len(model.pictures) == 1, model.faults
    assert drawn(model).base_color_texture


def test_a_library_in_a_folder_names_textures_in_another(tmp_path):
    picture(tmp_path / "tex" / "skin.png")
    (tmp_path / "mtl").mkdir()
    (tmp_path / "mtl" / "b c.mtl").write_text("newmtl skin\nmap_Kd ../tex/skin.png\n")
    model = model_of(tmp_path, "mtllib mtl/b c.mtl\n" + SQUARE + FACE)
    assert len(model.pictures) == 1
    assert model.faults == []


def test_several_material_libraries_are_read(tmp_path):
    model = read_mesh(REPORTS / "obj_mtllib_two" / "craft.obj")
    assert drawn(model).base_color == (1, 0, 0)
    shutil.copytree(REPORTS / "obj_mtllib_two", tmp_path / "two")
    body = (tmp_path / "two" / "craft.obj").read_text().replace("mtllib a.mtl b.mtl", "")
    for lines in (
        "mtllib a.mtl\nmtllib b.mtl",
        'mtllib "a.mtl" "b.mtl"',
        "mtllib\tA.MTL\tb.mtl",
        "mtllib gone.mtl a.mtl",
    ):
        (tmp_path / "two" / "craft.obj").write_text(lines + "\n" + body)
        model = read_mesh(tmp_path / "two" / "craft.obj")
        assert drawn(model).base_color == (1, 0, 0), lines
        assert ["gone.mtl" in f for f in model.faults] == [True] * ("gone" in lines)


def test_a_missing_library_is_grey_with_a_note():
    model = read_mesh(REPORTS / "obj_mtl_missing" / "craft.obj")
    assert drawn(model).name == "grey-paint"
    assert ["'gone.mtl' is missing" in fault for fault in model.faults] == [True]


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("d 0.3", "transparency (d: drawn opaque)"),
        ("d -halo 0.3", "transparency"),
        ("Tr 0.7", "transparency (Tr: drawn opaque)"),
        ("Ke 1 1 0", "emission (Ke)"),
        ("map_Bump -bm 2 n.png", "maps map_bump"),
        ("norm n.png", "maps norm"),
        ("map_Ks s.png", "maps map_ks"),
        ("refl -type sphere r.png", "maps refl"),
        ("Tf 0.2 0.4 0.2", "transmission (Tf)"),
        ("sparkle 3", "statements 'sparkle'"),
        ("Kd 255 0 0", "colours above 1"),
    ],
)
def test_what_of_a_material_is_not_carried_over_is_said(tmp_path, line, says):
    model = model_of(tmp_path, "mtllib a.mtl\n" + SQUARE + FACE, f"newmtl skin\n{line}\n")
    assert [says in note for note in model.notes] == [True], model.notes


@pytest.mark.parametrize(
    "line", ["d 1.0", "Tr 0", "Ke 0 0 0", "Tf 1 1 1", "illum 2", "Ka 1 1 1", "Ni 1.45", "# d 0.5"]
)
def test_what_changes_nothing_is_not_said(tmp_path, line):
    assert model_of(tmp_path, "mtllib a.mtl\n" + SQUARE + FACE, f"newmtl skin\n{line}\n").notes == []


def test_a_black_factor_does_not_blacken_a_texture(tmp_path):
    picture(tmp_path / "skin.png")
    model = model_of(tmp_path, "mtllib a.mtl\n" + SQUARE + FACE, "newmtl skin\nKd 0 0 0\nmap_Kd skin.png\n")
    assert drawn(model).base_color == (1, 1, 1)
    assert "Kd 0 0 0" in model.notes[0]


def test_orientation_of_a_photograph_is_ignored():
    """Two files of one picture, one with an EXIF orientation of 6: both are drawn alike."""
    turned, plain = (
        decode_image((REPORTS / "gltf_exif" / f"{name}.jpg").read_bytes()) for name in ("exif6", "prog")
    )
    assert turned.shape == plain.shape
    assert np.abs(turned.astype(int) - plain).mean() < 8
