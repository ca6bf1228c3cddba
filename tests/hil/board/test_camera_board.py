"""A board at a GigE Vision camera, by the real Aravis: the same poses as by the link, settings, files, mistakes."""

from __future__ import annotations

import csv
import ctypes.util
import hashlib
import json
import os
import socket
import threading
import time
from dataclasses import replace
from typing import ClassVar

import numpy as np
import pytest
from camera_kit import ADDRESS, camera, config, images
from hil_loop import Loop, board, made_frame

from flyaround.__main__ import run
from flyaround.hil.board.__main__ import main
from flyaround.hil.board.gige import aravis
from flyaround.hil.board.gige.camera import CameraSettings, GigeCamera, _BlockCount, grey_image
from flyaround.hil.board.gige.camera_board import (
    CameraBoardOptions,
    read_camera,
    run_camera_board,
)
from flyaround.hil.link.errors import LinkError
from flyaround.hil.link.packets.enums import PixelFormat
from flyaround.hil.link.packets.messages import Hello
from flyaround.hil.link.packets.pixels import pack_pixels

SIZE = (96, 128)
CAMERA = {"width_px": 128, "height_px": 96, "fx_px": 200.0, "fy_px": 200.0, "cx_px": 63.5, "cy_px": 47.5}


class PixelPose:
    """A pose that every pixel decides: other pixels, another pose."""

    reason, confidence = "by its pixels", 0.5

    def __init__(self, image):
        digest = hashlib.sha256(image.tobytes() + str((image.dtype, image.shape)).encode()).digest()
        q = np.frombuffer(digest[:16], "<i4") / 2.0**31
        self.q_camera_from_target_wxyz = q / np.linalg.norm(q)
        self.t_camera_from_target_m = np.frombuffer(digest[16:28], "<i4") / 2.0**31
        self.accepted = bool(digest[31] % 4)
        self.stages_ms = {"hash": 1.0}


class PixelEstimator:
    """Remembers the cameras that it was made for, and the pictures."""

    cameras: ClassVar[list[dict]] = []
    seen: ClassVar[list[np.ndarray]] = []

    def __init__(self, camera):
        self.cameras.append(camera)

    def estimate(self, image):
        self.seen.append(image)
        return PixelPose(image)


@pytest.fixture(autouse=True)
def _forget():
    PixelEstimator.cameras, PixelEstimator.seen = [], []
    try:
        aravis.load_aravis()
    except LinkError as error:
        pytest.skip(str(error))


@pytest.fixture(scope="module")
def endpoint():
    """One camera for the tests of this file, of 12 bits, one after the other."""
    with camera(images(SIZE, bits=12), config(SIZE, bits=12)):
        yield images(SIZE, bits=12)


@pytest.fixture
def camera_file(tmp_path):
    path = tmp_path / "camera.json"
    path.write_text(json.dumps(CAMERA))
    return str(path)


def grab(camera_file, poses_file, n, url=f"gige://{ADDRESS}", **settings):
    told = CameraBoardOptions(
        settings=CameraSettings(**settings),
        camera_file=camera_file,
        poses_file=None if poses_file is None else str(poses_file),
        most_frames=n,
    )
    return run_camera_board(url, told, PixelEstimator, Hello())


def rows_of(path):
    return [json.loads(line) for line in path.read_text().splitlines()]


# --- the same poses -----------------------------------------------------------------------------


def test_poses_by_the_camera_are_those_by_the_link(endpoint, camera_file, tmp_path):
    """The same pictures by both ways: equal pixels give equal poses, and one that differs would show."""
    summary = grab(camera_file, tmp_path / "poses.jsonl", 6, software_trigger=True, pixel_format="Mono12")
    assert (summary.frames, summary.goodbye) == (6, True)
    by_camera = rows_of(tmp_path / "poses.jsonl")
    assert [row["frame"] for row in by_camera] == list(range(6))
    stamps = [row["camera_time_ns"] for row in by_camera]
    assert stamps == sorted(set(stamps))

    rows = []
    twelve = [made_frame(k, picture, every_s=0.1) for k, picture in enumerate(endpoint[:6])]
    sensor = replace(twelve[0].scene.sensor, bits=12)
    sent = [replace(frame, scene=replace(frame.scene, sensor=sensor)) for frame in twelve]
    Loop(board(PixelEstimator)).run(sent, on_row=rows.append)
    assert len(rows) == 6
    for one, other in zip(by_camera, rows, strict=True):
        assert one["accepted"] == (other.outcome == "accepted")
        assert tuple(one["q_camera_from_target_wxyz"]) == other.q_wxyz
        assert tuple(one["t_camera_from_target_m"]) == other.t_m
    assert len({row["t_camera_from_target_m"][0] for row in by_camera}) == 6


