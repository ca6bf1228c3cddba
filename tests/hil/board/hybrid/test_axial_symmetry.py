"""Ends of round crafts held by near minima of their turn about the axis, and which of two drawings a picture is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from lamp_lit import lamp_lit

from flyaround.hil.board.estimation import CameraIntrinsics
from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.hybrid.decide.axial_symmetry import axis, check_axial_symmetry
from flyaround.hil.board.hybrid.decide.discrete_symmetry import preference
from flyaround.hil.board.hybrid.decide.selection import Selection, image_evidence
from flyaround.hil.board.hybrid.hypotheses.edge_support import support
from flyaround.hil.board.hybrid.hypotheses.hypothesis import Hypothesis, PoseFit, Source
from flyaround.hil.board.hybrid.image.edge_field import edge_field
from flyaround.hil.board.hybrid.image.observation import Observation
from flyaround.hil.board.hybrid.model.face_gains import OPTICS_PX
from flyaround.hil.board.hybrid.model.image_formation import blurred
from flyaround.hil.board.hybrid.model.image_patch import cut_patch, target_box
from flyaround.hil.board.hybrid.model.prepared_target import PreparedTarget
from flyaround.hil.board.hybrid.refine.close import CLOSE_PX
from flyaround.hil.board.hybrid.refine.final import refine_to_end
from flyaround.hil.board.hybrid.refine.shadows import search_sun
from flyaround.hil.board.svd.region_of_interest import Region
from flyaround.hil.evaluate.method_choice import board_model
from flyaround.simulator.targets.library import load_target

CAMERA = CameraIntrinsics(480, 300, 750.0, 750.0, 239.5, 149.5)
SUN = np.array([0.5, -0.3, -0.8])
# from the side: the capsule's wall fills half of what is seen
Q = quat.normalise(np.array([0.6, 0.65, 0.25, -0.35]))
T_M = np.array([0.1, -0.1, 22.0])

pytestmark = pytest.mark.usefixtures("one_thread")


@pytest.fixture(scope="module")
def dragon() -> PreparedTarget:
    return PreparedTarget.prepare(board_model(load_target("dragon")), CAMERA)


@pytest.fixture(scope="module")
def frame(dragon: PreparedTarget) -> Observation:
    return lamp_lit(dragon, CAMERA, Q, T_M, SUN)


def rolled(craft: PreparedTarget, angle_deg: float) -> tuple[np.ndarray, np.ndarray]:
    along, through = axis(craft.model)
    q = quat.normalise(quat.multiply(Q, quat.from_rotvec(np.radians(angle_deg) * along)))
    return q, quat.matrix(Q) @ through + T_M - quat.matrix(q) @ through


def choice_at(craft: PreparedTarget, frame: Observation, q: np.ndarray, t: np.ndarray) -> Selection:
    """A selection whose alignment began at a pose and ended where that led."""
    box = target_box(craft, q, t)
    close = cut_patch(craft, frame, box, CLOSE_PX)
    field = edge_field(frame.image, box, frame.noise, 200, background=0.0)
    s = support(craft, q, t, field)
    source = Source(Region(*map(float, box), "learned"), field)
    end = refine_to_end(craft, frame, close, Hypothesis(PoseFit(q, t, 1.0, 1e-4 * np.eye(6)), source))
    evidence = image_evidence(craft, end, s, end.score)
    return Selection(end, evidence, (), close, (end.origin,), (end,))


@pytest.mark.parametrize(
    "name", ["dragon", *(pytest.param(n, marks=pytest.mark.slow) for n in ("soyuz-ms", "tianzhou"))]
)
def test_the_axis_of_a_round_craft_is_found_from_its_walls(name: str) -> None:
    target = load_target(name)
    model = board_model(target)
    along, through = axis(model)
    # their frames: z along the axis, through the origin; parts beside the hull lean it a little
    assert abs(along[2]) > np.cos(np.radians(5.0))
    assert np.linalg.norm(through[:2]) < 0.03 * model.radius_m


def held(craft: PreparedTarget, frame: Observation, angles_deg: tuple[float, ...]) -> Selection:
    """The first of some turns that its near minimum holds.

    Which minimum an alignment falls into hangs on the last bit near the border between two: starts 7 to 9 deg off come
    out either way on one processor or another, those beyond stay; and one alone proves nothing.
    """
    for angle in angles_deg:
        choice = choice_at(craft, frame, *rolled(craft, angle))
        if np.degrees(quat.angle_rad(choice.best.q, Q)) > 6.0:
            return choice
    pytest.fail(f"no alignment that starts at {angles_deg} deg stays beyond 6 deg")


@pytest.mark.parametrize(
    "angles_deg", [(-10.0, -11.0, -9.0), pytest.param((9.0, 10.0, 8.0), marks=pytest.mark.slow)]
)
def test_a_turn_about_the_axis_that_holds_is_left_for_the_right_one(
    dragon: PreparedTarget, frame: Observation, angles_deg: tuple[float, ...]
) -> None:
    before = held(dragon, frame, angles_deg)
    after = check_axial_symmetry(dragon, frame, before)
    assert np.degrees(quat.angle_rad(after.best.q, Q)) < 1.0
    # the one it was is another answer, and told of as a rival
    assert 0 < after.evidence.margin <= after.best.score - before.best.score + 1e-9


def test_the_right_turn_stays(dragon: PreparedTarget, frame: Observation) -> None:
    before = choice_at(dragon, frame, Q, T_M)
    after = check_axial_symmetry(dragon, frame, before)
    assert np.degrees(quat.angle_rad(after.best.q, Q)) < 1.0
    assert after.best.score >= before.best.score


def test_what_neither_drawing_explains_does_not_speak_for_one(
    dragon: PreparedTarget, frame: Observation
) -> None:
    q, t = rolled(dragon, 40.0)
    canvas = replace(cut_patch(dragon, frame, target_box(dragon, Q, T_M), 240), exact=True)
    right, wrong = (search_sun(dragon, canvas, *p) for p in ((Q, T_M), (q, t)))
    a, b = (
        canvas.response.of(blurred(d.shading.picture, OPTICS_PX / canvas.factor))[0] for d in (right, wrong)
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
