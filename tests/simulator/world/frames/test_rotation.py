"""Rotations and poses: inverses, composition, one rotation for both signs, frames that must match."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from flyaround.simulator.world.frames.pose import Pose
from flyaround.simulator.world.frames.rotation import (
    matrix_from_quat,
    quat_conjugate,
    quat_from_matrix,
    quat_from_rotvec,
    quat_multiply,
    quat_normalize,
    rotation_angle_rad,
)

component = st.floats(-1, 1, allow_subnormal=False)
vectors = st.tuples(component, component, component).map(np.array)


@st.composite
def quaternions(draw):
    q = np.array(draw(st.tuples(component, component, component, component)))
    assume(np.linalg.norm(q) > 0.05)
    return quat_normalize(q)


@given(quaternions(), vectors)
def test_matrix_is_a_rotation_and_both_signs_are_one(q, x):
    R = matrix_from_quat(q)
    assert np.allclose(R @ R.T, np.eye(3), atol=1e-14)
    assert np.linalg.det(R) == pytest.approx(1, abs=1e-13)
    assert np.array_equal(R, matrix_from_quat(-q))
    assert np.linalg.norm(R @ x) == pytest.approx(np.linalg.norm(x), abs=1e-14)


@given(quaternions(), quaternions())
def test_product_composes_as_matrices_do(p, q):
    product = matrix_from_quat(quat_multiply(p, q))
    assert np.allclose(product, matrix_from_quat(p) @ matrix_from_quat(q), atol=1e-14)


@given(quaternions())
def test_quaternion_survives_its_matrix(q):
    back = quat_from_matrix(matrix_from_quat(q))
    assert back[0] >= 0
    assert rotation_angle_rad(q, back) < 1e-14
    assert np.allclose(quat_multiply(q, quat_conjugate(q)), [1, 0, 0, 0], atol=1e-15)


@given(quaternions(), vectors)
def test_angle_between_attitudes_is_that_of_the_turn(q, rotvec):
    turned = quat_multiply(q, quat_from_rotvec(rotvec))
    assert rotation_angle_rad(q, turned) == pytest.approx(np.linalg.norm(rotvec), abs=1e-14)
    assert rotation_angle_rad(q, -turned) == pytest.approx(np.linalg.norm(rotvec), abs=1e-14)


@given(quaternions(), vectors, quaternions(), vectors, vectors)
def test_poses_compose_and_invert(p, s, q, t, x):
    a_from_b, b_from_c = Pose.from_arrays("a", "b", p, s), Pose.from_arrays("b", "c", q, t)
    assert np.allclose((a_from_b @ b_from_c).apply(x), a_from_b.apply(b_from_c.apply(x)), atol=1e-14)
    assert np.allclose(a_from_b.inverse().apply(a_from_b.apply(x)), x, atol=1e-14)


def test_mismatched_frames_do_not_compose():
    a_from_b = Pose.from_arrays("a", "b", [1, 0, 0, 0], [0, 0, 0])
    with pytest.raises(ValueError, match="cannot compose a_from_b with a_from_b"):
        a_from_b @ a_from_b


@pytest.mark.parametrize("q", [[0, 0, 0, 0], [np.nan, 0, 0, 1]])
def test_no_rotation_has_this_quaternion(q):
    with pytest.raises(ValueError, match="finite and not zero"):
        Pose.from_arrays("a", "b", q, [0, 0, 0])


@pytest.mark.parametrize("axis", range(3))
def test_half_turns_survive_their_matrix(axis):
    q = quat_from_rotvec(np.pi * np.eye(3)[axis])
    assert rotation_angle_rad(q, quat_from_matrix(matrix_from_quat(q))) < 1e-14
