"""Training samples under any light: what they are made of, and what they hold."""

from __future__ import annotations

import numpy as np
import pytest

from flyaround.hil.board.hybrid.propose.learned.network import INPUT_PX
from tools.train.lit_samples import LitViews, sample_lit
from tools.train.lit_views import FARTHEST_RAD, LIGHTS, directions, surface_labels
from tools.train.proposal_views import VIEW_PX


def views(n: int = 3) -> LitViews:
    """A plate of two surfaces, lit by each light by another half."""
    rng = np.random.default_rng(2)
    square = (VIEW_PX, VIEW_PX)
    cover, label = np.zeros((n, *square), np.uint8), np.zeros((n, *square), np.uint8)
    cover[:, 20:50, 15:55] = 255
    label[:, 20:50, 15:35], label[:, 20:50, 35:55] = 1, 2
    lit = np.zeros((n, LIGHTS, *square), np.uint8)
    lit[:, ::2, 20:50, 15:35], lit[:, 1::2, 20:50, 35:55] = 200, 250
    earths = tuple(rng.random((2, 300 >> k, 480 >> k)).astype(np.float32) for k in range(3))
    q = rng.normal(size=(n, 4))
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    return LitViews(
        lit, np.full((n, LIGHTS), 0.8, np.float32), cover, label, q, np.array([6.0, 9.0, 15.0])[:n], earths
    )


def test_a_batch_is_what_the_network_takes_and_the_same_again() -> None:
    a, b = (sample_lit(views(), np.random.default_rng(7), 40) for _ in range(2))
    assert a.inputs.shape == (40, INPUT_PX, INPUT_PX, 2)
    assert np.isfinite(a.inputs).all()
    assert np.abs(a.inputs).max() <= 1.5
    np.testing.assert_array_equal(a.inputs, b.inputs)
    np.testing.assert_allclose(np.linalg.norm(a.q_wxyz, axis=1), 1.0)
    # some without a craft, which lies beside what they show
    assert 0 < (a.craft == 0).sum() < 15
    assert np.abs(a.box[a.craft == 0, :2]).min() >= 1.0


def test_lights_stand_where_they_reach_what_is_seen() -> None:
    d = np.concatenate([directions(np.random.default_rng(k)) for k in range(50)])
    np.testing.assert_allclose(np.linalg.norm(d, axis=1), 1.0)
    assert np.arccos(-d[:, 2]).max() <= FARTHEST_RAD
    assert np.abs(d[:, :2].mean(axis=0)).max() < 0.15


def test_each_side_of_a_part_is_a_surface_of_its_own() -> None:
    parts = np.array([[0, 1, 1, 2]], np.uint16)
    normals = np.array([[[0, 0, 0], [0, 0, -1], [1, 0, 0], [1, 0, 0]]], np.float16)
    labels = surface_labels(parts, normals)
    assert labels[0, 0] == 0
    assert len(np.unique(labels)) == 4


@pytest.mark.parametrize("share", [0.0, 1.0])
def test_either_kind_of_light_can_be_had_alone(share: float, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tools.train.lit_samples.ORBIT_SHARE", share)
    assert np.isfinite(sample_lit(views(), np.random.default_rng(1), 20).inputs).all()
