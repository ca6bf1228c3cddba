"""`flyaround targets add` and `remove`, the list and the contact sheet, from the command line."""

import json
import os
from pathlib import Path

import numpy as np
import pytest
import trimesh

from flyaround.__main__ import run
from flyaround.hil.board.estimation import BoardModel as BoardView
from flyaround.hil.board_model.write import write_board_model
from flyaround.simulator.dataset.check.verify import check_dataset
from flyaround.simulator.errors import UserError
from flyaround.simulator.labels.part_classes import target_classes
from flyaround.simulator.targets.library import list_targets, load_target
from tools.docs.targets import write_docs

pytestmark = pytest.mark.usefixtures("coarse_proposals")

SCENARIO = """
target = "{name}"
epoch_utc = "2026-03-21T10:00:00Z"
duration_s = 10.0
[orbit]
kind = "elements"
altitude_km = 700.0
[chaser]
mode = "hold"
position_lvlh_m = [0.0, -10.0, 0.0]
"""


def satellite():
    """A bus with two wings and a mast, in metres."""
    bus = trimesh.creation.box((1.0, 0.8, 0.6))
    wings = [trimesh.creation.box((0.6, 1.2, 0.03)) for _ in range(2)]
    wings[0].apply_translation((0, 1.1, 0.1))
    wings[1].apply_translation((0, -1.1, 0.1))
    mast = trimesh.creation.cylinder(0.04, 0.5, sections=24)
    mast.apply_translation((0.3, 0.1, 0.55))
    return [("bus", bus), ("wing_py", wings[0]), ("wing_ny", wings[1]), ("mast", mast)]


@pytest.fixture
def mesh_file(tmp_path):
    scene = trimesh.Scene()
    for name, mesh in satellite():
        scene.add_geometry(mesh, node_name=name, geom_name=name)
    path = tmp_path / "My Sat.glb"
    path.write_bytes(scene.export(file_type="glb"))
    return path


def command(capsys, *arguments):
    code = run(["targets", *(str(a) for a in arguments)])
    out, err = capsys.readouterr()
    return code, out, " ".join(err.split())


def data_folder():
    return Path(os.environ["FLYAROUND_DATA_DIR"]) / "targets"


def test_a_mesh_becomes_a_target_by_name(capsys, mesh_file, tmp_path):
    code, out, _ = command(capsys, "add", mesh_file, "--up", "z", "--mass", "120", "--no-sheet", "--json")
    assert code == 0
    report = json.loads(out)
    assert report["name"] == "my-sat"
    assert report["origin"] == "user"
    assert "expect fewer correct poses" in report["estimator"]
    assert "pip install 'flyaround[train]'" in report["estimator"]
    assert Path(report["path"]) == data_folder() / "my-sat.glb"
    assert any("size 1 x 3.4 x 1.1 m" in line for line in report["report"])
    target = load_target("my-sat")
    assert target.mass.mass_kg == pytest.approx(120)
    assert [p.name for p in target.parts] == ["bus", "wing_py", "wing_ny", "mast"]
    assert len(target.keypoints) >= 12
    assert "my-sat" in list_targets()
    assert load_target(report["path"]).sha256 == report["sha256"]
    listed = {t["name"]: t["origin"] for t in json.loads(command(capsys, "--json")[1])}
    assert (listed["my-sat"], listed["tango"]) == ("user", "built-in")
    write_board_model(target, tmp_path / "board.json")
    assert len(BoardView.read(tmp_path / "board.json").wireframe) == len(target.wireframe)
    code, out, _ = command(capsys, "remove", "my-sat")
    assert code == 0
    assert "my-sat" not in list_targets()
    assert list(data_folder().iterdir()) == []


def test_names_that_cannot_be_had(capsys, mesh_file):
    for name, says in (
        ("tango", "is a built-in target"),
        ("Ü ber", "cannot be used"),
        ("../x", "cannot be used"),
    ):
        code, _, error = command(capsys, "add", mesh_file, "--name", name)
        assert (code, says in error) == (2, True), error
    assert command(capsys, "add", mesh_file, "--no-sheet")[0] == 0
    code, _, error = command(capsys, "add", mesh_file, "--no-sheet")
    assert code == 2
    assert "already in" in error
    assert "--replace" in error
    assert command(capsys, "add", mesh_file, "--no-sheet", "--replace")[0] == 0
    for name, says in (
        ("tango", "stays"),
        ("nothing", "no target called 'nothing'"),
        ("../x", "no target called"),
    ):
        code, _, error = command(capsys, "remove", name)
        assert (code, says in error) == (2, True), error


