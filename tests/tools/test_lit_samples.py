"""Training samples under any light: what they are made of, and what they hold."""

from __future__ import annotations

import numpy as np

from flyaround.hil.board.hybrid.propose.learned.network import INPUT_PX
from tools.train.lit_samples import LitViews, sample_lit
from tools.train.lit_views import LIGHTS
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
