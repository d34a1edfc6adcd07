import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm

from belie.geometry import SE3, skew, so3_exp, so3_log

vectors = st.lists(st.floats(-1.7, 1.7), min_size=3, max_size=3).map(np.array)


@given(vectors, vectors)
def test_exp_agrees_with_the_matrix_exponential(v, w):
    X = np.zeros((4, 4))
    X[:3, :3], X[:3, 3] = skew(w), v
    np.testing.assert_allclose(SE3.exp([*v, *w]).matrix(), expm(X), atol=1e-9)


@given(vectors, vectors)
def test_log_inverts_exp(v, w):
    np.testing.assert_allclose(SE3.exp([*v, *w]).log(), [*v, *w], atol=1e-6)


@given(vectors, vectors, vectors)
def test_adjoint_moves_a_twist_to_the_other_side(v, w, u):
    T = SE3.exp([*v, *w])
    xi = np.concatenate([u, w[::-1]]) * 0.3
    assert (T @ SE3.exp(xi) @ T.inverse()).is_close(SE3.exp(T.adjoint() @ xi), 1e-8)


@given(vectors)
def test_quaternion_round_trip(w):
    T = SE3(so3_exp(w), np.zeros(3))
    assert SE3.from_quat_xyzw(T.quat_xyzw(), T.t).is_close(T, 1e-9)


@pytest.mark.parametrize("axis", np.eye(3))
def test_log_of_half_a_turn(axis):
    np.testing.assert_allclose(np.abs(so3_log(so3_exp(np.pi * axis))), np.pi * axis, atol=1e-6)


def test_nonsense_is_refused():
    for R, t in [
        (np.full((3, 3), np.nan), np.zeros(3)),
        (np.eye(3) * 2, np.zeros(3)),
        (-np.eye(3), np.zeros(3)),
    ]:
        with pytest.raises(ValueError, match=r"SE3|rotation"):
            SE3(R, t)
