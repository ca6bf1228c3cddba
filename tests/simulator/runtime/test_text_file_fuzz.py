"""Text files changed at random: read, or refused in one sentence; no traceback, no hang, no gigabyte."""

import json
import os
import sys
import time
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
from mutations import changed_json, changed_text
from programs import completed

from flyaround.simulator.camera.lens.files import parse_camera, read_camera_file
from flyaround.simulator.dataset.card import (
    CardTarget,
    DatasetCard,
    card_to_json,
    describe_machine,
    read_card,
)
from flyaround.simulator.errors import UserError
from flyaround.simulator.labels.labelling import truth_record
from flyaround.simulator.labels.truth import Software, read_truth, truth_to_json
from flyaround.simulator.runtime.untrusted_files import TOML_TEXT, read_regular, refuse_deep
from flyaround.simulator.scenario.load import list_scenarios, load_scenario
from flyaround.simulator.scenario.messages import read_message
from flyaround.simulator.scenario.plan import plan_flight
from flyaround.simulator.scenario.poses import read_poses

LONGEST_S = 20.0  # for one file: a thousand times what it takes


def read(reader, data):
    """Whether a file is read; else it is refused in a sentence."""
    start = time.monotonic()
    try:
        reader()
    except UserError as error:
        told = str(error)
        assert told.strip()
        assert "\n" not in told.strip(), data
        return False
    finally:
        assert time.monotonic() - start < LONGEST_S, data
    return True


@pytest.fixture(scope="module")
def plan():
    return plan_flight(load_scenario("tango-flyaround"), n=1)


@pytest.fixture(scope="module")
def record(plan):
    """A truth record without a picture."""
    scene = plan.scene(0)
    signal = np.zeros((scene.camera.height_px, scene.camera.width_px), np.float32)
    truth = truth_record(
        scene,
        plan.target,
        signal,
        lambda: 0.0,
        silhouette_inside=1.0,
        amodal=None,
        wireframe=False,
        software=Software(flyaround="0", gl_renderer="none"),
    )
    return truth_to_json(truth)


@pytest.fixture(scope="module")
def card(plan):
    return card_to_json(
        DatasetCard(
            scenario_name="a",
            scenario=plan.scenario_document,
            seed=1,
            n_frames=3,
            every_s=None,
            complete=True,
            formats=("native",),
            camera=plan.camera,
            target=CardTarget(name="tango", sha256="0", parts=("a",), keypoints={"b": (0.0, 1.0, 2.0)}),
            machine=describe_machine("a", "b", "c"),
        )
    )


@pytest.mark.parametrize("count", [40, pytest.param(120, marks=pytest.mark.slow)])
def test_scenarios(count, tmp_path):
    rng, path = np.random.default_rng(1), tmp_path / "a.toml"
    texts = [
        files("flyaround.assets").joinpath("scenarios", f"{name}.toml").read_bytes()
        for name in list_scenarios()
    ]
    done = []
    for _ in range(count):
        data = changed_text(texts[int(rng.integers(len(texts)))], rng)
        path.write_bytes(data)
        done.append(read(lambda: load_scenario(path), data))
    assert 0 < sum(done) < len(done)


@pytest.mark.parametrize("count", [90, pytest.param(240, marks=pytest.mark.slow)])
@pytest.mark.parametrize("kind", ["record", "card"])
def test_records_and_cards(kind, count, request, tmp_path):
    rng, text = np.random.default_rng(3), request.getfixturevalue(kind)
    path, document, done = tmp_path / "dataset.json", json.loads(text), []
    reader = (lambda: read_truth(path)) if kind == "record" else (lambda: read_card(tmp_path))
    path.write_bytes(text)
    assert read(reader, text)
    for k in range(count):
        data = changed_json(document, rng) if k % 3 else changed_text(text, rng)
        path.write_bytes(data)
        done.append(read(reader, data))
    assert 0 < sum(done) < len(done)


@pytest.mark.parametrize("count", [100, pytest.param(300, marks=pytest.mark.slow)])
def test_lists_of_poses(count, tmp_path):
    rng, path = np.random.default_rng(4), tmp_path / "a.csv"
    text = b"q_w,q_x,q_y,q_z,t_x_m,t_y_m,t_z_m\n" + b"1,0,0,0,0.5,-0.25,10\n" * 5
    done = []
    for _ in range(count):
        data = changed_text(text, rng)
        path.write_bytes(data)
        done.append(read(lambda: read_poses(path), data))
    assert 0 < sum(done) < len(done)


