"""Films: what was filmed is read again by another reader."""

from __future__ import annotations

import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from gui.picture.video import Film, eight_bits
from simulator.errors import UserError

pytest.importorskip("av", reason="the gui extra is not installed")


def test_a_film_has_its_pictures_at_their_times(tmp_path: Path) -> None:
    film = Film(tmp_path / "new" / "view.mp4")
    for k in range(30):
        # another size in between, as when the detail changes
        size = (101, 161) if k < 20 else (50, 80)
        film.add(1000 + 40 * k, np.full(size, 8 * k, np.uint8))
        film.add(1000 + 40 * k, np.zeros(size, np.uint8))
        while not film._queue.empty():
            pass
    film.close()
    assert film.trouble is None
    assert film.pictures == 30
    reader = cv2.VideoCapture(str(film.path))
    levels = []
    while True:
        there, picture = reader.read()
        if not there:
            break
        assert picture.shape == (100, 160, 3)
        levels.append(float(picture.mean()))
    assert len(levels) == 30
    assert np.corrcoef(levels, np.arange(30))[0, 1] > 0.99
    assert reader.get(cv2.CAP_PROP_FPS) == pytest.approx(25.0, rel=0.1)


def test_what_cannot_be_filmed_is_one_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(UserError, match=r"end its name in \.mp4"):
        Film(tmp_path / "view.avi")
    (tmp_path / "file").touch()
    with pytest.raises(UserError, match="cannot write the film"):
        Film(tmp_path / "file" / "view.mp4")
    monkeypatch.setitem(sys.modules, "av", None)
    with pytest.raises(UserError, match=r"pip install 'flyaround\[gui\]'"):
        Film(tmp_path / "view.mp4")


def test_digital_numbers_become_bytes() -> None:
    assert eight_bits(np.array([[4095]], np.uint16), 12)[0, 0] == 255
