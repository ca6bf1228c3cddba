"""Figures of single craft: Tango's keypoints, Dragon's height, solar wings, Envisat's panels, the chessboard."""

import functools

import cv2
import numpy as np
import pytest

from flyaround.simulator.targets.library import load_target
from tools.craft.dragon.crew import dragon_pieces
from tools.craft.level import Level

# Keypoints of the SPEED data set as published with its pose estimation baselines [m]
SPEED = {
    "panel_nx_ny": (-0.370, -0.385, 0.3215),
    "panel_px_ny": (0.370, -0.385, 0.3215),
    "panel_px_py": (0.370, 0.385, 0.3215),
    "panel_nx_py": (-0.370, 0.385, 0.3215),
    "bottom_nx_ny": (-0.370, -0.264, 0.0),
    "bottom_px_ny": (0.370, -0.264, 0.0),
    "bottom_px_py": (0.370, 0.304, 0.0),
    "bottom_nx_py": (-0.370, 0.304, 0.0),
    "antenna_1_tip": (-0.5427, 0.4877, 0.2535),
    "antenna_2_tip": (0.5427, 0.4877, 0.2591),
    "antenna_3_tip": (0.3050, -0.5790, 0.2515),
}

load = functools.cache(load_target)


@pytest.fixture(scope="module")
def tango():
    return load("tango")


def test_speed_keypoints_come_first_and_to_the_digit(tango):
    first = {k.name: k.position_m for k in tango.keypoints[:11]}
    assert list(first) == list(SPEED)
    for name, position in SPEED.items():
        assert np.abs(np.subtract(first[name], position)).max() < 1e-9


def test_quarter_turns_nearly_map_the_craft_onto_itself(tango):
    corners = np.array([SPEED[n] for n in list(SPEED)[:4]])
    for w, x, y, z in tango.symmetry:
        assert w * w + x * x + y * y + z * z == pytest.approx(1)
        assert (x, y) == (0, 0)
        turn = 2 * np.arctan2(z, w)
        R = np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
        gap = np.linalg.norm((corners @ R.T)[:, None] - corners, axis=2).min(axis=1)
        # panel of 0.74 x 0.77 m: a quarter turn misses by 15 mm along each axis
        assert gap.max() < 0.022


def test_crew_dragon_with_closed_nose_is_as_high_as_published():
    z = np.concatenate([p.mesh.positions_m[:, 2] for p in dragon_pieces(Level(), nose_closed=True)])
    assert np.ptp(z) == pytest.approx(8.1, rel=0.005)
    trunk = next(p for p in load("dragon").parts if p.name == "trunk_tube")
    assert np.ptp(trunk.positions_m, axis=0)[:2] == pytest.approx([3.7, 3.7], rel=0.005)
    # half the trunk's circumference carries cells
    cells = next(p for p in load("dragon").parts if p.name == "trunk_cells").positions_m
    azimuth = np.rad2deg(np.arctan2(cells[:, 1], cells[:, 0])) % 360
    assert np.ptp(azimuth) == pytest.approx(180, abs=12)


def test_envisat_turns_as_published():
    mass = load("envisat").mass
    # debris-removal studies quote 7,828 kg, x = -3.9 m and 17,000, 125,000, 129,000 kg m2
    assert mass.com_m[0] == pytest.approx(-3.9, abs=0.15)
    assert np.diag(mass.inertia_kg_m2) == pytest.approx([17_000, 125_000, 129_000], rel=0.13)


def test_thesis_and_speed_are_never_mixed():
    thesis = {k.name: k.position_m for k in load("tango-thesis").keypoints}
    speed = {k.name: k.position_m for k in load("tango").keypoints}
    shared = set(thesis) & set(speed)
    assert len(shared) >= 8
    assert all(np.abs(np.subtract(thesis[n], speed[n])).max() > 5e-3 for n in shared)
    tips = [n for n in thesis if n.endswith("_tip")]
    lengths = [np.linalg.norm(np.subtract(thesis[n], thesis[n.replace("tip", "root")])) for n in tips]
    assert lengths == pytest.approx([0.204] * 4)


def test_opencv_reads_the_board_in_the_order_of_its_keypoints():
    board = load("chessboard")
    scale, shift = 2000.0, (620.0, 500.0)  # px per metre, upright and face on: y of the image runs down

    def pixel(points):
        return points[..., :2] * (scale, -scale) + shift

    image = np.full((1000, 1240), 60, np.uint8)
    grey = {"board-white": 220, "board-black": 20}
    for part in board.parts:
        up = part.normals[part.triangles[:, 0], 2] > 0.99
        if part.material in grey:
            for triangle in pixel(part.positions_m.astype(float)[part.triangles[up]]):
                # four bits of fraction: a sixteenth of a pixel
                cv2.fillConvexPoly(
                    image, np.round(triangle * 16).astype(np.int32), grey[part.material], shift=4
                )
    expected = pixel(np.array([k.position_m for k in board.keypoints]))
    # turned upside down, the colours still tell which corner is the first
    for turn in (False, True):
        seen, at = (image[::-1, ::-1].copy(), (1239, 999) - expected) if turn else (image, expected)
        found, corners = cv2.findChessboardCorners(seen, (10, 7))
        assert found
        assert np.linalg.norm(corners.reshape(-1, 2) - at, axis=1).max() < 1.5
        # the sector-based detector starts from the other end
        found, corners = cv2.findChessboardCornersSB(seen, (10, 7))
        assert found
        assert np.linalg.norm(corners.reshape(-1, 2)[::-1] - at, axis=1).max() < 1.5