def bad_files(folder):
    """Files with a fault for each step of an import, the options given, and what the sentence must say."""
    box = trimesh.creation.box((2.0, 1.0, 0.5))
    stl = box.export(file_type="stl")
    yield "big.stl", trimesh.creation.box((740.0, 770.0, 300.0)).export(file_type="stl"), (), "--units mm"
    yield "cut.glb", box.export(file_type="glb")[:300], (), "cut short"
    open_box = trimesh.Trimesh(box.vertices, box.faces[2:], process=False)
    yield "open.stl", open_box.export(file_type="stl"), ("--strict",), "open edges"
    yield "flat.obj", b"v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", (), "no face with area"
    fin = trimesh.Trimesh([*box.vertices, [0, 3, 0]], [*box.faces, [*box.faces[0, :2], 8]], process=False)
    yield "fin.stl", fin.export(file_type="stl"), ("--strict", "--keep-holes"), "--keep-non-manifold"
    yield "both.stl", stl, ("--units", "mm", "--scale", "2"), "not both"
    yield "few.stl", stl, ("--decimate", "3"), "--decimate 3 is out of range"
    yield "mass.stl", stl, ("--mass", "0"), "--mass 0 is not a positive number"
    yield "twice.stl", stl, ("--mass", "4", "--density", "100"), "leave one out"
    yield "classes.stl", stl, ("--classes", folder / "gone.toml"), "name a file of part classes"
    (folder / "classes.toml").write_text(
        'schema = "flyaround.part_classes"\nversion = 1\n[classes]\nwing = "sensor"'
    )
    yield "classes.stl", stl, ("--classes", folder / "classes.toml"), "is not a part; name one, such as body"


@pytest.mark.parametrize("number", range(11))
def test_a_bad_file_is_one_sentence_and_writes_nothing(capsys, tmp_path, number):
    name, data, options, says = list(bad_files(tmp_path))[number]
    (tmp_path / name).write_bytes(data)
    code, out, error = command(capsys, "add", tmp_path / name, *options)
    assert code == 2
    assert says in error
    assert "Traceback" not in error
    assert out == ""
    assert not data_folder().exists()


def test_what_is_safe_is_repaired_and_said(capsys, tmp_path):
    """Faces turned inwards, none but zero normals, a face twice and one without area: mended, each in a line."""
    box = trimesh.creation.box((2.0, 1.0, 0.5))
    faces = [tuple(f + 1) for f in box.faces[:, ::-1]]
    sliver = (1, 1, 2)
    lines = [f"v {x} {y} {z}" for x, y, z in box.vertices] + ["vn 0 0 0"]
    lines += ["f " + " ".join(f"{i}//1" for i in f) for f in (*faces, faces[0], sliver)]
    (tmp_path / "box.obj").write_text("\n".join(lines) + "\n")
    code, out, error = command(capsys, "add", tmp_path / "box.obj", "--up", "z", "--no-sheet", "--json")
    assert code == 0, error
    said = " / ".join(json.loads(out)["report"])
    for word in ("turned", "without area", "duplicate", "normals"):
        assert word in said, said
    body = load_target("box").parts[0]
    corner = body.positions_m[body.triangles]
    volume = np.sum(np.cross(corner[:, 0], corner[:, 1]) * corner[:, 2]) / 6
    assert volume == pytest.approx(1.0)


def test_an_open_mesh_without_its_materials_is_taken_and_all_findings_said_at_once(capsys, tmp_path):
    """One pass: the size, the openings, what is missing, the classes, and at the end what it is and what to expect."""
    text = "mtllib gone.mtl\no SolarPanel\nv 0 0 0\nv 2 0 0\nv 2 1 0\nv 0 1 0\nusemtl cells\nf 1 2 3 4\nfoo\n"
    text += "o Cube.001\nv 0 0 1\nv 2 0 1\nv 2 1 1\nv 0 1 2\nf 5 6 7\nf 5 7 8\nf 5 7 6\nf 5 7 1\n"
    (tmp_path / "a.obj").write_text(text)
    code, out, error = command(capsys, "add", tmp_path / "a.obj", "--no-sheet")
    assert code == 0, error
    lines = " ".join(out.split())
    order = (
        "- size 2 x 1 x 2 m",
        "open outlines",
        "edges of three or more faces",
        "'gone.mtl' is missing",
        "1 lines begin with a word that OBJ does not have",
        "proposed",
        "classes of parts by their names (--classes FILE sets them): solar_array 1 (SolarPanel); body 1 (Cube.001)",
        "class unknown from the name, body assumed: 1 (Cube.001)",
        "a: 2 x 1 x 2 m, 2 parts,",
        "; estimator: no keypoint network",
    )
    places = [lines.find(word) for word in order]
    assert -1 not in places, (places, out)
    assert places == sorted(places)
    assert command(capsys, "add", tmp_path / "a.obj", "--no-sheet", "--replace", "--strict")[0] == 2


def test_a_size_of_no_spacecraft_is_taken_when_confirmed(capsys, tmp_path):
    path = tmp_path / "a.stl"
    path.write_bytes(trimesh.creation.box((0.02, 0.04, 0.03)).export(file_type="stl"))
    code, out, _ = command(capsys, "add", path, "--yes", "--no-sheet", "--json")
    assert code == 0
    assert "0.04 m across, outside the sizes of spacecraft" in json.loads(out)["report"][0]


