"""Films: what was filmed is read again by another reader."""

from __future__ import annotations

import shutil
import sys
import threading
import time
from pathlib import Path

import cv2
import numpy as np
import pytest

from flyaround.gui.picture import video
from flyaround.gui.picture.video import Film
from flyaround.simulator.errors import UserError
from tests.harness.small_disk import small_disk

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
    with pytest.raises(UserError, match="cannot write the film"):
        Film(tmp_path / ("a" * 300 + ".mp4"))
    monkeypatch.setitem(sys.modules, "av", None)
    with pytest.raises(UserError, match=r"pip install 'flyaround\[gui\]'"):
        Film(tmp_path / "view.mp4")


def noise(film: Film, pictures: int) -> None:
    """Pictures that no encoder makes small."""
    rng = np.random.default_rng(5)
    for k in range(pictures):
        film.add(40 * k, rng.integers(0, 256, (240, 320), np.uint8))
        until = time.monotonic() + 10.0
        while not film._queue.empty() and film.trouble is None and time.monotonic() < until:
            time.sleep(1e-3)


def test_a_film_has_its_name_once_it_is_whole(tmp_path: Path) -> None:
    film = Film(tmp_path / "view.mp4")
    noise(film, 3)
    assert not film.path.exists()
    film.close()
    assert [p.name for p in tmp_path.iterdir()] == ["view.mp4"]
    empty = Film(tmp_path / "empty.mp4")
    empty.close()
    assert empty.trouble == f"the film {empty.path} is not kept: no picture came"
    assert [p.name for p in tmp_path.iterdir()] == ["view.mp4"]


def test_a_full_disk_ends_the_film_and_leaves_nothing_of_it(tmp_path: Path) -> None:
    with small_disk(tmp_path / "disk", 200) as disk:
        film = Film(disk / "view.mp4")
        noise(film, 40)
        film.close()
        assert film.trouble == (
            f"the film {film.path} is not kept: cannot write {film.path}: no space left on its disk; "
            "free some space or choose another disk"
        )
        assert list(disk.iterdir()) == []


def test_a_folder_that_is_gone_ends_the_film(tmp_path: Path) -> None:
    film = Film(tmp_path / "gone" / "view.mp4")
    noise(film, 3)
    shutil.rmtree(tmp_path / "gone")
    film.close()
    assert "is not kept: cannot write" in (film.trouble or "")


def test_an_encoder_that_fails_ends_the_film(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import av

    def fails(*_: object) -> None:
        raise av.error.ExternalError(1, "the encoder failed")

    film = Film(tmp_path / "view.mp4")
    monkeypatch.setattr(film, "_stream", fails)
    noise(film, 1)
    film.close()
    assert "is not kept" in (film.trouble or "")
    assert list(tmp_path.iterdir()) == []


def test_an_encoder_that_does_not_end_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(video, "END_S", 0.1)
    go_on = threading.Event()
    film = Film(tmp_path / "view.mp4")
    stream = film._stream

    def waits(size: tuple[int, int]) -> object:
        go_on.wait()
        return stream(size)

    monkeypatch.setattr(film, "_stream", waits)
    noise(film, 1)
    film.close()
    assert film.trouble == f"the film {film.path} is incomplete: its encoder has not finished after 0.1 s"
    assert not film.path.exists()
    go_on.set()
    film._thread.join()
    assert film.path.exists()