HARNESS = Path(__file__).parents[2] / "harness"
BOMBS = """
import sys
from pathlib import Path
sys.path.insert(0, sys.argv[2])
from peak_memory import peak_bytes
from flyaround.simulator.camera.lens.files import load_camera
from flyaround.simulator.dataset.card import read_card
from flyaround.simulator.errors import UserError
from flyaround.simulator.labels.truth import read_truth
from flyaround.simulator.scenario.load import load_scenario
before = peak_bytes()
aliases = [b"a0: &a0 [1, 1]"]
for k in range(1, 20):
    aliases.append(b"a%d: &a%d [%s]" % (k, k, b", ".join([b"*a%d" % (k - 1)] * 9)))
bombs = [
    b"[" * 900_000, b'{"a":' * 150_000, b"a = " + b"[" * 900_000, b"a = " + b"{a=" * 150_000,
    b"a." * 400_000 + b"a = 1", b'"a".' * 200_000 + b"a = 1", b"- " * 100_000, b"? " * 50_000,
    b"".join(b" " * k + b"a:\\n" for k in range(600)), b"\\n".join(aliases), b"a: &a [*a]",
    b"a: " + b"9" * 100_000, b"a = " + b"9" * 100_000, b'{"a": ' + b"9" * 100_000 + b"}",
    b"\\0" * 100_000, b"x" * 100_000, b'"' * 100_000, b"." * 100_000, b"a" * 5_000_000, b" " * 70_000_000,
]
folder = Path(sys.argv[1])
names = {load_scenario: "a.toml", load_camera: "a.json", read_truth: "b.json", read_card: "dataset.json"}
for number, data in enumerate(bombs):
    for reader, name in names.items():
        (folder / name).write_bytes(data)
        try:
            reader(folder if reader is read_card else folder / name)
        except UserError as error:
            assert "\\n" not in str(error), number
            continue
        raise AssertionError(number)
print((peak_bytes() - before) >> 20)
"""


def test_what_was_made_to_fill_memory_or_stack_is_refused(tmp_path):
    done = completed(sys.executable, "-c", BOMBS, tmp_path, HARNESS)
    assert done.returncode == 0, done.stdout[-200:] + done.stderr[-2000:]
    assert int(done.stdout.split()[-1]) < 700


@pytest.mark.skipif(sys.platform == "win32", reason="needs pipes with names")
def test_what_never_ends_is_no_file(tmp_path):
    os.mkfifo(tmp_path / "dataset.json")
    for reader in (
        lambda: read_card(tmp_path),
        lambda: read_truth(tmp_path / "dataset.json"),
        lambda: read_poses(Path("/dev/zero")),
        lambda: load_scenario("/dev/zero"),
        lambda: parse_camera(read_regular(Path("/dev/zero"), 100), ""),
        lambda: read_message(tmp_path / "dataset.json", "a"),
    ):
        assert not read(reader, b"")


def test_bounds_are_told(tmp_path):
    (tmp_path / "a").write_bytes(b"12345")
    assert read_regular(tmp_path / "a", 5) == b"12345"
    with pytest.raises(UserError, match="has 5 bytes and at most 4 bytes"):
        read_regular(tmp_path / "a", 4)
    refuse_deep(b"[" * 64 + b"]" * 64 + b"[{}]" * 1000, "a")
    with pytest.raises(UserError, match="more than 64 brackets"):
        refuse_deep(b"[" * 40 + b"{" * 25, "a")


def test_brackets_in_strings_and_comments_nest_nothing_and_hide_nothing():
    text = b"[{" * 40
    refuse_deep(b'{"a": "' + text + b'\\"' + text + b'"}', "a")
    for inside in (
        b"\"'" + text + b'"',
        b"'\\" + text + b"'",
        b"#'" + text + b"\n",
        b'"""\n"\n' + text + b'""""',
        b"'''\n'" + text + b"''''",
    ):
        refuse_deep(b"a = [" + inside + b"]", "a", skip=TOML_TEXT)
    with pytest.raises(UserError, match="more than 64 brackets"):
        refuse_deep(b'["]]]\\\\", ' * 65, "a")
    for hidden in (b'"]\\\\"', b'"\\"]"', b'"""]\n"]"""', b"'''\n]\\'''", b"']\\'", b"# ]]]\n"):
        with pytest.raises(UserError, match="more than 64 brackets"):
            refuse_deep(b"a = " + (b"[" + hidden + b",") * 65, "a", skip=TOML_TEXT)


def test_numbers_and_letters_that_no_type_takes(tmp_path):
    for text in (
        b'{"nu": ' + b"9" * 400 + b', "nv": 1}',
        b"nu: 2026-99-99",
        b"a: 0x",
        b'{"a": "\xed\xa0\x80"}',
    ):
        assert not read(lambda text=text: parse_camera(text, "a"), text)
    assert not read(lambda: load_scenario("a" * 5000 + ".toml"), b"")
    assert not read(lambda: read_camera_file("a" * 5000), b"")
