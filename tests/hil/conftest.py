"""What the tests of the link and of the board share."""

import cv2
import pytest

from flyaround.hil.board.hybrid.native import library
from flyaround.hil.evaluate.method_choice import board_model
from flyaround.simulator.targets.library import load_target


@pytest.fixture
def one_thread():
    """OpenCV as a board runs it; threads on pictures this small cost more than they give."""
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    yield
    cv2.setNumThreads(threads)


@pytest.fixture
def no_library(monkeypatch, tmp_path):
    """A machine that the estimator has no compiled library for."""
    monkeypatch.setattr(library, "library_folder", lambda: tmp_path / "no-library")
    library._load_best.cache_clear()
    yield
    monkeypatch.undo()
    library._load_best.cache_clear()


@pytest.fixture(scope="session")
def tango():
    """Tango as a board gets it."""
    return board_model(load_target("tango"))
