"""Where output goes: the option that names the place is the one that is told, nothing of another's is replaced."""

import json

import pytest

import flyaround as fa
from flyaround.__main__ import run

SCENARIO = "tango-space-10m"


@pytest.fixture
def full(tmp_path):
    folder = tmp_path / "full"
    folder.mkdir()
    (folder / "mine.txt").write_text("keep")
    return folder


def _fails(capsys, *arguments):
    assert run([str(a) for a in arguments]) == 2
    return capsys.readouterr().err


def test_a_full_folder_of_the_console_is_told_by_its_option(full, capsys):
    pytest.importorskip("glfw")
    pytest.importorskip("imgui_bundle")
    said = _fails(capsys, "sim", SCENARIO, "--record", full)
    assert "name a new one with --record" in said
    assert "-o" not in said.split()


def test_a_picture_without_an_ending_or_in_the_place_of_a_folder(tmp_path, capsys):
    assert "has no suffix" in _fails(capsys, "render", SCENARIO, "-o", tmp_path / "picture")
    assert "is a folder; name a file in it" in _fails(capsys, "render", SCENARIO, "-o", tmp_path)


def test_a_record_never_replaces_a_file_that_is_none(tmp_path, capsys):
    camera = tmp_path / "camera.json"
    camera.write_text(json.dumps({"fx_px": 1.0}))
    said = _fails(capsys, "render", SCENARIO, "-o", tmp_path / "camera.png")
    assert "would replace" in said
    assert "camera.json" in said
    assert camera.read_text() == json.dumps({"fx_px": 1.0})
    assert [p.name for p in tmp_path.iterdir()] == ["camera.json"]


def test_poses_go_to_a_folder(tmp_path, capsys):
    poses, out = tmp_path / "poses.csv", tmp_path / "new" / "out"
    poses.write_text("q_w,q_x,q_y,q_z,t_x_m,t_y_m,t_z_m\n1,0,0,0,0,0,9\n")
    command = ["render", SCENARIO, "--poses", str(poses), "-o", str(out), "--quality", "draft"]
    assert run(command) == 0
    files = {p.name for p in out.iterdir()}
    assert files == {"frame-000000.png", "frame-000000.json", "run.toml"}
    assert run(command) == 0  # into the folder that is there now
    assert {p.name for p in out.iterdir()} == files


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("none/a.png", "none does not exist"),
        ("a.jpg", "a.jpg"),
        ("out.v2", "out.v2"),
        ("taken", "taken is a file, not a folder"),
        ("mine.csv", "mine.csv"),
    ],
)
def test_a_refused_place_of_poses_is_named_as_typed(name, says, tmp_path, capsys):
    poses = tmp_path / "poses.csv"
    poses.write_text("q_w,q_x,q_y,q_z,t_x_m,t_y_m,t_z_m\n1,0,0,0,0,0,9\n")
    (tmp_path / "taken").write_text("keep")
    said = _fails(capsys, "render", SCENARIO, "--poses", poses, "-o", tmp_path / name)
    assert says in said
    assert "000000" not in said
    assert {p.name for p in tmp_path.iterdir()} == {"poses.csv", "taken"}


def test_the_public_functions_take_text_for_a_path(full):
    with pytest.raises(fa.UserError, match="cannot read truth"):
        fa.read_truth(f"{full}/none.json")
    with pytest.raises(fa.UserError, match="not a data set"):
        fa.check_dataset(str(full))
    with pytest.raises(fa.UserError, match="not empty"):
        fa.capture(fa.plan_flight(fa.load_scenario(SCENARIO), n=1), str(full))
