"""Poses held by a near minimum of their tilt: what leans about them is asked, and the better end wins."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from lamp_lit import lamp_lit

from flyaround.hil.board.estimation import CameraIntrinsics
from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.estimation.result import PoseResult
from flyaround.hil.board.hybrid import estimator
from flyaround.hil.board.hybrid.decide.confidence import Evidence, confidence, error_scale
from flyaround.hil.board.hybrid.decide.discrete_symmetry import Prior, check_discrete_symmetry
from flyaround.hil.board.hybrid.decide.near_minima import check_near_minima
from flyaround.hil.board.hybrid.decide.selection import Selection, image_evidence, select, select_by_image
from flyaround.hil.board.hybrid.estimator import PoseEstimator
from flyaround.hil.board.hybrid.hypotheses.edge_support import support
from flyaround.hil.board.hybrid.hypotheses.hypothesis import Hypothesis, PoseFit, Source
from flyaround.hil.board.hybrid.image.edge_field import edge_field
from flyaround.hil.board.hybrid.image.observation import Observation
from flyaround.hil.board.hybrid.image.regime import Regime
from flyaround.hil.board.hybrid.model.image_patch import cut_patch, target_box
from flyaround.hil.board.hybrid.model.prepared_target import PreparedTarget
from flyaround.hil.board.hybrid.propose.variants import near_symmetries, over_its_image, tilts
from flyaround.hil.board.hybrid.refine.close import CLOSE_PX, refine_close_up
from flyaround.hil.board.hybrid.refine.photometric import photo_score
from flyaround.hil.board.hybrid.search_states import Choice, PreparedImage, Proposals, SearchSetup
from flyaround.hil.board.svd.region_of_interest import Region
from flyaround.hil.evaluate.method_choice import board_model
from flyaround.simulator.targets.library import load_target

CAMERA = CameraIntrinsics(480, 300, 750.0, 750.0, 239.5, 149.5)
SUN = np.array([0.3, -0.2, -0.93])
Q = quat.normalise(np.array([0.2, 0.3, 0.8, -0.4]))
T_M = np.array([0.05, -0.05, 4.2])

pytestmark = pytest.mark.usefixtures("one_thread")


@pytest.fixture(scope="module")
def craft() -> PreparedTarget:
    return PreparedTarget.prepare(board_model(load_target("tango")), CAMERA)


@pytest.fixture(scope="module")
def frame(craft: PreparedTarget) -> Observation:
    return lamp_lit(craft, CAMERA, Q, T_M, SUN)


def choice_of(craft: PreparedTarget, frame: Observation, q: np.ndarray, t: np.ndarray) -> Selection:
    """A choice that ended at a pose."""
    faces = craft.model.faces
    assert faces is not None
    box = target_box(craft, q, t)
    close = cut_patch(craft, frame, box, CLOSE_PX)
    field = edge_field(frame.image, box, frame.noise, 200, background=0.0)
    s = support(q, t, craft.samples, craft.occ, field, CAMERA, craft.spacing_m)
    source = Source(Region(*map(float, box), "learned"), field)
    score = photo_score(q, t, faces, close, CAMERA)
    start = Hypothesis(PoseFit(q, t, 1.0, 1e-4 * np.eye(6)), source, score, s)
    end = replace(start, start=start)
    return Selection(end, image_evidence(craft, end, s, score), (), close, (start,), (end,))


def selected_of(
    craft: PreparedTarget, frame: Observation, leaders: list[Hypothesis]
) -> tuple[Selection, list[Hypothesis]]:
    """What is selected of leaders where a first round did not settle it, and all that was aligned close up."""
    patch, ranked = refine_close_up(craft, frame, leaders, thorough=True)
    return select_by_image(craft, frame, Regime.SUNLIGHT, patch, ranked, thorough=True), ranked


def test_a_tilt_that_holds_is_left_for_the_better_one_beside_it(
    craft: PreparedTarget, frame: Observation
) -> None:
    field = choice_of(craft, frame, Q, T_M).best
    wrong = tilts(craft, field)[0]
    before = choice_of(craft, frame, wrong.q, wrong.t)
    after = check_near_minima(craft, frame, Regime.SUNLIGHT, before)
    assert np.degrees(quat.angle_rad(wrong.q, Q)) > 10
    assert np.degrees(quat.angle_rad(after.best.q, Q)) < 0.5
    assert np.linalg.norm(after.best.t - T_M) < 0.02
    # the one it was is a rival now
    assert after.evidence.margin <= after.best.score - before.best.score
    assert len(after.ends) == 2


def test_a_right_pose_stays_and_what_leant_comes_back_to_it(
    craft: PreparedTarget, frame: Observation
) -> None:
    before = choice_of(craft, frame, Q, T_M)
    after = check_near_minima(craft, frame, Regime.SUNLIGHT, before)
    assert np.degrees(quat.angle_rad(after.best.q, Q)) < 0.5
    assert after.best.score >= before.best.score
    # nor do those that are on their way make it look doubtful
    assert after.evidence.margin >= before.evidence.margin


def test_a_start_that_led_to_the_winner_is_no_rival_of_it(craft: PreparedTarget, frame: Observation) -> None:
    right = choice_of(craft, frame, Q, T_M)
    start, end = right.best.origin, right.best
    turned = quat.normalise(quat.multiply(Q, np.array([0.0, 0.0, 0.0, 1.0])))
    other = replace(start, pose=PoseFit(turned, T_M, 1.0, np.eye(6)), score=0.9 * end.score)
    # followed from there it comes out a hair better, having begun worse
    again = replace(end, score=end.score + 1e-4, start=other)
    both = select(craft, right.close, [start, other], [end, again])
    alone = select(craft, right.close, [start], [end])
    assert both.evidence.score == again.score
    assert both.evidence.margin == pytest.approx(alone.evidence.margin)
    # where nobody followed it, it is an answer that nobody has refuted
    open_end = select(craft, right.close, [start, other], [end])
    assert open_end.evidence.margin < 0.7 * alone.evidence.margin


def test_an_end_at_another_place_is_a_rival_though_its_attitude_is_the_winners(
    craft: PreparedTarget, frame: Observation
) -> None:
    right = choice_of(craft, frame, Q, T_M)
    start, end = right.best.origin, right.best
    farther = replace(end.pose, t=1.15 * T_M)
    beyond = replace(start, pose=farther, score=0.9 * end.score)
    led_there = replace(end, pose=farther, score=0.97 * end.score, start=beyond)
    both = select(craft, right.close, [start, beyond], [end, led_there])
    assert both.evidence.margin == pytest.approx(0.03 * end.score)


def test_a_twin_is_laid_over_what_it_could_be_mistaken_for(craft: PreparedTarget, frame: Observation) -> None:
    held = choice_of(craft, frame, Q, T_M)
    beside = near_symmetries(craft, [held.best])
    over = over_its_image(craft, held.close, beside, held.best)
    # the half turn about the panel's normal, where the body's outline is its own about the target's origin
    k = int(
        np.argmin([quat.angle_rad(c.q, quat.multiply(Q, np.array([0.0, 0.0, 0.0, 1.0]))) for c in beside])
    )
    assert np.linalg.norm((over[k].t - T_M)[:2]) < 0.5 * np.linalg.norm((beside[k].t - T_M)[:2])
    assert over[k].t[2] == beside[k].t[2]
    # once there it stays
    again = over_its_image(craft, held.close, [over[k]], held.best)[0]
    assert np.linalg.norm(again.t - over[k].t) < 0.01


def test_a_half_turn_is_won_back_from_its_end(craft: PreparedTarget, frame: Observation) -> None:
    turned = quat.normalise(quat.multiply(Q, np.array([0.0, 0.0, 0.0, 1.0])))
    before = choice_of(craft, frame, turned, T_M)
    after = check_near_minima(craft, frame, Regime.SUNLIGHT, before)
    assert np.degrees(quat.angle_rad(after.best.q, Q)) < 0.5
    assert np.linalg.norm(after.best.t - T_M) < 0.02
    assert after.best.score > before.best.score + 0.02


def test_a_twin_is_asked_though_a_leader_that_is_not_compared_stands_there(
    craft: PreparedTarget, frame: Observation
) -> None:
    held = choice_of(craft, frame, Q, T_M).ranked[0]
    twin = near_symmetries(craft, [held])[0]
    leaders = [held, *(replace(h, score=0.5) for h in tilts(craft, held)[:4]), replace(twin, score=0.1)]
    selected, ranked = selected_of(craft, frame, leaders)
    # or that of the pose it was aligned to, where it is the better of the two
    assert min(float(quat.angle_rad(h.origin.q, twin.q)) for h in ranked) < 0.005
    assert np.degrees(quat.angle_rad(selected.best.q, Q)) < 0.5


def test_the_winner_s_twins_are_asked_though_another_pose_led(
    craft: PreparedTarget, frame: Observation
) -> None:
    held = choice_of(craft, frame, Q, T_M).ranked[0]
    away = quat.normalise(quat.multiply(Q, quat.from_rotvec(np.array([0.0, 0.9, 0.4]))))
    leaders = [held.at(away, T_M), held]
    selected, ranked = selected_of(craft, frame, leaders)
    assert np.degrees(quat.angle_rad(selected.best.q, Q)) < 0.5
    for twin in near_symmetries(craft, [held])[:3]:
        assert min(np.degrees(quat.angle_rad(h.origin.q, twin.q)) for h in ranked) < 2.0


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
        return lambda a, _: 0.0 if quat.angle_rad(a, q) < 0.2 else -9.0

    alone, agreed, against = (
        check_discrete_symmetry(craft, frame, choice, prior)
        for prior in (None, believes(Q), believes(turned))
    )
    for after in (alone, agreed, against):
        # clear as this picture is, a belief of 4 at most does not turn it
        assert np.degrees(quat.angle_rad(after.best.q, Q)) < 0.5
    assert agreed.evidence.margin >= alone.evidence.margin > against.evidence.margin + 0.02


def test_what_is_told_of_errors_grows_with_the_craft_and_leaves_the_decision() -> None:
    def at(size_px: float) -> Evidence:
        return Evidence(0.5, 0.5, 0.1, 0.2, 0.5, 0.5, 0.0, 0.01, 0.01, 200, size_px, empty=True, score=0.4)

    told = [error_scale(at(size)) for size in (100.0, 400.0, 1500.0)]
    assert told[0] < 0.3 * told[1] < 0.3 * 0.3 * told[2]
    assert len({confidence(at(size)) for size in (100.0, 400.0, 1500.0)}) == 1


def untried(craft: PreparedTarget, monkeypatch: pytest.MonkeyPatch) -> SearchSetup:
    """The setup of a craft whose confidence was not fitted, where every selection is taken for doubtful."""
    monkeypatch.setattr(estimator, "doubtful", lambda _: True)
    return replace(PoseEstimator(craft.model, CAMERA, accept_at=0.0).setup, tried=False)


def answer(setup: SearchSetup, frame: Observation, held: Selection) -> PoseResult:
    """What the checks and the decision make of a selection."""
    image = PreparedImage(setup, frame, np.zeros((0, 0)), [], Regime.SUNLIGHT, smoothed=False)
    return estimator.answer(estimator.check(Choice(Proposals(image, [], []), held)), None)


def test_half_a_turn_that_was_judged_is_not_brought_back_by_the_score_alone(
    craft: PreparedTarget, frame: Observation, monkeypatch: pytest.MonkeyPatch
) -> None:
    turned = quat.normalise(quat.multiply(Q, craft.model.symmetry_wxyz[0]))
    held = choice_of(craft, frame, turned, T_M)
    made = untried(craft, monkeypatch)
    # as if its witnesses had said so, here against the score
    monkeypatch.setattr(estimator, "check_discrete_symmetry", lambda _, __, choice, ___: choice)
    told = answer(made, frame, held)
    assert np.degrees(quat.angle_rad(told.q_camera_from_target_wxyz, turned)) < 15
    told = answer(replace(made, tried=True), frame, held)
    assert np.degrees(quat.angle_rad(told.q_camera_from_target_wxyz, Q)) < 0.5


def test_another_end_is_a_rival_still_where_half_turns_are_judged(
    craft: PreparedTarget, frame: Observation
) -> None:
    right = choice_of(craft, frame, Q, T_M)
    beside = quat.normalise(quat.multiply(Q, quat.from_rotvec(np.radians([0.0, 0.0, 8.0]))))
    other = replace(
        right.best,
        pose=PoseFit(beside, T_M, 1.0, 1e-4 * np.eye(6)),
        score=right.best.score - 0.004,
        start=replace(right.best.origin, score=0.1),
    )
    both = replace(right, ends=(right.best, other))
    assert check_discrete_symmetry(craft, frame, right).evidence.margin > 0.01
    assert check_discrete_symmetry(craft, frame, both).evidence.margin == pytest.approx(0.004)


def test_a_pose_that_leaning_moved_is_held_against_its_half_turns_again(
    craft: PreparedTarget, frame: Observation, monkeypatch: pytest.MonkeyPatch
) -> None:
    turned = quat.normalise(quat.multiply(Q, craft.model.symmetry_wxyz[0]))
    wrong = tilts(craft, choice_of(craft, frame, turned, T_M).best)[0]
    held = choice_of(craft, frame, wrong.q, wrong.t)
    made = untried(craft, monkeypatch)
    judged: list[np.ndarray] = []

    def turns(*given: Any) -> Selection:
        judged.append(given[2].best.q)
        # at first they say nothing: that end is far from any that could be told apart
        return held if len(judged) == 1 else check_discrete_symmetry(*given)

    monkeypatch.setattr(estimator, "check_discrete_symmetry", turns)
    told = answer(made, frame, held)
    assert len(judged) == 2
    assert np.degrees(quat.angle_rad(judged[1], wrong.q)) > 3
    assert np.degrees(quat.angle_rad(told.q_camera_from_target_wxyz, Q)) < 0.5


def test_what_half_turns_left_in_doubt_leaning_does_not_make_clear(
    craft: PreparedTarget, frame: Observation, monkeypatch: pytest.MonkeyPatch
) -> None:
    right = choice_of(craft, frame, Q, T_M)
    asked = 0.11 * right.best.score
    held = replace(right, evidence=replace(right.evidence, margin=asked))
    made = untried(craft, monkeypatch)
    # what leant ended at a worse place: the pose stands, and its margin is worked out anew without half turns
    clearer = replace(held, evidence=replace(held.evidence, margin=0.9 * held.best.score))
    monkeypatch.setattr(estimator, "check_near_minima", lambda *_, **__: clearer)
    seen: list[float] = []

    def accepts(evidence: Evidence, _: float) -> str:
        seen.append(evidence.margin)
        return ""

    monkeypatch.setattr(estimator, "decide", accepts)
    monkeypatch.setattr(estimator, "check_discrete_symmetry", lambda _, __, choice, ___: choice)
    told = answer(made, frame, held)
    assert seen == [asked]
    assert told.evidence is not None
    assert told.evidence.margin == asked
