"""A slanted, bent, shaded and noisy camera sees a pre-distorted frame as it was drawn."""

import os

import cv2
import msgspec
import numpy as np
import pytest
from standin_camera import StandInCamera

from flyaround.hil.corner_code import CodePlace, CornerCode, draw_code, read_code
from flyaround.hil.display.calibration import calibrate, read_calibration, write_calibration
from flyaround.hil.display.patterns import calibration_patterns
from flyaround.hil.display.predistort import Predistorter
from flyaround.simulator.errors import UserError

SCREEN = (1280, 800)
SQUARES = (10, 7)
SQUARE_PX = 90
FULL = 4095


@pytest.fixture(scope="module")
def camera():
    return StandInCamera(SCREEN)


@pytest.fixture(scope="module")
def calibration(camera):
    return calibrate({p.name: camera.look(p.image) for p in calibration_patterns(*SCREEN)}, SCREEN)


def chessboard(size_px):
    """A frame of 12 bits with a chessboard in its middle, blurred as by a lens, and its inner corners."""
    width, height = size_px
    left, top = (width - SQUARES[0] * SQUARE_PX) // 2, (height - SQUARES[1] * SQUARE_PX) // 2
    cells = (np.indices((SQUARES[1], SQUARES[0])).sum(axis=0) % 2).astype(np.float32)
    frame = np.full((height, width), 0.5, np.float32)
    board = np.kron(cells, np.ones((SQUARE_PX, SQUARE_PX), np.float32))
    frame[top : top + board.shape[0], left : left + board.shape[1]] = 0.1 + 0.8 * board
    corners = [
        (left + i * SQUARE_PX - 0.5, top + j * SQUARE_PX - 0.5)
        for j in range(1, SQUARES[1])
        for i in range(1, SQUARES[0])
    ]
    frame = cv2.GaussianBlur(frame, (0, 0), 1.0)
    return np.rint(frame * FULL).astype(np.uint16), np.array(corners, np.float32)


def refine(image, corners):
    found = corners[:, None].copy()
    stop = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 60, 1e-4)
    grey = np.clip(image * (255 / image.max()), 0, 255).astype(np.uint8)
    return cv2.cornerSubPix(grey, found, (9, 9), (-1, -1), stop)[:, 0]


def test_the_map_is_the_cameras(camera, calibration):
    rows, columns = np.mgrid[100:800:50, 150:1050:50]
    screen = np.column_stack((camera.map_x[rows, columns].ravel(), camera.map_y[rows, columns].ravel()))
    error = calibration.camera_from_screen(screen) - np.column_stack((columns.ravel(), rows.ravel()))
    # fringes of 48 px read by eight pictures of noise 6 in 3,000: 0.03 px a pixel, a hundredth over thousands
    assert np.hypot(*error.T).max() < 0.1


def test_corners_and_levels(camera, calibration):
    frame, corners = chessboard(camera.size_px)
    shown = Predistorter(calibration).screen_image(frame, FULL)
    grabbed = camera.look(shown)
    # the picture's corners as OpenCV finds them in the grab, beside where they were drawn
    error = np.hypot(*(refine(grabbed, corners) - corners).T)
    assert error.max() < 0.3
    blurred = [cv2.GaussianBlur(x.astype(np.float64), (0, 0), 4) for x in (grabbed, frame)]
    seen = (blurred[0] - calibration.black_dn) / calibration.white_dn
    inner = SQUARE_PX // 2
    centres = (corners + inner).astype(int)
    for x, y in centres:
        assert seen[y, x] == pytest.approx(blurred[1][y, x] / FULL, abs=0.02)


def test_code_is_read_from_the_grab(camera, calibration):
    code = CornerCode(frame_id=1234, time_ns=1_787_218_200_123_456_789)
    frame, _ = chessboard(camera.size_px)
    marked = draw_code(frame, code, calibration.code_place, FULL)
    grabbed = camera.look(Predistorter(calibration).screen_image(marked, FULL))
    assert read_code(grabbed, calibration.code_place) == code


