import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.robot_bridge.kinematics.clearance import Clearance, nearest_places
from tests.robot_bridge.kinematics.arms import clearance, desk_arm

STEP = 1e-6
FAR = 9.0  # m
SAMPLES = np.linspace(0.0, 1.0, 101)
coordinates = st.floats(-1.0, 1.0)
points = st.tuples(coordinates, coordinates, coordinates).map(np.array)


@given(points, points, points, points)
def test_the_nearest_places_of_two_lines_are_nearer_than_all_others(
    a: np.typing.NDArray[np.float64],
    b: np.typing.NDArray[np.float64],
    c: np.typing.NDArray[np.float64],
    d: np.typing.NDArray[np.float64],
) -> None:
    s, t = nearest_places(a, b, c, d)
    assert 0.0 <= s <= 1.0
    assert 0.0 <= t <= 1.0
    found = np.linalg.norm(a + s * (b - a) - c - t * (d - c))
    one = a + SAMPLES[:, None] * (b - a)
    other = c + SAMPLES[:, None] * (d - c)
    assert found <= np.linalg.norm(one[:, None] - other[None], axis=2).min() + 1e-6


@given(st.tuples(*(st.floats(-1.5, 1.5) for _ in range(5))))
def test_the_gradient_of_a_gap_is_its_derivative(posture: tuple[float, ...]) -> None:
    chain = desk_arm()
    apart = clearance(chain)
    gaps = apart.gaps(chain.at(posture), FAR)
    for joint in range(5):
        ways = []
        for sign in (1, -1):
            moved = [value + sign * STEP * (number == joint) for number, value in enumerate(posture)]
            ways.append([gap.distance for gap in apart.gaps(chain.at(moved), FAR)])
        for gap, ahead, behind in zip(gaps, *ways, strict=True):
            # Where the nearest place jumps from one end of a line to the other the two sides differ.
            sides = sorted(((ahead - gap.distance) / STEP, (gap.distance - behind) / STEP))
            assert sides[0] - 1e-4 <= gap.gradient[joint] <= sides[1] + 1e-4


def test_only_gaps_within_the_distance_are_given() -> None:
    chain = desk_arm()
    state = chain.at((0.0,) * 5)
    assert clearance(chain).gaps(state, 0.01) == []
    distances = [gap.distance for gap in clearance(chain).gaps(state, FAR)]
    assert len(distances) == 2
    assert min(distances) == pytest.approx(0.1466, abs=1e-3)


def test_without_pairs_there_are_no_gaps() -> None:
    chain = desk_arm()
    assert Clearance(chain, {}, ()).gaps(chain.at((0.0,) * 5), FAR) == []


@given(
    st.tuples(*(st.floats(-1.5, 1.5) for _ in range(5))),
    st.tuples(*(st.floats(-0.3, 0.3) for _ in range(5))),
    st.floats(0.0, 0.1),
)
def test_pairs_that_a_motion_of_the_joints_would_bring_near_are_near_as_well(
    posture: tuple[float, ...], motion: tuple[float, ...], within: float
) -> None:
    chain = desk_arm()
    apart, state, ahead = clearance(chain), chain.at(posture), np.array(motion)
    near = [gap.distance for gap in apart.gaps(state, within, ahead)]
    for gap in apart.gaps(state, FAR):
        left = gap.distance + min(0.0, float(gap.gradient @ ahead))
        assert (gap.distance in near) == (left < within) or abs(left - within) < 1e-9
