"""hil display and display-calibrate: the end of standard input, and pictures of other sizes."""

import io
from types import SimpleNamespace

import numpy as np
import pytest

from flyaround.__main__ import run
from flyaround.cli import display
from flyaround.hil.display.patterns import calibration_patterns
from flyaround.simulator.dataset.formats.native import encode_png
from flyaround.simulator.errors import UserError

SCREEN_PX = (64, 64)


@pytest.mark.parametrize("shape", [(60, 80), (1, 64), (64, 1)])
def test_pictures_of_one_pattern_that_differ_in_size_are_refused(tmp_path, capsys, shape):
    first = next(iter(calibration_patterns(*SCREEN_PX))).name
    (tmp_path / f"{first}_0.png").write_bytes(encode_png(np.zeros((64, 64), np.uint8)))
    (tmp_path / f"{first}_1.png").write_bytes(encode_png(np.zeros(shape, np.uint8)))
    assert run(["hil", "display-calibrate", str(tmp_path), "--screen", "64x64"]) == 2
    assert f"{first}_1.png and {first}_0.png differ in size" in " ".join(capsys.readouterr().err.split())


def test_step_ends_with_standard_input(monkeypatch):
    shown = []
    screen = SimpleNamespace(size_px=SCREEN_PX, open=True, show=shown.append)
    names = [pattern.name for pattern in calibration_patterns(*SCREEN_PX)]
    monkeypatch.setattr("sys.stdin", io.StringIO("\n\n"))
    with pytest.raises(UserError, match=f"standard input ended at {names[2]}"):
        display._show_patterns(screen, 0.0, None, step=True)
    assert len(shown) == 3
    monkeypatch.setattr("sys.stdin", io.StringIO("\n" * len(names)))
    display._show_patterns(screen, 0.0, None, step=True)
