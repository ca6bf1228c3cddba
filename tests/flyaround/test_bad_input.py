"""A user's mistake on the command line: exit 2, one sentence with what, where and what to do, no traceback."""

import json
import os
import subprocess
import sys

import cv2
import numpy as np
import pytest
from programs import completed

from flyaround.__main__ import run
from tests.harness.full_device import FULL, needs_full_device

GOOD = """
epoch_utc = "2026-03-21T10:00:00Z"
duration_s = 10.0
[orbit]
kind = "elements"
altitude_km = 700.0
[chaser]
mode = "hold"
position_lvlh_m = [0.0, -10.0, 0.0]
"""


def _fails(capsys, *arguments, says):
    code = run([str(a) for a in arguments])
    error = " ".join(capsys.readouterr().err.split())
    assert code == 2, error
    assert "Traceback" not in error
    for word in says:
        assert word in error, error
    return error


@pytest.fixture
def scenario_file(tmp_path):
    def write(text):
        path = tmp_path / "mine.toml"
        path.write_text(text)
        return path

    return write


@pytest.mark.parametrize("name", ["gui", "console"])
def test_a_guessed_name_of_the_console_names_the_right_command(capsys, name):
    _fails(capsys, name, says=(f"'{name}'", "flyaround sim"))


@pytest.mark.parametrize(
    "command", [("render",), ("capture", "-o", "x"), ("fly", "-o", "x"), ("hil", "host")]
)
def test_unknown_scenario_names_the_nearest(capsys, command):
    _fails(capsys, *command, "tango-flyaruond", says=("tango-flyaruond", "tango-flyaround"))


def test_a_scenario_that_mentions_a_recipe_is_no_recipe(capsys, scenario_file):
    path = scenario_file(f"# see flyaround.recipe\nzoom = 2\n{GOOD}")
    assert "samples" not in _fails(capsys, "fly", path, "-o", "x", says=("mine.toml", "unknown key zoom"))
    path = scenario_file("schema = 'flyaround.recipe'\nzoom = 2\n")
    _fails(capsys, "fly", path, "-o", "x", says=("is a recipe of independent samples, and fly takes",))


@pytest.mark.parametrize("content", [b"", b"0.5 hello 0.5\n", b"\x93NUMPY"])
def test_a_kernel_file_that_is_no_table_of_numbers(capsys, scenario_file, tmp_path, content):
    (tmp_path / "k.txt").write_bytes(content)
    path = scenario_file(GOOD + '[optics]\npsf = "kernel"\nkernel_file = "k.txt"\n')
    assert "Warning" not in _fails(capsys, "render", path, says=("optics.kernel",))


FLIGHT = "tango-flyaround"
MISTAKES = [
    (f"capture {FLIGHT} -o OUT --format png", ("png", "native, speed")),
    (f"capture {FLIGHT} -o OUT --format ,", ("no data-set format",)),
    (f"capture {FLIGHT} -o OUT --seed -3", ("--seed",)),
    (f"capture {FLIGHT} -o OUT -n 100000000000", ("at most",)),
    (f"capture {FLIGHT} -o OUT --every 1e-9", ("longer spacing",)),
    (f"capture {FLIGHT} -o OUT --workers 0", ("--workers",)),
    (f"capture {FLIGHT}", ("--output",)),
    ("capture eval-earth -o OUT --environment fog", ("fog", "airless")),
    (f"fly {FLIGHT} -o OUT --every 1e-9", ("longer spacing",)),
    (f"render {FLIGHT} -t 1e6 -o OUT.png", ("1e+06", "60 s")),
    (f"render {FLIGHT} -o OUT.tiff", (".tiff", ".png")),
    (f"render {FLIGHT} --quality best", ("best", "draft")),
    (f"render {FLIGHT} --environment fog", ("fog", "thesis")),
    (f"render {FLIGHT} --poses POSES --timings", ("--timings", "leave out --poses")),
    ("render --nonsense", ("--nonsense",)),
    ("estimate OUT.png --method magic", ("magic", "hybrid")),
    ("estimate OUT.png", ("OUT.png", "missing")),
    ("estimate SMALL --target cubesat-1u --camera speed", ("640 x 480", "1920 x 1200", "--camera")),
    ("estimate a.png --camera nikon", ("nikon", "speed")),
    ("hil board ftp://127.0.0.1:5600", ("ftp://127.0.0.1:5600", "tcp://")),
    *(
        (f"{command} {option} {value}", (f"{option} {value} is invalid: give a finite number",))
        for command, option in (
            (f"capture {FLIGHT} -o OUT", "--every"),
            (f"fly {FLIGHT} -o OUT", "--every"),
            (f"render {FLIGHT} -o OUT.png", "--time"),
            ("sim", "--seconds"),
            ("check OUT", "--redraw"),
            ("targets add OUT.obj", "--scale"),
            (f"hil host {FLIGHT}", "--silence"),
            ("hil display --patterns", "--hold"),
        )
        for value in ("nan", "inf")
        if option != "--redraw" or value == "nan"  # 1 is the most
    ),
    (f"sim --size {'9' * 5000}x800", ("--size", "WIDTHxHEIGHT of 320 to 16384")),
    (f"hil display-calibrate OUT --screen {'9' * 5000}x64", ("--screen", "WIDTHxHEIGHT")),
    ("hil display-calibrate OUT --screen 64x64x64", ("--screen", "WIDTHxHEIGHT")),
    ("hil display --patterns -n 5", ("--patterns", "leave out -n")),
    ("hil display --patterns --calibration OUT.json", ("leave out -n, --calibration",)),
    (f"render {FLIGHT} --gpu -5", ("--gpu", "-5", "x>=0")),
    ("hil board nonsense", ("nonsense", "tcp://")),
]