def test_calibration_is_kept(calibration, tmp_path):
    write_calibration(calibration, tmp_path / "c.json")
    assert read_calibration(tmp_path / "c.json") == calibration
    (tmp_path / "bad.json").write_text("{}")
    with pytest.raises(UserError, match="not a calibration"):
        read_calibration(tmp_path / "bad.json")


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("screen_px", (0, 800)),
        ("screen_px", (10**9, 10**9)),
        ("camera_px", (1, 1)),
        ("homography", [1.0, 0.0, 0.0]),
        ("bend", [[[0.0]]]),
        ("shading", []),
        ("levels", [0, 0, 255]),
        ("response", [0.0, 1.0]),
        ("white_dn", 0.0),
        ("code_cell_px", 0),
    ],
)
def test_a_calibration_file_with_an_impossible_value_is_refused(calibration, tmp_path, field, value):
    document = msgspec.json.decode(msgspec.json.encode(calibration)) | {field: value}
    (tmp_path / "bad.json").write_bytes(msgspec.json.encode(document))
    with pytest.raises(UserError, match=f"not a calibration .*{field}"):
        read_calibration(tmp_path / "bad.json")


def test_a_pipe_is_no_calibration(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(UserError, match="pipe"):
        read_calibration(tmp_path / "pipe")


def test_a_screen_that_is_not_seen_is_refused(camera):
    black = np.full(camera.size_px[::-1], 64.0)
    grabs = {p.name: black for p in calibration_patterns(*SCREEN)}
    with pytest.raises(UserError, match="screen is not found"):
        calibrate(grabs, SCREEN)
    with pytest.raises(UserError, match="no picture of level_000"):
        calibrate({}, SCREEN)
    grabs["level_015"] = black[:8, :8]
    with pytest.raises(UserError, match="level_015 is 8 x 8 pixels, level_000 is"):
        calibrate(grabs, SCREEN)


def test_frame_of_another_size(calibration):
    with pytest.raises(UserError, match="64 x 64 px"):
        Predistorter(calibration).screen_image(np.zeros((64, 64), np.uint8), 255)


@pytest.mark.parametrize("bits", [8, 12, 16])
def test_code_round_trip_and_damage(bits):
    rng = np.random.default_rng(bits)
    white = 2**bits - 1
    image = rng.integers(0, white + 1, (120, 160)).astype(np.uint16)
    place = CodePlace(left_px=7, top_px=11, cell_px=4)
    for _ in range(50):
        code = CornerCode(int(rng.integers(2**32)), int(rng.integers(2**63)))
        drawn = draw_code(image, code, place, white)
        assert read_code(drawn, place) == code
        left, top, right, bottom = place.box_px
        outside = np.ones(image.shape, bool)
        outside[top:bottom, left:right] = False
        assert np.array_equal(drawn[outside], image[outside])
        # one cell of the other colour: the check fails, whatever the cell
        row, column = rng.integers(1, 9), rng.integers(1, 17)
        cell = drawn[top + 4 * row : top + 4 * row + 4, left + 4 * column : left + 4 * column + 4]
        cell[:] = white - cell
        assert read_code(drawn, place) is None
    assert read_code(np.zeros_like(image), place) is None
    with pytest.raises(ValueError, match="does not fit"):
        draw_code(image, code, CodePlace(cell_px=40), white)


@pytest.mark.parametrize(("frame_id", "time_ns"), [(-1, 0), (2**32, 0), (0, -1), (0, 2**64)])
def test_a_code_that_does_not_fit_its_bits_is_refused(frame_id, time_ns):
    with pytest.raises(ValueError, match="is outside 0 to 2"):
        draw_code(np.zeros((600, 800), np.uint8), CornerCode(frame_id, time_ns), CodePlace(), 255)
