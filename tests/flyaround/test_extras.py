"""A command whose extra is not installed says so in one sentence, with the command that installs it."""

import json
import sys
from pathlib import Path

import pytest
from programs import completed

from flyaround.gui.picture.video import Film
from flyaround.hil.host.audit import pictures_of
from flyaround.simulator.dataset.labelled_dataset import LabelledDataset
from flyaround.simulator.errors import UserError, missing_extra

PARTS = {
    "gui": ("av", "glfw", "imgui_bundle", "OpenGL"),
    "formats": ("pyarrow",),
    "train": ("torch", "onnx"),
    "logs": ("foxglove", "mcap", "mcap_ros2", "rosbags", "spacepackets"),
    "ray": ("ray",),
    "stores": ("fsspec", "s3fs"),
}
CAPTURE = ("capture", "tango-space-10m", "-n", "1", "-o")
HOST = ("hil", "host", "tango-space-10m", "-n", "1", "--listen", "tcp://127.0.0.1:0")
COMMANDS = [
    ("gui", ("sim", "tango-flyaround")),
    ("gui", ("sim", "tango-flyaround", "--script", "film.txt")),
    ("formats", (*CAPTURE, "a", "--format", "parquet")),
    ("formats", (*CAPTURE, "b", "--format", "speed,parquet")),
    ("logs", (*CAPTURE, "c", "--format", "mcap")),
    ("logs", (*HOST, "--mcap", "run.mcap")),
    ("logs", (*HOST, "--live", "0")),
    ("logs", (*HOST, "--ccsds", "run.ccsds")),
    ("train", ("train", "data", "-o", "network.npz")),
    ("ray", (*CAPTURE, "d", "--ray", "auto")),
    ("stores", (*CAPTURE, "s3://bucket/set")),
    ("stores", (*CAPTURE, "memory://set")),
]
RUN = """
import contextlib, io, json, sys, traceback

hidden, commands = json.loads(sys.argv[1])
sys.modules.update(dict.fromkeys(hidden))  # an import of None raises as if it were not there
from flyaround.__main__ import run

said = []
for command in commands:
    errors = io.StringIO()
    with contextlib.redirect_stderr(errors):
        try:
            code = run(command)
        except BaseException:
            code = traceback.format_exc()
    said.append((code, errors.getvalue()))
print(json.dumps(said))
"""


@pytest.fixture(scope="module")
def said(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bare")
    hidden = [name for names in PARTS.values() for name in names]
    words = json.dumps([hidden, [command for _, command in COMMANDS]])
    done = completed(sys.executable, "-c", RUN, words, cwd=folder, check=True)
    assert not any(folder.iterdir()), "something was half-written"
    return json.loads(done.stdout.splitlines()[-1])


@pytest.mark.parametrize(("number", "extra"), [(n, extra) for n, (extra, _) in enumerate(COMMANDS)], ids=str)
def test_a_missing_extra_is_one_sentence_with_its_install_command(said, number, extra):
    code, words = said[number]
    assert code == 2, words
    assert len(words.strip().splitlines()) == 1
    assert f"which is not installed; run: pip install 'flyaround[{extra}]'" in words


@pytest.mark.parametrize(
    ("extra", "hidden", "call"),
    [
        ("gui", "av", lambda: Film(Path("film.mp4"))),
        ("logs", "mcap", lambda: next(pictures_of(Path("pictures.mcap")))),
        ("train", "torch", lambda: LabelledDataset(Path("data"), None, (), {}).torch()),
    ],
)
def test_a_part_that_is_called_later_says_so_too(monkeypatch, extra, hidden, call):
    for name in [name for name in sys.modules if name.partition(".")[0] == hidden]:
        monkeypatch.setitem(sys.modules, name, None)
    monkeypatch.setitem(sys.modules, hidden, None)
    monkeypatch.delitem(sys.modules, "flyaround.simulator.dataset.torch_dataset", raising=False)
    with pytest.raises(UserError, match=rf"needs {hidden}.* pip install 'flyaround\[{extra}\]'$"):
        call()


def test_a_library_that_is_there_but_does_not_load_is_not_called_missing():
    sentence = str(missing_extra("the console", "gui", ImportError("libGL.so.1: cannot open\nshared object")))
    assert "not installed" not in sentence
    assert "libGL.so.1: cannot open shared object" in sentence
    assert "flyaround doctor" in sentence
