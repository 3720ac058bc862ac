import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.robot_bridge.kinematics.rotations import (
    about_axis,
    from_quaternion,
    from_rotation_vector,
    quaternion,
    rotation_vector,
)

parts = st.floats(-4.0, 4.0)
vectors = st.tuples(parts, parts, parts)


@given(vectors)
def test_the_matrix_of_a_rotation_vector_is_a_rotation(vector: tuple[float, float, float]) -> None:
    matrix = from_rotation_vector(vector)
    assert matrix @ matrix.T == pytest.approx(np.eye(3), abs=1e-9)
    assert np.linalg.det(matrix) == pytest.approx(1.0)


@given(vectors)
def test_a_rotation_vector_read_back_is_the_same_rotation_by_half_a_turn_at_most(
    vector: tuple[float, float, float],
) -> None:
    matrix = from_rotation_vector(vector)
    back = rotation_vector(matrix)
    assert np.linalg.norm(back) <= math.pi + 1e-9
    assert from_rotation_vector(back.tolist()) == pytest.approx(matrix, abs=1e-6)


@given(vectors, st.floats(-1e-3, 1e-3))
def test_around_half_a_turn_too(vector: tuple[float, float, float], more: float) -> None:
    length = math.hypot(*vector)
    if length < 1e-3:
        return
    matrix = about_axis([part / length for part in vector], math.pi + more)
    assert from_rotation_vector(rotation_vector(matrix).tolist()) == pytest.approx(matrix, abs=1e-6)


def test_no_rotation_has_the_vector_nought() -> None:
    assert rotation_vector(np.eye(3)).tolist() == [0.0, 0.0, 0.0]


def test_a_quaternion_of_any_length_is_a_rotation() -> None:
    assert from_quaternion((2.0, 0.0, 0.0, 2.0)) == pytest.approx(about_axis((0.0, 0.0, 1.0), math.pi / 2))


@pytest.mark.parametrize("zero", [(0.0, 0.0, 0.0, 0.0), (math.nan, 0.0, 0.0, 1.0), (math.inf, 0.0, 0.0, 0.0)])
def test_a_quaternion_without_a_length_is_none(zero: tuple[float, float, float, float]) -> None:
    with pytest.raises(ValueError, match="not a rotation"):
        from_quaternion(zero)


@given(vectors)
def test_the_quaternion_of_a_matrix_is_the_same_rotation(vector: tuple[float, float, float]) -> None:
    matrix = from_rotation_vector(vector)
    found = quaternion(matrix)
    assert math.hypot(*found) == pytest.approx(1.0)
    assert from_quaternion(found) == pytest.approx(matrix, abs=1e-6)