@pytest.mark.parametrize(("words", "says"), MISTAKES)
def test_a_mistake_in_the_words_names_what_is_wrong_and_writes_nothing(capsys, tmp_path, words, says):
    places = {"OUT": tmp_path / "OUT", "POSES": tmp_path / "poses.csv", "SMALL": tmp_path / "small.png"}
    places["POSES"].write_text("q_w,q_x,q_y,q_z,t_x_m,t_y_m,t_z_m\n1,0,0,0,0,0,9\n")
    cv2.imwrite(str(places["SMALL"]), np.zeros((480, 640), np.uint8))
    for name, path in places.items():
        words = words.replace(name, str(path))
    _fails(capsys, *words.split(), says=says)
    assert not list(tmp_path.glob("OUT*"))


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (("[orbit]", 'target = "tangoo"\n[orbit]'), ("tangoo", "tango")),
        (("duration_s = 10.0", "duration_s = "), ("mine.toml", "line 3")),
        (("altitude_km = 700.0", "altitude_km = -5.0"), ("mine.toml", "altitude_km", "-5", "at least 10")),
    ],
)
def test_mistakes_in_a_scenario_name_file_key_and_what_is_allowed(capsys, scenario_file, change, says):
    assert change[0] in GOOD
    _fails(capsys, "render", scenario_file(GOOD.replace(*change)), says=says)


def test_unwritable_and_full_folders(capsys, tmp_path):
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "mine.txt").write_text("keep")
    _fails(capsys, "capture", "tango-flyaround", "-o", tmp_path / "full", says=("not empty", "--resume"))
    assert (tmp_path / "full" / "mine.txt").read_text() == "keep"
    # only what can be gone on with is offered so, and the folder's own option named
    assert "--resume" not in _fails(
        capsys, "fly", "tango-flyaround", "-o", tmp_path / "full", says=("not empty", "-o")
    )
    _fails(capsys, "targets", "--export", tmp_path / "full", says=("not empty", "--export"))
    _fails(
        capsys,
        "capture",
        "tango-flyaround",
        "-o",
        tmp_path / "full" / "mine.txt",
        says=("is a file", "folder"),
    )
    _fails(capsys, "render", "tango-flyaround", "-o", tmp_path / "none" / "a.png", says=("does not exist",))
    _fails(capsys, "capture", "tango-flyaround", "-o", "/proc/flyaround", says=("/proc/flyaround",))


def test_truth_that_is_not_one(capsys, tmp_path):
    path = tmp_path / "t.json"
    _fails(capsys, "render", "--from-truth", path, says=("t.json", "render or capture"))
    path.write_text('{"schema": "flyaround.truth"}')
    _fails(capsys, "render", "--from-truth", path, says=("t.json", "not a truth record"))


def test_check_and_evaluation_of_something_else(capsys, tmp_path):
    _fails(capsys, "check", tmp_path, says=("not a data set", "capture"))
    report = tmp_path / "report"
    _fails(capsys, "evaluate", tmp_path, "-o", report, says=("not a data set", "capture"))
    assert not report.exists()


