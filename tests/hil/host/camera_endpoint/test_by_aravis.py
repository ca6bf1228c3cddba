"""Pictures that Aravis grabs over loopback, and clients that come and go."""

import subprocess
import time

import pytest
from camera_kit import (
    ADDRESS,
    CLIENT,
    N_IMAGES,
    SYSTEM_PYTHON,
    aravis,
    camera,
    config,
    hashes,
    images,
    need_aravis,
)


def test_aravis_grabs_equal_pixels_despite_loss():
    need_aravis()
    pictures = images()
    with camera(pictures, config(loss_share=0.05, loss_seed=2)) as notes:
        got = aravis("grab", str(N_IMAGES))
        assert got["failed"] == 0
        assert got["resent"] > 0
        assert {frame["sha256"] for frame in got["frames"]} <= set(hashes(pictures))
        assert len(got["frames"]) == N_IMAGES
        # again, with a region and twice the exposure
        got = aravis("grab", "2", "Width=32", "Height=16", "OffsetX=8", "ExposureTime=5000.0")
        assert [frame["size"] for frame in got["frames"]] == [[32, 16]] * 2
        assert got["frames"][0]["mean"] == pytest.approx(64, abs=10)
    assert sum("released control" in note for note in notes) == 2


def test_second_client_is_refused_and_a_killed_one_is_followed():
    need_aravis()
    with camera(images(), config()) as notes:
        line = [SYSTEM_PYTHON, str(CLIENT), ADDRESS, "hold"]
        with subprocess.Popen(line, stdout=subprocess.PIPE, text=True) as holder:
            assert holder.stdout.readline() == '"held"\n'
            assert "error" in aravis("grab", "1")
            holder.kill()
        until = time.monotonic() + 60
        while not any("sent no heartbeat" in note for note in notes) and time.monotonic() < until:
            time.sleep(0.05)
        assert aravis("trigger", "3")["failed"] == 0
    assert any("refused" in note for note in notes)