@pytest.mark.parametrize("pixel_format", ["Mono12p", pytest.param("Mono12", marks=pytest.mark.slow)])
def test_every_format_brings_the_same_pixels_in_packets_as_long_as_the_line_carries(
    endpoint, camera_file, pixel_format
):
    grab(camera_file, None, 2, software_trigger=True, pixel_format=pixel_format, packet_bytes=0)
    for seen, picture in zip(PixelEstimator.seen, endpoint, strict=False):
        assert seen.dtype == np.uint16
        assert np.array_equal(seen, picture)
    device = GigeCamera(ADDRESS, CameraSettings(packet_bytes=0))
    try:
        assert device.packet_bytes > 8000  # of loopback's; 9000 is the most that the camera sends
    finally:
        device.close()


def test_settings_reach_the_camera_and_the_estimator(endpoint, camera_file, tmp_path):
    poses = tmp_path / "poses.csv"
    settings = {"software_trigger": True, "roi_px": (8, 4, 64, 32), "exposure_us": 2500.0, "gain_db": 6.0}
    grab(camera_file, poses, 1, pixel_format="Mono8", packet_bytes=0, **settings)
    (made,) = PixelEstimator.cameras
    assert (made["width_px"], made["height_px"], made["cx_px"], made["cy_px"]) == (64, 32, 55.5, 43.5)
    (seen,) = PixelEstimator.seen
    light = 0.25 * 10 ** (6 / 20)  # a quarter of the exposure, 6 dB of gain
    wanted = np.rint(endpoint[0][4:36, 8:72] * light).astype(np.uint16) >> 4
    assert seen.dtype == np.uint8
    assert np.abs(seen.astype(int) - wanted).max() <= 1
    with poses.open() as file:
        (row,) = csv.DictReader(file)
    assert float(row["q_w"]) == pytest.approx(PixelPose(seen).q_camera_from_target_wxyz[0], abs=1e-15)
    assert int(row["camera_time_ns"]) > 0
    # back, so that the next test finds the camera as it was
    grab(camera_file, None, 1, roi_px=(0, 0, 128, 96), exposure_us=1e4, gain_db=0.0)


def test_a_camera_that_runs_freely_gives_its_newest_picture(endpoint, camera_file):
    with_pauses = []

    class Slow(PixelEstimator):
        def estimate(self, image):
            time.sleep(0.12)
            with_pauses.append(image)
            return PixelPose(image)

    told = CameraBoardOptions(camera_file=camera_file, most_frames=4)
    lines: list[str] = []
    file = type("Out", (), {"write": lambda _s, text: lines.append(text), "flush": lambda _s: None})()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("sys.stdout", file)
        run_camera_board(f"gige://{ADDRESS}", told, Slow, Hello())
    rows = [json.loads(line) for line in lines]
    assert len(with_pauses) == len(rows) == 4
    # at 30 Hz and 0.12 s a picture some are passed over; each is told of, none is looked at late
    numbers = [row["frame"] for row in rows]
    assert numbers[-1] - numbers[0] > 4
    assert sum(row["skipped"] for row in rows[1:]) > 0


def test_a_stream_that_begins_among_other_packets_is_begun_anew(endpoint, camera_file):
    """What a packet socket hears before its filter is set would hide the first hundred pictures."""
    if os.geteuid() != 0:
        pytest.skip("packet sockets are root's")
    device = GigeCamera(ADDRESS, CameraSettings())
    stop = threading.Event()

    def talk():
        """Pictures of another camera, whose numbers are those of the next hundred."""
        with (
            socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out,
            socket.socket(type=socket.SOCK_DGRAM) as to,
        ):
            to.bind(("127.0.0.1", 0))
            while not stop.is_set():
                out.sendto(bytes((0, 0, 0, 100, 1, 0, 0, 0)) + bytes(200), to.getsockname())
                time.sleep(0.0002)

    talker = threading.Thread(target=talk)
    talker.start()
    try:
        mended = 0
        for _ in range(10):
            device.start()
            until = time.monotonic() + 5.0
            frame = None
            while frame is None and time.monotonic() < until:
                mended += device.restart_if_discarding()
                frame = device.frame(0.05)
            assert frame is not None
            # thirty come in a second, and a busy machine may take two
            assert frame.number < 100
            if mended:
                break
    finally:
        stop.set()
        talker.join()
        device.close()
    if not mended:
        pytest.skip("no packet of another program came in time in ten starts")


# --- what is refused ----------------------------------------------------------------------------


