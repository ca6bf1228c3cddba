"""Which parts of a craft with too many triangles a board draws: those that tell how it is turned."""

import numpy as np
import pytest

from flyaround.hil.board_model import outer_faces as faces
from tests.harness.boxes import closed_box


@pytest.fixture(autouse=True)
def few(monkeypatch):
    """As if boards could draw few triangles; a cover fine enough for boxes."""
    monkeypatch.setattr(faces, "MAX_TRIANGLES", 40)
    monkeypatch.setattr(faces, "SAMPLE_SPACING", 0.02)


BODY = closed_box("body", (-1, -1, -1), (1, 1, 1), "cloth")
DISH = closed_box("dish", (-0.3, -0.3, 1.5), (0.3, 0.3, 1.54), "cloth")
STRIPE = closed_box("stripe", (0.999, -0.2, -0.2), (1.005, 0.2, 0.2), "gold")
# a blanket of the body's own cloth all over one side, and hardware inside
BLANKET = closed_box("blanket", (-1, -1.006, -1), (1, -0.999, 1), "cloth")
INSIDE = closed_box("inside", (-0.5, -0.5, -0.5), (0.5, 0.5, 0.5), "gold")


def shown(monkeypatch, most_seen):
    monkeypatch.setattr(faces, "MAX_VISIBLE", most_seen)
    return faces.outer_triangles([[BODY], [BODY, BLANKET, INSIDE, STRIPE, DISH]])


def test_parts_that_tell_the_attitude_are_drawn_and_covers_are_not(monkeypatch):
    triangles, material = shown(monkeypatch, 45)
    middles = triangles.mean(axis=1)
    assert np.sum(middles[:, 2] > 1.4) >= 10
    assert material.count("gold") >= 2
    # nothing of the blanket; and the side it covered is whole again
    covered = np.abs(middles[:, 1] + 1) < 0.02
    assert np.all(np.ptp(triangles[covered][..., 1], axis=1) < 1e-6)
    assert np.allclose(middles[covered, 1], -1)
    area = np.linalg.norm(
        np.cross(
            triangles[covered, 1] - triangles[covered, 0], triangles[covered, 2] - triangles[covered, 0]
        ),
        axis=1,
    )
    assert 0.5 * area.sum() == pytest.approx(4.0)
    assert not np.any(np.abs(middles).max(axis=1) < 0.6)


def test_what_stands_off_the_craft_comes_first(monkeypatch):
    # room for one more part: the dish, which has less area than the stripe would need to be preferred
    triangles, material = shown(monkeypatch, 12 + 13)
    assert "gold" not in material
    assert np.sum(triangles.mean(axis=1)[:, 2] > 1.4) >= 10


def test_a_craft_whose_coarsest_form_is_too_much_is_not_drawn(monkeypatch):
    monkeypatch.setattr(faces, "MAX_TRIANGLES", 11)
    triangles, material = faces.outer_triangles([[BODY], [BODY, DISH]])
    assert not len(triangles)
    assert not material