def test_classes_of_a_file_reach_the_target(capsys, mesh_file, tmp_path):
    (tmp_path / "classes.toml").write_text(
        'schema = "flyaround.part_classes"\nversion = 1\n[classes]\n"mast" = "antenna"\n"bus*" = "sensor"\n'
    )
    code, _, error = command(capsys, "add", mesh_file, "--no-sheet", "--classes", tmp_path / "classes.toml")
    assert code == 0, error
    assert target_classes(load_target("my-sat")) == ("sensor", "solar_array", "solar_array", "antenna")


def test_a_damaged_target_does_not_hide_the_others(capsys, mesh_file):
    assert command(capsys, "add", mesh_file, "--no-sheet")[0] == 0
    file = data_folder() / "my-sat.glb"
    file.write_bytes(file.read_bytes()[:500])
    code, out, error = command(capsys, "--json")
    assert code == 0
    assert "my-sat" not in [t["name"] for t in json.loads(out)]
    assert "'my-sat' is skipped" in error
    with pytest.raises(UserError, match="cut short"):
        load_target("my-sat")


def test_unwritable_data_folder(capsys, mesh_file, monkeypatch, tmp_path):
    (tmp_path / "file").write_text("x")
    monkeypatch.setenv("FLYAROUND_DATA_DIR", str(tmp_path / "file"))
    code, _, error = command(capsys, "add", mesh_file, "--no-sheet")
    assert code == 2
    assert "set FLYAROUND_DATA_DIR" in error


def open_satellite(path):
    """The satellite with a bus that lacks its lid, wings that are sheets, and a fin on an edge of the bus."""
    (_, bus), (_, py), (_, ny), (_, mast) = satellite()
    bus = trimesh.Trimesh(bus.vertices, bus.faces[bus.face_normals[:, 2] < 0.9], process=False)
    top = [trimesh.Trimesh(w.vertices, w.faces[w.face_normals[:, 2] > 0.9], process=False) for w in (py, ny)]
    fin = [[0.5, 0.4, -0.3], [-0.5, 0.4, -0.3], [0.0, 0.9, -0.3]]
    corners = np.concatenate([bus.vertices, fin])
    n = len(bus.vertices)
    with_fin = trimesh.Trimesh(corners, [*bus.faces, [n, n + 1, n + 2]], process=False)
    scene = trimesh.Scene()
    for name, mesh in (("bus", with_fin), ("wing_py", top[0]), ("wing_ny", top[1]), ("mast", mast)):
        scene.add_geometry(mesh, node_name=name, geom_name=name)
    path.write_bytes(scene.export(file_type="glb"))
    return path


@pytest.mark.gl
def test_render_capture_check_and_contact_sheet_of_an_added_mesh(capsys, tmp_path):
    """A mesh of open sheets and branching edges: its labels hold from both sides."""
    mesh_file = open_satellite(tmp_path / "My Sat.glb")
    code, out, _ = command(capsys, "add", mesh_file, "--up", "z", "--json")
    assert code == 0
    report = " / ".join(json.loads(out)["report"])
    assert "kept 4 open outlines" in report
    assert "kept 1 edges of three or more faces" in report
    page = Path(json.loads(out)["contact_sheet"])
    assert page == data_folder() / "my-sat-sheet" / "index.html"
    text = page.read_text()
    pictures = [piece.split('"')[0] for piece in text.split('src="')[1:]]
    assert len(pictures) == 12
    for picture in pictures:
        assert (page.parent / picture).stat().st_size > 500
    assert "1 × 3.4 × 1.1 m" in text
    scenario = tmp_path / "mine.toml"
    scenario.write_text(SCENARIO.format(name="my-sat"))
    assert run(["capture", str(scenario), "-o", str(tmp_path / "set"), "-n", "3", "--json"]) == 0
    capsys.readouterr()
    report = check_dataset(tmp_path / "set")
    assert report.n_frames == 3
    assert report.faults == ()
    truth = json.loads((tmp_path / "set" / "images" / "000001.json").read_text())
    assert truth["box_px"] is not None
    assert any(k["state"] == "visible" for k in truth["keypoints"])
    assert command(capsys, "remove", "my-sat")[0] == 0
    assert not page.exists()


@pytest.mark.gl
def test_docs_page_and_contact_sheet_have_pictures_of_the_craft(tmp_path, monkeypatch, capsys):
    craft = load_target("cubesat-1u")
    write_docs([craft], tmp_path / "docs")
    text = (tmp_path / "docs" / "targets.md").read_text()
    assert "![cubesat-1u](images/targets/cubesat-1u.jpg)" in text
    assert craft.notes in text
    assert (tmp_path / "docs" / "images" / "targets" / "cubesat-1u.jpg").stat().st_size < 100_000
    monkeypatch.setattr("flyaround.cli.targets.list_targets", lambda: ("cubesat-1u",))
    assert command(capsys, "--contact-sheet", tmp_path / "sheet.html")[0] == 0
    assert "cubesat-1u-view1.jpg" in (tmp_path / "sheet.html").read_text()
    assert np.all([(tmp_path / f"cubesat-1u-labels{k}.jpg").is_file() for k in (1, 2, 3)])
