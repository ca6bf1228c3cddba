"""Rasteriser, shadows and hidden edges by the compiled library: the same answers as numpy's."""

from __future__ import annotations

from dataclasses import replace

import msgspec
import numpy as np
import pytest
from kernel_oracle import raster as oracle

from flyaround.hil.board.estimation import BoardModel, CameraIntrinsics
from flyaround.hil.board.hybrid.model import rasteriser as shade
from flyaround.hil.board.hybrid.model.rasteriser import order_faces
from flyaround.hil.board.hybrid.model.shadow_map import ShadowMap
from flyaround.hil.board_model.write import board_record
from flyaround.simulator.targets.library import load_target

CAMERA = CameraIntrinsics(200, 160, 400.0, 400.0, 99.5, 79.5)


@pytest.fixture(scope="module")
def tango() -> BoardModel:
    return BoardModel.from_dict(msgspec.to_builtins(board_record(load_target("tango"))))


def test_polygons_are_filled_to_the_pixel_as_by_opencv() -> None:
    rng = np.random.default_rng(4)
    for k in range(300):
        middle, size = rng.uniform(-50, 250, (40, 1, 2)), rng.choice([3, 20, 60, 300, 6000])
        a = np.sort(rng.uniform(0, 2 * np.pi, (40, 4)), axis=1)
        if k % 3 == 0:
            a[:, 3] = a[:, 2]
        # slender ones cross over themselves when they are rounded to sixteenths
        p = middle + size * np.stack([np.cos(a), np.sin(a) * rng.choice([1, 0.02])], axis=-1)
        p = p[:, ::-1] if k % 2 and k % 3 else p
        some = rng.permutation(40)
        one, other = (
            fill(p, some, (180, 200), 0.5, exact=k % 5 == 0) for fill in (shade.fill_faces, oracle.fill_faces)
        )
        np.testing.assert_array_equal(one, other)


def test_poses_that_are_none_draw_nothing_and_harm_nothing(tango: BoardModel) -> None:
    faces = tango.faces
    canvas = shade.ImagePatch(np.zeros((16, 16), np.float32), 1.0, 0.0, 0.0, 1.0, 3)
    sun = ShadowMap.from_faces(faces, np.array([0.2, 0.3, 0.9]), 64)
    for place in ([np.nan] * 3, [0, 0, np.inf], [0, 0, -5.0], [1e30, 0, 1.0], [0, 0, 0]):
        R, t = np.eye(3), np.array(place, float)
        some = order_faces(faces, -t)
        seen = shade.draw_faces(faces, np.arange(len(faces.corners)), CAMERA, R, t, canvas)
        assert len(some) <= len(faces.corners)
        assert seen.min() >= 0
        assert seen.max() <= len(faces.corners)
        # whatever a picture holds: numbers of faces that are not there
        wild = np.full_like(seen, 2**31 - 1)
        wild[::2] = -5
        dark = sun.shadows(faces, wild, canvas, CAMERA, R, t)
        assert not dark.any()
        sun.shadows(faces, np.maximum(seen, 1), canvas, CAMERA, R, t)
    nothing = replace(canvas, gray=np.zeros((0, 4), np.float32))
    assert shade.draw_faces(faces, np.arange(9), CAMERA, np.eye(3), np.array([0, 0, 4.0]), nothing).size == 0
