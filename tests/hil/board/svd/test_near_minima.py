"""Poses held by a near minimum of their tilt: what leans about them is asked, and the better end wins."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from lamp_lit import lamp_lit

from hil.board.svd import CameraIntrinsics, estimator
from hil.board.svd.decide.confidence import Evidence, confidence, error_scale
from hil.board.svd.decide.discrete_symmetry import Prior, check_turned
from hil.board.svd.decide.selection import SMALL_PX, check_leaning, choose_by_picture
from hil.board.svd.estimator import PoseEstimator
from hil.board.svd.geometry import quaternion as quat
from hil.board.svd.hypotheses.edge_support import support
from hil.board.svd.hypotheses.hypothesis import Candidate
from hil.board.svd.image.edge_field import edge_field
from hil.board.svd.image.observation import Observation
from hil.board.svd.image.region import Region
from hil.board.svd.model.image_patch import craft_box, make_canvas
from hil.board.svd.model.prepared_target import PreparedTarget
from hil.board.svd.propose.edge_search import twins
from hil.board.svd.refine.final import Choice, End, conclude, picture_evidence
from hil.board.svd.refine.parallel import Ranked, laid_over, leaning
from hil.board.svd.refine.photometric import PhotoFit, photo_score
from hil.evaluate.worker import board_model
from simulator.targets.library import load_target

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


def choice_of(craft: PreparedTarget, frame: Observation, q: np.ndarray, t: np.ndarray) -> Choice:
    """A choice that ended at a pose."""
    faces = craft.model.faces
    assert faces is not None
    box = craft_box(craft, q, t)
    close = make_canvas(craft, frame, box, SMALL_PX)
    field = edge_field(frame.image, box, frame.noise, 200, background=0.0)
    s = support(q, t, craft.samples, craft.occ, field, CAMERA, craft.spacing_m)
    best = Candidate(q, t, s, field, Region(*map(float, box), "learned"))
    fit = PhotoFit(q, t, 1.0, 1e-4 * np.eye(6))
    score = photo_score(q, t, faces, close, CAMERA)
    end, ranked = End(fit, score, None, score), Ranked(score, fit, best)
    evidence = picture_evidence(craft, best, fit, score, score)
    return Choice(best, end, evidence, (), close, [ranked], [ranked], [end])


def test_a_tilt_that_holds_is_left_for_the_better_one_beside_it(
    craft: PreparedTarget, frame: Observation
) -> None:
    field = choice_of(craft, frame, Q, T_M).best
    wrong = leaning(craft, field)[0]
    before = choice_of(craft, frame, wrong.q, wrong.t)
    after = check_leaning(craft, frame, before)
    assert np.degrees(quat.angle_rad(wrong.q, Q)) > 10
    assert np.degrees(quat.angle_rad(after.end.fit.q, Q)) < 0.5
    assert np.linalg.norm(after.end.fit.t - T_M) < 0.02
    # the one it was is a rival now
    assert after.evidence.margin <= after.end.score - before.end.score
    assert len(after.ends) == 2


def test_a_right_pose_stays_and_what_leant_comes_back_to_it(
    craft: PreparedTarget, frame: Observation
) -> None:
    before = choice_of(craft, frame, Q, T_M)
    after = check_leaning(craft, frame, before)
    assert np.degrees(quat.angle_rad(after.end.fit.q, Q)) < 0.5
    assert after.end.score >= before.end.score
    # nor do those that are on their way make it look doubtful
    assert after.evidence.margin >= before.evidence.margin


def test_a_start_that_led_to_the_winner_is_no_rival_of_it(craft: PreparedTarget, frame: Observation) -> None:
    right = choice_of(craft, frame, Q, T_M)
    start, end = right.starts[0], right.end
    turned = quat.normalise(quat.multiply(Q, np.array([0.0, 0.0, 0.0, 1.0])))
    far = PhotoFit(turned, T_M, 1.0, np.eye(6))
    other = Ranked(0.9 * end.score, far, replace(right.best, q=turned))
    # followed from there it comes out a hair better, having begun worse
    again = replace(end, score=end.score + 1e-4, began=other.score)
    both = conclude(craft, frame, right.close, [start, other], [start, other], [end, again])
    alone = conclude(craft, frame, right.close, [start], [start], [end])
    assert both.evidence.score == again.score
    assert both.evidence.margin == pytest.approx(alone.evidence.margin)
    # where nobody followed it, it is an answer that nobody has refuted
    open_end = conclude(craft, frame, right.close, [start, other], [start], [end])
    assert open_end.evidence.margin < 0.7 * alone.evidence.margin


def test_an_end_at_another_place_is_a_rival_though_its_attitude_is_the_winners(
    craft: PreparedTarget, frame: Observation
) -> None:
    right = choice_of(craft, frame, Q, T_M)
    start, end = right.starts[0], right.end
    farther = replace(end.fit, t=1.15 * T_M)
    beyond = Ranked(0.9 * end.score, farther, replace(right.best, t=farther.t))
    led_there = replace(end, fit=farther, score=0.97 * end.score, began=beyond.score)
    both = conclude(craft, frame, right.close, [start, beyond], [start, beyond], [end, led_there])
    assert both.evidence.margin == pytest.approx(0.03 * end.score)


def test_a_twin_is_laid_over_what_it_could_be_mistaken_for(craft: PreparedTarget, frame: Observation) -> None:
    held = choice_of(craft, frame, Q, T_M)
    q, t = twins(craft, [held.best])
    beside = [
        Candidate(q[k], t[k], held.best.support, held.best.field, held.best.region) for k in range(len(q))
    ]
    over = laid_over(craft, held.close, beside, held.best)
    # the half turn about the panel's normal, where the body's outline is its own about the target's origin
    k = int(
        np.argmin([quat.angle_rad(c.q, quat.multiply(Q, np.array([0.0, 0.0, 0.0, 1.0]))) for c in beside])
    )
    assert np.linalg.norm((over[k].t - T_M)[:2]) < 0.5 * np.linalg.norm((beside[k].t - T_M)[:2])
    assert over[k].t[2] == beside[k].t[2]
    # once there it stays
    again = laid_over(craft, held.close, [over[k]], held.best)[0]
    assert np.linalg.norm(again.t - over[k].t) < 0.01


def test_a_half_turn_is_won_back_from_its_end(craft: PreparedTarget, frame: Observation) -> None:
    turned = quat.normalise(quat.multiply(Q, np.array([0.0, 0.0, 0.0, 1.0])))
    before = choice_of(craft, frame, turned, T_M)
    after = check_leaning(craft, frame, before)
    assert np.degrees(quat.angle_rad(after.end.fit.q, Q)) < 0.5
    assert np.linalg.norm(after.end.fit.t - T_M) < 0.02
    assert after.end.score > before.end.score + 0.02


def test_a_twin_is_asked_though_a_leader_that_is_not_compared_stands_there(
    craft: PreparedTarget, frame: Observation
) -> None:
    held = choice_of(craft, frame, Q, T_M).ranked[0]
    q, t = twins(craft, [held.start])
    leans = leaning(craft, held.start)[:4]

    def leader(score: float, a: np.ndarray, b: np.ndarray) -> Ranked:
        c = Candidate(a, b, held.start.support, held.start.field, held.start.region)
        return Ranked(score, PhotoFit(a, b, 1.0, np.eye(6)), c)

    leaders = [held, *(leader(0.5, c.q, c.t) for c in leans), leader(0.1, q[0], t[0])]
    asked: dict[str, Any] = {}
    seen = Observation(frame.image, asked)
    seen.noise, seen.background = frame.noise, frame.background
    choice = choose_by_picture(craft, seen, leaders, thorough=True)
    # or that of the pose it was aligned to, where it is the better of the two
    assert min(float(quat.angle_rad(r.start.q, q[0])) for r in asked["ranked"]) < 0.005
    assert np.degrees(quat.angle_rad(choice.end.fit.q, Q)) < 0.5


def test_the_winner_s_twins_are_asked_though_another_pose_led(
    craft: PreparedTarget, frame: Observation
) -> None:
    held = choice_of(craft, frame, Q, T_M).ranked[0]
    away = quat.normalise(quat.multiply(Q, quat.from_rotvec(np.array([0.0, 0.9, 0.4]))))
    c = Candidate(away, T_M, held.start.support, held.start.field, held.start.region)
    asked: dict[str, Any] = {}
    seen = Observation(frame.image, asked)
    seen.noise, seen.background = frame.noise, frame.background
    leaders = [Ranked(held.score, PhotoFit(away, T_M, 1.0, np.eye(6)), c), held]
    choice = choose_by_picture(craft, seen, leaders, thorough=True)
    assert np.degrees(quat.angle_rad(choice.end.fit.q, Q)) < 0.5
    for twin in twins(craft, [held.start])[0][:3]:
        assert min(np.degrees(quat.angle_rad(r.start.q, twin)) for r in asked["ranked"]) < 2.0


def test_half_a_turn_is_told_by_the_finer_picture(craft: PreparedTarget, frame: Observation) -> None:
    s = craft.model.symmetry_wxyz[0]
    turned = quat.normalise(quat.multiply(Q, s))
    for q in (turned, Q):
        after = check_turned(craft, frame, choice_of(craft, frame, q, T_M))
        assert np.degrees(quat.angle_rad(after.end.fit.q, Q)) < 0.5
        assert np.linalg.norm(after.end.fit.t - T_M) < 0.02
        # the drawings differ where the picture is the one and not the other, and the other is told
        assert after.evidence.margin > 0.1 * after.end.score
        other = min(quat.angle_rad(a.q_camera_from_target_wxyz, turned) for a in after.alternatives)
        assert np.degrees(other) < 12


def test_a_first_look_is_heard_about_half_a_turn_and_does_not_decide_it_alone(
    craft: PreparedTarget, frame: Observation
) -> None:
    turned = quat.normalise(quat.multiply(Q, craft.model.symmetry_wxyz[0]))
    choice = choice_of(craft, frame, turned, T_M)

    def believes(q: np.ndarray) -> Prior:
        return lambda a, _: 0.0 if quat.angle_rad(a, q) < 0.2 else -9.0

    alone, agreed, against = (
        check_turned(craft, frame, choice, prior) for prior in (None, believes(Q), believes(turned))
    )
    for after in (alone, agreed, against):
        # clear as this picture is, a belief of 4 at most does not turn it
        assert np.degrees(quat.angle_rad(after.end.fit.q, Q)) < 0.5
    assert agreed.evidence.margin >= alone.evidence.margin > against.evidence.margin + 0.02


def test_what_is_told_of_errors_grows_with_the_craft_and_leaves_the_decision() -> None:
    def at(size_px: float) -> Evidence:
        return Evidence(0.5, 0.5, 0.1, 0.2, 0.5, 0.5, 0.0, 0.01, 0.01, 200, size_px, empty=True, score=0.4)

    told = [error_scale(at(size)) for size in (100.0, 400.0, 1500.0)]
    assert told[0] < 0.3 * told[1] < 0.3 * 0.3 * told[2]
    assert len({confidence(at(size)) for size in (100.0, 400.0, 1500.0)}) == 1


def untried(craft: PreparedTarget, monkeypatch: pytest.MonkeyPatch, held: Choice) -> PoseEstimator:
    """An estimator of a craft whose confidence was not fitted, that comes by a choice and takes it for doubtful."""
    monkeypatch.setattr(estimator, "align_leaders", lambda *_, **__: [])
    monkeypatch.setattr(estimator, "choose_by_picture", lambda *_, **__: held)
    monkeypatch.setattr(estimator, "doubtful", lambda _: True)
    made = PoseEstimator(craft.model, CAMERA, accept_at=0.0)
    made.tried = False
    return made


def test_half_a_turn_that_was_judged_is_not_brought_back_by_the_score_alone(
    craft: PreparedTarget, frame: Observation, monkeypatch: pytest.MonkeyPatch
) -> None:
    turned = quat.normalise(quat.multiply(Q, craft.model.symmetry_wxyz[0]))
    held = choice_of(craft, frame, turned, T_M)
    made = untried(craft, monkeypatch, held)
    # as if its witnesses had said so, here against the score
    monkeypatch.setattr(estimator, "check_turned", lambda _, __, choice, ___: choice)
    told = made._chosen(frame, [held.best], ())
    assert np.degrees(quat.angle_rad(told.q_camera_from_target_wxyz, turned)) < 15
    made.tried = True
    told = made._chosen(frame, [held.best], ())
    assert np.degrees(quat.angle_rad(told.q_camera_from_target_wxyz, Q)) < 0.5


def test_another_end_is_a_rival_still_where_half_turns_are_judged(
    craft: PreparedTarget, frame: Observation
) -> None:
    right = choice_of(craft, frame, Q, T_M)
    beside = quat.normalise(quat.multiply(Q, quat.from_rotvec(np.radians([0.0, 0.0, 8.0]))))
    other = End(PhotoFit(beside, T_M, 1.0, 1e-4 * np.eye(6)), right.end.score - 0.004, None, 0.1)
    both = replace(right, starts=[right.starts[0]] * 2, ends=[right.end, other])
    assert check_turned(craft, frame, right).evidence.margin > 0.01
    assert check_turned(craft, frame, both).evidence.margin == pytest.approx(0.004)


def test_a_pose_that_leaning_moved_is_held_against_its_half_turns_again(
    craft: PreparedTarget, frame: Observation, monkeypatch: pytest.MonkeyPatch
) -> None:
    turned = quat.normalise(quat.multiply(Q, craft.model.symmetry_wxyz[0]))
    wrong = leaning(craft, choice_of(craft, frame, turned, T_M).best)[0]
    held = choice_of(craft, frame, wrong.q, wrong.t)
    made = untried(craft, monkeypatch, held)
    judged: list[np.ndarray] = []

    def turns(*given: Any) -> Choice:
        judged.append(given[2].end.fit.q)
        # at first they say nothing: that end is far from any that could be told apart
        return held if len(judged) == 1 else check_turned(*given)

    monkeypatch.setattr(estimator, "check_turned", turns)
    told = made._chosen(frame, [held.best], ())
    assert len(judged) == 2
    assert np.degrees(quat.angle_rad(judged[1], wrong.q)) > 3
    assert np.degrees(quat.angle_rad(told.q_camera_from_target_wxyz, Q)) < 0.5


def test_what_half_turns_left_in_doubt_leaning_does_not_make_clear(
    craft: PreparedTarget, frame: Observation, monkeypatch: pytest.MonkeyPatch
) -> None:
    right = choice_of(craft, frame, Q, T_M)
    asked = 0.11 * right.end.score
    held = replace(right, evidence=replace(right.evidence, margin=asked))
    made = untried(craft, monkeypatch, held)
    # what leant ended at a worse place: the pose stands, and its margin is worked out anew without half turns
    clearer = replace(held, evidence=replace(held.evidence, margin=0.9 * held.end.score))
    monkeypatch.setattr(estimator, "check_leaning", lambda *_, **__: clearer)
    seen: list[float] = []
    decided = made._decided

    def decide(f: Observation, fit: Any, evidence: Evidence, *rest: Any) -> Any:
        seen.append(evidence.margin)
        return decided(f, fit, evidence, *rest)

    monkeypatch.setattr(made, "_decided", decide)
    monkeypatch.setattr(estimator, "check_turned", lambda _, __, choice, ___: choice)
    made._chosen(frame, [held.best], ())
    assert seen == [asked, asked]
