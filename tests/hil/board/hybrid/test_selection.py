"""Selection among refined poses: rivals, margins, and near-symmetries compared on a finer patch."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from lamp_lit import CAMERA, T_M, Q

from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.hybrid.decide.discrete_symmetry import Prior, check_discrete_symmetry, preference
from flyaround.hil.board.hybrid.decide.selection import Selection, image_evidence, select_by_image
from flyaround.hil.board.hybrid.hypotheses.edge_support import support
from flyaround.hil.board.hybrid.hypotheses.hypothesis import Hypothesis, PoseFit, Source
from flyaround.hil.board.hybrid.image.edge_field import edge_field
from flyaround.hil.board.hybrid.image.observation import Observation
from flyaround.hil.board.hybrid.model.face_gains import OPTICS_PX
from flyaround.hil.board.hybrid.model.image_formation import blurred
from flyaround.hil.board.hybrid.model.image_patch import cut_patch, target_box
from flyaround.hil.board.hybrid.model.prepared_target import PreparedTarget
from flyaround.hil.board.hybrid.refine.close import CLOSE_PX
from flyaround.hil.board.hybrid.refine.photometric import explained, photo_draw
from flyaround.hil.board.hybrid.refine.shadows import search_sun
from flyaround.hil.board.svd.region_of_interest import Region

pytestmark = pytest.mark.usefixtures("one_thread")


def choice_of(craft: PreparedTarget, frame: Observation, q: np.ndarray, t: np.ndarray) -> Selection:
    """A choice that ended at a pose."""
    faces = craft.model.faces
    assert faces is not None
    box = target_box(craft, q, t)
    close = cut_patch(craft, frame, box, CLOSE_PX)
    field = edge_field(frame.image, box, frame.noise, 200, background=0.0)
    s = support(craft, q, t, field)
    source = Source(Region(*map(float, box), "learned"), field)
    score = explained(photo_draw(q, t, faces, close, CAMERA), close)
    start = Hypothesis(PoseFit(q, t, 1e-4 * np.eye(6)), source, score, s)
    end = replace(start, start=start)
    return Selection(end, image_evidence(craft, end, s, score), (), close, (start,))


@pytest.mark.parametrize("place", ["half a turn", "farther away"])
def test_a_pose_at_another_place_is_a_rival(craft: PreparedTarget, frame: Observation, place: str) -> None:
    right = choice_of(craft, frame, Q, T_M)
    start, end = right.best.origin, right.best
    turned = quat.normalise(quat.multiply(Q, np.array([0.0, 0.0, 0.0, 1.0])))
    pose = PoseFit(turned, T_M) if place == "half a turn" else PoseFit(Q, 1.15 * T_M)
    other = replace(start, pose=pose, score=0.9 * end.score)
    both = select_by_image(craft, right.close, [start, other], end)
    alone = select_by_image(craft, right.close, [start], end)
    assert alone.evidence.margin == pytest.approx(end.score)
    assert both.evidence.margin < 0.7 * alone.evidence.margin


def test_half_a_turn_is_told_by_the_finer_picture(craft: PreparedTarget, frame: Observation) -> None:
    s = craft.model.symmetry_wxyz[0]
    turned = quat.normalise(quat.multiply(Q, s))
    for q in (turned, Q):
        after = check_discrete_symmetry(craft, frame, choice_of(craft, frame, q, T_M))
        assert np.degrees(quat.angle_rad(after.best.q, Q)) < 0.5
        assert np.linalg.norm(after.best.t - T_M) < 0.02
        # the drawings differ where the picture is the one and not the other, and the other is told
        assert after.evidence.margin > 0.1 * after.best.score
        other = min(quat.angle_rad(a.q_camera_from_target_wxyz, turned) for a in after.alternatives)
        assert np.degrees(other) < 12


def test_a_learned_proposal_is_heard_about_half_a_turn_and_does_not_decide_it_alone(
    craft: PreparedTarget, frame: Observation
) -> None:
    turned = quat.normalise(quat.multiply(Q, craft.model.symmetry_wxyz[0]))
    choice = choice_of(craft, frame, turned, T_M)

    def believes(q: np.ndarray) -> Prior:
        return lambda a, _: np.where(quat.angle_rad(a, q) < 0.2, 0.0, -9.0)

    alone, agreed, against = (
        check_discrete_symmetry(craft, frame, choice, prior)
        for prior in (None, believes(Q), believes(turned))
    )
    for after in (alone, agreed, against):
        # clear as this picture is, a belief of 4 at most does not turn it
        assert np.degrees(quat.angle_rad(after.best.q, Q)) < 0.5
    assert agreed.evidence.margin >= alone.evidence.margin > against.evidence.margin + 0.02


def test_preference_ignores_what_neither_view_explains(craft: PreparedTarget, frame: Observation) -> None:
    turned = quat.normalise(quat.multiply(Q, craft.model.symmetry_wxyz[0]))
    canvas = replace(cut_patch(craft, frame, target_box(craft, Q, T_M), 240), exact=True)
    right, wrong = (search_sun(craft, canvas, q, T_M) for q in (Q, turned))
    a, b = (
        canvas.response.mean(blurred(d.shading.picture, OPTICS_PX / canvas.factor)) for d in (right, wrong)
    )
    # foil creased at random, on all that is lit
    creases = blurred(np.random.default_rng(1).normal(0, 1.0, a.shape).astype(np.float32), 1.5)
    creased = a * (1.0 + 0.3 * creases / creases.std())
    for gray, least in ((a, 0.95), (creased, 0.7)):
        seen = replace(canvas, gray=gray.astype(np.float32))
        assert preference(right, wrong, seen) > least
        assert preference(wrong, right, seen) == pytest.approx(-preference(right, wrong, seen))
    between = replace(canvas, gray=(0.5 * (a + b)).astype(np.float32))
    assert abs(preference(right, wrong, between)) < 0.05