def test_without_aravis_one_sentence(monkeypatch, capsys, camera_file):
    monkeypatch.setattr(aravis, "LIBRARY_NAMES", ("libaravis-none.so",))
    monkeypatch.setattr(ctypes.util, "find_library", lambda _name: None)
    aravis.load_aravis.cache_clear()
    try:
        assert run(["hil", "board", "gige://127.0.0.1", "--camera", camera_file]) == 2
        said = capsys.readouterr().err
        assert "apt-get install libaravis-0.8-0" in said
        assert len(said.strip().splitlines()) <= 2
    finally:
        aravis.load_aravis.cache_clear()


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["gige://", "--camera", "CAMERA"], "names no camera"),
        (["gige://ADDRESS"], "does not report its intrinsics"),
        (["gige://ADDRESS", "--camera", "none.json"], "none.json cannot be used"),
        (["gige://ADDRESS", "--camera", "CAMERA", "--roi", "1,2,3"], "not X,Y,WIDTH,HEIGHT"),
        (["gige://ADDRESS", "--camera", "CAMERA", "--roi", "0,0,4000,10"], "refuses --roi"),
        (["gige://ADDRESS", "--camera", "CAMERA", "--pixel-format", "Beige8"], "refuses --pixel-format"),
        (["gige://ADDRESS", "--camera", "CAMERA", "--exposure", "1e9"], "refuses --exposure"),
        (["gige://ADDRESS", "--camera", "CAMERA", "--poses", "CAMERA"], "exists already"),
        (["tcp://127.0.0.1:9", "--gain", "3"], "--gain applies to a camera"),
    ],
)
def test_mistakes_are_told_in_one_sentence(endpoint, camera_file, capsys, arguments, sentence):
    told = [a.replace("ADDRESS", ADDRESS).replace("CAMERA", camera_file) for a in arguments]
    assert run(["hil", "board", *told]) == 2
    assert sentence in capsys.readouterr().err.replace("\n", " ")


def test_the_bundles_program_takes_the_same_options(endpoint, camera_file, capsys, tmp_path):
    model = tmp_path / "none.board.json"
    line = [f"gige://{ADDRESS}", "--model", str(model), "--camera", camera_file]
    assert main([*line, "--reconnect"]) == 2
    assert "--reconnect applies to a host" in capsys.readouterr().err
    assert main(line) == 2
    assert "none.board.json" in capsys.readouterr().err


def test_another_controller_and_intrinsics_of_another_size_are_refused(endpoint, camera_file, tmp_path):
    other = tmp_path / "other.json"
    other.write_text(json.dumps({**CAMERA, "width_px": 64}))
    with pytest.raises(LinkError, match="64 x 96 pixels and the camera"):
        grab(str(other), None, 1)
    device = GigeCamera(ADDRESS, CameraSettings())
    try:
        with pytest.raises(LinkError, match="another program controls"):
            grab(camera_file, None, 1)
    finally:
        device.close()


# --- pieces -------------------------------------------------------------------------------------


def test_pixels_lie_as_their_format_says():
    rng = np.random.default_rng(1)
    twelve = rng.integers(0, 4096, (6, 10)).astype(np.uint16)
    packed = pack_pixels(twelve, PixelFormat.Mono12p)
    assert np.array_equal(grey_image(packed, 10, 6, PixelFormat.Mono12p), twelve)
    assert np.array_equal(grey_image(twelve.tobytes() + b"more", 10, 6, 0x01100005), twelve)
    assert grey_image(packed[:-1], 10, 6, PixelFormat.Mono12p) is None  # too few
    assert grey_image(bytes(180), 10, 6, PixelFormat.RGB8) is None
    assert grey_image(b"", 0, 6, PixelFormat.Mono8) is None


def test_numbers_go_on_where_identifiers_begin_again():
    count = _BlockCount()
    assert [count.number(k) for k in (1, 2, 65535, 1, 3)] == [0, 1, 65534, 65535, 65537]
    wide = _BlockCount()
    assert [wide.number(k) for k in (65534, 65536, 70000)] == [65533, 65535, 69999]


# --- the camera's file --------------------------------------------------------------------------


def test_a_camera_file_of_another_program_is_refused_by_its_key(tmp_path):
    path = tmp_path / "camera.json"
    path.write_bytes(json.dumps(CAMERA).encode("utf-8-sig"))
    assert read_camera(str(path)) == CAMERA
    path.write_text(json.dumps({**CAMERA, "dist_coeffs": [-0.3, 0.1, 0, 0, 0]}))
    with pytest.raises(LinkError, match=r"'dist_coeffs'.*--export"):
        read_camera(str(path))