def test_no_egl_says_how_to_get_it(tmp_path):
    # an EGL without any vendor library: what a bare machine has
    environment = os.environ | {"__EGL_VENDOR_LIBRARY_FILENAMES": str(tmp_path / "none.json")}
    words = ("-m", "flyaround", "render", "tango-flyaround", "-o", tmp_path / "a.png")
    done = completed(sys.executable, *words, env=environment)
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    assert "apt-get install" in done.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("found", ["3.3", "4.0"])
def test_an_old_driver_says_what_is_needed_and_what_it_has(tmp_path, found):
    # another process: the driver reads the variable once
    picture = tmp_path / "x.png"
    words = ("-m", "flyaround", "render", "tango-flyaround", "-o", picture)
    done = completed(sys.executable, *words, env={**os.environ, "MESA_GL_VERSION_OVERRIDE": found})
    error = " ".join(done.stderr.split())
    assert done.returncode == 2, error
    assert "Traceback" not in error
    assert f"OpenGL 4.1 is needed and the driver has {found}" in error
    assert "update" in error
    assert not picture.exists()


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("q_camera_from_target_wxyz", [0.0, 0.0, 0.0, 0.0]),
        ("q_camera_from_eci_wxyz", [2.0, 0.0, 0.0, 0.0]),
        ("t_camera_from_target_m", [0.0, 0.0, 1e300]),
        ("t_camera_from_target_m", [0.0, 0.0, 0.0]),
        ("exposure_s", -1.0),
        ("seed", -1),
        ("r_sun_eci_m", [0.0, 0.0, 0.0]),
        ("r_camera_eci_m", [0.0, 0.0, 0.0]),
        ("epoch_utc", "garbage"),
        ("camera.width_px", 1000000),
        ("camera.fx_px", -3000.0),
        ("sensor.bits", 99),
        ("sensor.gaussian_variance", -1.0),
        ("sensor.blur_sigma_px", 1e9),
    ],
)
def test_a_record_that_cannot_be_drawn_names_the_field(capsys, tmp_path, truth_record, field, value):
    record = json.loads(truth_record)
    place, *inner = field.split(".")
    if inner:
        record["scene"][place][inner[0]] = value
    else:
        record["scene"][place] = value
    path = tmp_path / "t.json"
    path.write_text(json.dumps(record))
    _fails(capsys, "render", "--from-truth", path, "-o", tmp_path / "a.png", says=("t.json", place))
    assert not (tmp_path / "a.png").exists()


@pytest.fixture(scope="module")
def truth_record(tmp_path_factory):
    folder = tmp_path_factory.mktemp("record")
    assert (
        run(["render", "tango-flyaround", "-t", "5", "--quality", "draft", "-o", str(folder / "a.png")]) == 0
    )
    return (folder / "a.json").read_text()


def test_pictures_to_compare_with_must_be_there(capsys, tmp_path):
    _fails(capsys, "compare", "--reference", tmp_path / "none", says=("none", "--reference"))
    _fails(capsys, "compare", "--reference", tmp_path, says=("no picture", ".png"))
    (tmp_path / "a.png").write_bytes(b"not a picture")
    _fails(capsys, "compare", "--reference", tmp_path, says=("a.png", "convert"))
    _fails(capsys, "compare", "--reference", tmp_path, "--sensor", "eye", says=("eye", "speed"))


@pytest.mark.parametrize(
    ("error", "says"),
    [
        (MemoryError(), ("not enough memory", "fewer workers")),
        (np.exceptions.AxisError(9, 1), None),
        (RecursionError("maximum recursion depth exceeded"), ("nested too deeply",)),
        (PermissionError(13, "Permission denied", "/data/x"), ("/data/x", "Permission denied")),
        (OSError(28, "No space left on device", "/data/x"), ("/data/x", "free some space")),
    ],
)
def test_what_the_machine_refuses_is_a_sentence(capsys, monkeypatch, error, says):
    def refuse(**_options):
        raise error

    monkeypatch.setattr("flyaround.cli.app.app", refuse)
    if says is None:  # a mistake of ours is not dressed up
        with pytest.raises(type(error)):
            run(["targets"])
        return
    _fails(capsys, "targets", says=says)


@needs_full_device
def test_standard_output_on_a_full_disk(tmp_path):
    with FULL.open("w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "flyaround", "cameras", "--json"],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            timeout=120,
            check=False,
        )
    assert done.returncode == 2, done.stderr
    assert "no space left on the disk; free some space" in " ".join(done.stderr.split())
    assert len(done.stderr.strip().splitlines()) == 1
