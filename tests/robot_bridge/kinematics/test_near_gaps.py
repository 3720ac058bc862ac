"""What `NearGaps` does not look up again is what the sources would not name, for every way that an arm may take."""

from typing import Final

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.robot_bridge.kinematics.chain import Chain, ChainState
from lockstep.robot_bridge.kinematics.clearance import Capsule, Clearance, Gap, GapSource
from lockstep.robot_bridge.kinematics.near_gaps import NearGaps
from lockstep.robot_bridge.kinematics.obstacles import Obstacle, Obstacles, Surface, plane
from lockstep.robot_bridge.kinematics.rotations import from_rotation_vector
from tests.robot_bridge.kinematics.arms import LIFT, clearance, desk_arm

Array = npt.NDArray[np.float64]
FAR: Final = 9.0  # m
ARM: Final = desk_arm()
BOX: Final = Obstacle("box", np.array((0.2, 0.05, 0.1)), from_rotation_vector((0.2, 0.5, -0.4)), np.full(3, 0.06))
FLOOR: Final = plane("floor", (0.0, 0.0, 0.02), (0.0, 0.0, 1.0))
SURFACES: Final = {
    "column": Surface(np.array(((0.0, 0.0, -0.02), (0.02, 0.01, 0.0))), np.array((0.01, 0.02))),
    "fore": Surface(np.array(((0.01, 0.0, 0.0), (0.12, 0.0, 0.0))), np.array((0.02, 0.02))),
    "hand": Surface(np.array(((0.16, 0.0, 0.0), (0.12, 0.03, 0.0))), np.array((0.01, 0.005))),
}


def vector(*values: float) -> Array:
    return np.array(values, dtype=np.float64)


def at(chain: Chain, joints: Array) -> ChainState:
    return chain.at(joints.tolist())


postures = st.tuples(*(st.floats(-1.5, 1.5) for _ in range(5))).map(np.array)
steps = st.tuples(*(st.floats(-0.08, 0.08) for _ in range(5))).map(np.array)


def sources() -> tuple[GapSource, ...]:
    return clearance(ARM), Obstacles(ARM, SURFACES, (BOX, FLOOR))


class Counting(Clearance):
    looked = 0

    def gaps(self, state: ChainState, within: float, ahead: Array | None = None) -> list[Gap]:
        self.looked += 1
        return super().gaps(state, within, ahead)

    def widths(self, state: ChainState, within: float) -> Array:
        self.looked += 1
        return super().widths(state, within)


def named(gaps: list[Gap]) -> list[tuple[float, list[float], str]]:
    """Return gaps without those that no joint changes, which nothing can keep."""
    return [(gap.distance, gap.gradient.tolist(), gap.what) for gap in gaps if gap.gradient.any()]


@given(postures, st.lists(steps, max_size=20), st.floats(0.001, 0.1), st.booleans())
def test_the_gaps_of_every_way_are_those_of_the_sources(
    posture: Array, way: list[Array], within: float, moves: bool
) -> None:
    near, alone = NearGaps(sources()), sources()
    joints = posture
    for step in way:
        joints = joints + step
        state, ahead = at(ARM, joints), step if moves else None
        found = near.gaps(joints, state, within, ahead)
        assert named(found) == named([gap for each in alone for gap in each.gaps(state, within, ahead)])


@given(postures, postures)
def test_no_distance_changes_by_more_than_its_levers_allow(one: Array, other: Array) -> None:
    for source in sources():
        change = np.abs(np.subtract(source.widths(at(ARM, one), FAR), source.widths(at(ARM, other), FAR)))
        assert (change <= source.levers @ np.abs(np.subtract(one, other)) + 1e-9).all()


@given(postures, st.floats(0.001, 0.2))
def test_widths_are_the_narrowest_distances_and_what_is_wider_counts_as_the_limit(
    posture: Array, within: float
) -> None:
    state = at(ARM, posture)
    apart, around = sources()
    every = [gap.distance for gap in apart.gaps(state, FAR)]
    assert apart.widths(state, FAR).tolist() == pytest.approx(every)
    for source in (apart, around):
        gaps = [gap.distance for gap in source.gaps(state, FAR)]
        assert source.widths(state, within).min() == pytest.approx(min(within, *gaps))


def test_an_arm_that_moves_far_from_everything_is_looked_at_seldom() -> None:
    pairs = (("foot", "hand"), ("upper", "hand"))
    capsules = {
        "foot": Capsule((0.0, 0.0, 0.0), (0.0, 0.0, 0.06), 0.045),
        "upper": Capsule((0.01, 0.0, 0.03), (0.02, 0.0, 0.09), 0.025),
        "hand": Capsule((0.05, 0.0, 0.0), (0.14, 0.0, 0.0), 0.025),
    }
    apart = Counting(ARM, capsules, pairs)
    near = NearGaps((apart,))
    for tick in range(200):
        joints = np.array((0.002 * tick, 0.0, 0.0, 0.0, 0.01 * tick))
        assert near.gaps(joints, at(ARM, joints), 0.02, np.full(5, 0.01)) == []
    assert 1 <= apart.looked < 10


def test_a_turn_of_the_first_joint_over_a_floor_brings_nothing_nearer_to_it() -> None:
    floor = Obstacles(ARM, SURFACES, (FLOOR,))
    assert not floor.levers[0].any(), "the column"
    assert not floor.levers[:, 0].any()
    assert floor.levers[1:, 1].all()
    tilted = Obstacles(ARM, SURFACES, (plane("ramp", (0.0, 0.0, 0.0), (0.1, 0.0, 1.0)),))
    assert tilted.levers[:, 0].all()


def test_an_arm_with_slides_is_looked_at_every_time() -> None:
    chain = Chain(LIFT, "tool")
    capsules = {
        "carriage": Capsule((0.0, 0.0, 0.0), (0.05, 0.0, 0.0), 0.02),
        "tool": Capsule((0.0, 0.0, 0.0), (0.1, 0.0, 0.0), 0.02),
    }
    apart = Counting(chain, capsules, (("carriage", "tool"),))
    near = NearGaps((apart,))
    joints = np.zeros(3)
    for _ in range(5):
        assert near.gaps(joints, at(chain, joints), 0.02) == []
    assert apart.looked == 5


def test_without_sources_nothing_is_near() -> None:
    assert NearGaps(()).gaps(np.zeros(5), at(ARM, np.zeros(5)), FAR) == []
