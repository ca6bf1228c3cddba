"""What a board reads by name: regular files of a bounded size, and nothing that waits or never ends."""

import os
import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest

from flyaround.hil.board.__main__ import main
from flyaround.hil.board.errors import BoardModelError
from flyaround.hil.board.estimation import BoardModel
from flyaround.hil.board.estimation import target_model as model
from flyaround.hil.board.files import read_bounded


@pytest.fixture
def never_ending(tmp_path):
    """A pipe that nobody writes to, a device, a folder, and a file that is too large (sparse)."""
    os.mkfifo(tmp_path / "pipe")
    large = tmp_path / "large"
    with large.open("wb") as file:
        file.truncate(model.MAX_BYTES + 1)
    (tmp_path / "folder").mkdir()
    return [tmp_path / "pipe", Path("/dev/zero"), tmp_path / "folder", large]


def test_a_file_is_read_to_its_last_byte_and_no_longer_one(tmp_path):
    path = tmp_path / "file"
    path.write_bytes(b"x" * 100)
    assert read_bounded(path, 100) == b"x" * 100
    with pytest.raises(OSError, match="holds more than 0 MB"):
        read_bounded(path, 99)


def test_a_board_model_is_a_regular_file(never_ending):
    for path in never_ending:
        with pytest.raises(
            BoardModelError, match=f"board model {path} cannot be read: it (is not a regular file|holds)"
        ):
            BoardModel.read(path)


def test_so_is_a_camera(never_ending, monkeypatch, capsys):
    # a model takes long to make, and none is needed before the camera is read
    monkeypatch.setattr("flyaround.hil.board.__main__.estimator_factory", lambda *_: (None, "", ""))
    for path in never_ending:
        assert main(["--image", "none.png", "--model", "tango", "--camera", str(path)]) == 2
        said = capsys.readouterr().err
        assert said.startswith(f"camera {path} cannot be used (")
        assert said.count("\n") == 1


def test_a_picture_that_is_too_large_is_one_sentence(tmp_path, monkeypatch, capsys):
    data = bytearray(cv2.imencode(".png", np.zeros((8, 8), np.uint8))[1].tobytes())
    data[16:24] = struct.pack(">II", 60_000, 60_000)
    data[29:33] = struct.pack(">I", zlib.crc32(data[12:29]))
    (tmp_path / "large.png").write_bytes(data)
    (tmp_path / "camera.json").write_text("{}")
    monkeypatch.setattr("flyaround.hil.board.__main__.estimator_factory", lambda *_: (lambda _: None, "", ""))
    words = [
        "--image",
        str(tmp_path / "large.png"),
        "--model",
        "x",
        "--camera",
        str(tmp_path / "camera.json"),
    ]
    assert main(words) == 2
    assert (
        capsys.readouterr().err
        == f"picture {tmp_path / 'large.png'} cannot be used: it is damaged or too large\n"
    )
