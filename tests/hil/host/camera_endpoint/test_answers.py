"""A board that reads the camera and says its poses to it: each picture sent has one row, with the truth beside."""

import threading
import time

import numpy as np
import pytest
from camera_kit import ADDRESS, SIZE, camera, config, images
from estimators import Estimate
from hil_loop import made_frame

from flyaround.hil.board.gige.aravis import load_aravis
from flyaround.hil.board.gige.camera import CameraSettings, GigeCamera
from flyaround.hil.board.gige.camera_board import CameraBoardOptions, run_camera_board
from flyaround.hil.host.camera_endpoint.camera_ledger import CameraLedger
from flyaround.hil.host.camera_endpoint.messages import AnswerTerms
from flyaround.hil.host.ledger.frames_csv import read_ledger
from flyaround.hil.host.link_process.ipc import LinkConfig
from flyaround.hil.host.report import write_report
from flyaround.hil.link.errors import LinkError
from flyaround.hil.link.packets.messages import Hello, HelloAck

PICTURES = images()
FRAMES = [made_frame(k, image, every_s=0.1, t_m=(0.0, 0.0, 1.0 + k)) for k, image in enumerate(PICTURES)]
SCENES = [frame.scene for frame in FRAMES]
ACK = HelloAck(
    {"width_px": 128, "height_px": 96, "fx_px": 200.0, "fy_px": 200.0, "cx_px": 63.5, "cy_px": 47.5},
    128,
    96,
    target_name="tango",
)


class Knowing:
    """Knows the range of each picture, declines the third, and takes its time where it is told to."""

    pause_s = 0.0
    looked = False

    def __init__(self, camera):
        assert camera["fx_px"] == 200.0  # as the host said

    def estimate(self, image):
        time.sleep(self.pause_s)
        type(self).looked = True
        k = next(k for k, picture in enumerate(PICTURES) if np.array_equal(picture, image))
        estimate = Estimate()
        estimate.accepted = k != 2
        estimate.t_camera_from_target_m = (0.0, 0.0, 1.0 + k)
        return estimate


def answering(**link):
    terms = {"url": "tcp://127.0.0.1:0", "mode": "realtime", "truth": "off", "timeout_s": 20.0, **link}
    return AnswerTerms(LinkConfig(**terms), ACK)


def grab(url, n, *, hello=None, key=None, **settings):
    told = CameraBoardOptions(
        settings=CameraSettings(**settings), answer_url=url, key=key, timeout_s=20.0, most_frames=n
    )
    return run_camera_board(f"gige://{ADDRESS}", told, Knowing, hello or Hello(method="oracle"))


@pytest.fixture(autouse=True)
def _aravis(monkeypatch):
    monkeypatch.setattr(Knowing, "pause_s", 0.0)
    monkeypatch.setattr(Knowing, "looked", False)
    try:
        load_aravis()
    except LinkError as error:
        pytest.skip(str(error))


def test_the_ledger_has_a_row_for_each_picture_with_the_truth_beside_the_pose(tmp_path, monkeypatch):
    terms = answering()
    ledger = CameraLedger(tmp_path / "log", terms.link)
    with camera(PICTURES, config(SIZE, answers=terms), ledger=ledger, scenes=SCENES) as notes:
        summary = grab(notes.answers_url, 6, software_trigger=True)
        assert (summary.frames, summary.accepted) == (6, 5)
        # then freely and slowly: what is passed over has a row, too
        monkeypatch.setattr(Knowing, "pause_s", 0.15)
        grab(notes.answers_url, 3)
        # and by somebody who does not answer
        other = GigeCamera(ADDRESS, CameraSettings(software_trigger=True))
        other.start()
        other.trigger()
        assert other.frame(20.0) is not None
        other.close()
    told = ledger.close()
    rows = read_ledger(tmp_path / "log")
    assert len({row.frame_id for row in rows}) == len(rows) == told.sent
    assert told.sent == told.accepted + told.declined + told.dropped_total
    assert [row.outcome for row in rows[:6]] == ["accepted"] * 2 + ["declined"] + ["accepted"] * 3
    for k, row in enumerate(rows[:6]):
        assert row.truth_t_m == (0.0, 0.0, 1.0 + k)
        assert (row.E_T_m, row.E_R_deg) == (0.0, 0.0)
        assert row.e2e_ms is not None
        assert row.board_total_ms is not None
        assert 0.0 < row.board_total_ms <= row.e2e_ms
        assert row.exposure_start_utc < row.exposure_end_utc < row.received_utc
    assert told.dropped["skipped"] >= 1
    assert rows[-1].outcome == "dropped:disconnected"
    assert told.accepted_wrong == 0
    assert any("a board connected from tcp://" in note for note in notes)
    assert write_report(tmp_path / "log").read_text().count("skipped") > 0


@pytest.mark.slow
def test_who_may_not_answer_is_told_why():
    key = bytes(range(32))
    with camera(PICTURES, config(SIZE, answers=answering(key=key)), scenes=SCENES) as notes:
        url = notes.answers_url
        assert grab(url, 1, key=key, software_trigger=True).goodbye
        with pytest.raises(LinkError):
            grab(url, 1, key=bytes(32), software_trigger=True)
        with pytest.raises(LinkError, match="has a model of 'dragon'"):
            grab(url, 1, key=key, hello=Hello(model_name="dragon"), software_trigger=True)
        # and nothing of it keeps the camera
        assert grab(url, 1, key=key, software_trigger=True).goodbye


def test_a_camera_that_is_stopped_says_goodbye(monkeypatch):
    ends = []
    monkeypatch.setattr(Knowing, "pause_s", 0.02)
    with camera(PICTURES, config(SIZE, answers=answering()), scenes=SCENES) as notes:
        board = threading.Thread(target=lambda: ends.append(grab(notes.answers_url, 10_000)))
        board.start()
        until = time.monotonic() + 60.0
        while not Knowing.looked and time.monotonic() < until:
            time.sleep(0.02)
    board.join(60.0)
    (summary,) = ends
    assert summary.goodbye
    assert "the camera was stopped" in summary.ended
    assert summary.frames > 0
