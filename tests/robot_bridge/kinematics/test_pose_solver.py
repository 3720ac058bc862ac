import itertools
import math

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from lockstep.robot_bridge.kinematics.chain import Chain
from lockstep.robot_bridge.kinematics.obstacles import Obstacles, Surface, plane
from lockstep.robot_bridge.kinematics.pose_solver import JointBounds, PoseSolver, Tuning
from lockstep.robot_bridge.kinematics.rotations import from_rotation_vector, rotation_vector
from tests.robot_bridge.kinematics.arms import BOUNDS, LIFT, clearance, desk_arm

Array = npt.NDArray[np.float64]
TICK = 0.004  # s
SECONDS = 3
few = settings(max_examples=15)  # an example is a thousand steps
pytestmark = pytest.mark.slow
ARM = desk_arm()
APART = clearance(ARM)
SLACK = 1e-9

reachable = st.tuples(
    *(st.floats(0.9 * lower, 0.9 * upper) for lower, upper in zip(BOUNDS.lower, BOUNDS.upper, strict=True))
)
shares = st.tuples(*(st.floats(-0.3, 0.3) for _ in range(5)))
directions = st.tuples(st.floats(-1, 1), st.floats(-1, 1), st.floats(-1, 1)).filter(
    lambda each: math.hypot(*each) > 0.1
)
turns = st.tuples(*(st.floats(-2.0, 2.0) for _ in range(3)))


def clipped(posture: Array) -> tuple[float, ...]:
    return tuple(np.clip(posture, BOUNDS.lower, BOUNDS.upper).tolist())


def run(
    solver: PoseSolver, start: tuple[float, ...], position: Array, rotation: Array, seconds: float = SECONDS
) -> list[tuple[float, ...]]:
    """Step towards a pose that stands still; check every step."""
    way, rates = [start], (0.0,) * len(start)
    for _ in range(round(seconds / TICK)):
        solution = solver.step(way[-1], position, rotation, TICK, before=rates)
        rates = solution.rates
        way.append(solution.joints)
    for before, after in itertools.pairwise(way):
        for number, (old, new) in enumerate(zip(before, after, strict=True)):
            assert abs(new - old) <= BOUNDS.rates[number] * TICK + SLACK
            assert BOUNDS.lower[number] <= new <= BOUNDS.upper[number]
    return way


def swings(way: list[tuple[float, ...]], ticks: int) -> float:
    """How far a joint goes to and fro in the last ticks, beside the way that it makes, rad."""
    steps = np.diff(np.array(way[-ticks:]), axis=0)
    return float((np.abs(steps).sum(axis=0) - np.abs(steps.sum(axis=0))).max())


@few
@given(reachable, shares)
def test_a_pose_that_can_be_reached_is_reached(goal: tuple[float, ...], off: tuple[float, ...]) -> None:
    wanted = ARM.at(goal)
    assume(np.linalg.svd(wanted.linear, compute_uv=False)[-1] > 0.03)  # near singularities it takes longer
    way = run(PoseSolver(ARM, BOUNDS), clipped(np.array(goal) + off), wanted.position, wanted.rotation)
    there = ARM.at(way[-1])
    assert np.linalg.norm(there.position - wanted.position) < 1e-3


@few
@given(reachable, directions, st.floats(0.02, 0.6), turns)
def test_towards_any_pose_no_joint_passes_its_rate_or_range_and_none_swings(
    start: tuple[float, ...], direction: tuple[float, float, float], far: float, turn: tuple[float, float, float]
) -> None:
    begun = ARM.at(start)
    position = begun.position + np.array(direction) / math.hypot(*direction) * far
    way = run(PoseSolver(ARM, BOUNDS), start, position, from_rotation_vector(turn) @ begun.rotation)
    assert swings(way, 100) < 0.05


@few
@given(st.floats(-1.5, 1.5), st.floats(0.0, 0.4), turns)
def test_a_pose_outside_of_what_it_reaches_is_approached_to_the_nearest_place(
    pan: float, height: float, turn: tuple[float, float, float]
) -> None:
    axis = np.array((0.03, 0.0, 0.0))  # of the pan
    outside = axis + np.array((0.9 * math.cos(pan), 0.9 * math.sin(pan), height))
    start = (pan / 2, -0.3, 0.4, 0.3, 0.0)
    way = run(PoseSolver(ARM, BOUNDS, turns=False), start, outside, np.eye(3), seconds=5)
    left = [float(np.linalg.norm(ARM.at(joints).position - outside)) for joints in way[:: round(0.1 / TICK)]]
    assert left[-1] == pytest.approx(min(left), abs=2e-3)  # it stays where it is nearest
    assert way[-1][0] == pytest.approx(pan, abs=0.02)  # and points there
    reach = math.hypot(0.03, 0.115) + 0.135 + 0.16
    shoulder = axis + np.array((0.03 * math.cos(pan), 0.03 * math.sin(pan), 0.12))
    assert left[-1] == pytest.approx(np.linalg.norm(outside - shoulder) - reach, abs=0.02)


@few
@given(turns)
def test_the_position_comes_before_a_rotation_that_the_arm_cannot_have(turn: tuple[float, float, float]) -> None:
    goal = (0.3, 0.1, 0.4, 0.6, 0.2)
    wanted = ARM.at(goal)
    way = run(PoseSolver(ARM, BOUNDS), goal, wanted.position + (0.0, 0.02, 0.0), from_rotation_vector(turn))
    there = ARM.at(way[-1])
    if not any(math.isclose(value, bound, abs_tol=0.02) for value, bound in at_bounds(way[-1])):
        assert there.position == pytest.approx(wanted.position + (0.0, 0.02, 0.0), abs=2e-3)


def at_bounds(joints: tuple[float, ...]) -> list[tuple[float, float]]:
    return [*zip(joints, BOUNDS.lower, strict=True), *zip(joints, BOUNDS.upper, strict=True)]


@few
@given(st.floats(0.1, 1.0), st.floats(-0.5, 0.5))
def test_through_a_stretched_arm_and_back_the_joints_go_without_a_jump(speed: float, pan: float) -> None:
    """The tool's goal moves straight out of reach and in again, at up to 1 m/s."""
    joints: tuple[float, ...] = (pan, 0.3, 0.3, 0.2, 0.0)
    begun = ARM.at(joints)
    out = np.array((math.cos(pan), math.sin(pan), 0.1)) * speed
    solver = PoseSolver(ARM, BOUNDS)
    rates: list[tuple[float, ...]] = [(0.0,) * 5]
    goal = begun.position
    for tick in range(round(2.0 / TICK)):
        velocity = out if tick < 250 else -out
        goal = goal + velocity * TICK
        solution = solver.step(joints, goal, begun.rotation, TICK, velocity=velocity, before=rates[-1])
        joints = solution.joints
        rates.append(solution.rates)
    changes = np.abs(np.diff(np.array(rates), axis=0)) / np.array(BOUNDS.rates)
    assert changes.max() <= TICK / BOUNDS.ramp + SLACK


@few
@given(reachable, directions, st.floats(0.05, 0.4))
def test_parts_of_the_arm_come_no_nearer_to_each_other_than_allowed(
    start: tuple[float, ...], direction: tuple[float, float, float], far: float
) -> None:
    def nearest(joints: tuple[float, ...]) -> float:
        return min(gap.distance for gap in APART.gaps(ARM.at(joints), 9.0))

    assume(nearest(start) > 0.04)
    begun = ARM.at(start)
    position = begun.position + np.array(direction) / math.hypot(*direction) * far
    way = run(PoseSolver(ARM, BOUNDS, keeps_off=(APART,)), start, position, begun.rotation)
    assert min(map(nearest, way[::10])) > 0.0


def test_a_tool_whose_goal_moves_follows_it_without_lag() -> None:
    solver = PoseSolver(ARM, BOUNDS)
    joints: tuple[float, ...] = (0.0, -0.2, 0.6, 0.8, 0.0)
    begun = ARM.at(joints)
    velocity = np.array((0.0, 0.1, -0.05))
    goal = begun.position
    for _ in range(200):
        goal = goal + velocity * TICK
        joints = solver.step(joints, goal, begun.rotation, TICK, velocity=velocity).joints
    assert ARM.at(joints).position == pytest.approx(goal, abs=1e-3)


@pytest.mark.parametrize(("way", "turn"), [((-0.04, 0.0, 0.04), 0.0), ((0.0, 0.0, 0.0), 2.0)])
def test_a_tool_that_is_far_from_its_goal_goes_there_no_faster_than_it_may(
    way: tuple[float, float, float], turn: float
) -> None:
    chain = desk_arm()
    joints: tuple[float, ...] = (0.0, -0.3, 0.6, -0.3, 0.0)
    solver = PoseSolver(chain, BOUNDS, tuning=Tuning(fastest=0.1, quickest=0.5))
    start = chain.at(joints)
    position = start.position + np.array(way)
    rotation = from_rotation_vector((turn, 0.0, 0.0)) @ start.rotation
    for _ in range(round(5.0 / TICK)):
        before = chain.at(joints)
        joints = solver.step(joints, position, rotation, TICK).joints
        after = chain.at(joints)
        assert np.linalg.norm(after.position - before.position) <= 0.1 * TICK * 1.05
        assert (
            np.linalg.norm(rotation_vector(after.rotation @ before.rotation.T)) <= (0.5 if turn else 9.0) * TICK * 1.05
        )
    assert after.position == pytest.approx(position, abs=1e-3)
    assert turn == 0.0 or joints[4] == pytest.approx(turn, abs=0.01)


def test_joints_that_are_left_tend_to_the_posture() -> None:
    posture = (0.0, 0.2, 0.2, 0.8, 0.4)
    solver = PoseSolver(ARM, BOUNDS, posture=posture, turns=False)
    start = (0.0, -0.4, 1.0, 0.6, 0.0)
    place = ARM.at(start).position
    way = run(solver, start, place, np.eye(3), seconds=6)
    assert ARM.at(way[-1]).position == pytest.approx(place, abs=1e-3)
    assert way[-1][4] == pytest.approx(0.4, abs=0.02)
    assert np.linalg.norm(np.subtract(way[-1], posture)) < np.linalg.norm(np.subtract(start, posture))


def test_a_joint_outside_of_its_range_may_only_come_back() -> None:
    outside = (0.0, 1.75, 0.3, 0.3, 0.0)
    solver = PoseSolver(ARM, BOUNDS)
    here = ARM.at(outside)
    beyond = ARM.at((0.0, 2.0, 0.3, 0.3, 0.0))
    assert solver.step(outside, beyond.position, beyond.rotation, TICK).joints[1] <= 1.75
    back = ARM.at((0.0, 1.5, 0.3, 0.3, 0.0))
    assert solver.step(outside, back.position, back.rotation, TICK).joints[1] < 1.75
    assert solver.step(outside, here.position, here.rotation, TICK).joints[1] == pytest.approx(1.75)


@pytest.mark.parametrize("share", [0.0, 0.3])
def test_a_share_of_the_rates_bounds_every_joint(share: float) -> None:
    start = (0.0, -0.2, 0.6, 0.8, 0.0)
    state = ARM.at(start)
    after = PoseSolver(ARM, BOUNDS).step(start, state.position + 0.2, np.eye(3), TICK, share=share).joints
    used = np.abs(np.subtract(after, start)) / TICK / np.array(BOUNDS.rates)
    assert used.max() == pytest.approx(share, abs=1e-6)


def test_a_solver_serves_a_slide_too() -> None:
    chain = Chain(LIFT, "tool")
    solver = PoseSolver(chain, JointBounds((-1.0, -3.0, 0.0), (1.0, 3.0, 0.5), (0.2, 1.0, 0.2)), turns=False)
    joints: tuple[float, ...] = (0.0, 0.3, 0.1)
    wanted = chain.at((0.2, 0.8, 0.3))
    for _ in range(750):
        joints = solver.step(joints, wanted.position, np.eye(3), TICK).joints
    assert chain.at(joints).position == pytest.approx(wanted.position, abs=1e-3)
    assert rotation_vector(chain.at(joints).rotation)[2] == pytest.approx(rotation_vector(wanted.rotation)[2], abs=0.01)


HAND = {"hand": Surface(np.array([(x, 0.0, 0.0) for x in (0.0, 0.04, 0.08, 0.12, 0.16)]), np.full(5, 0.025))}
TABLE = Obstacles(ARM, HAND, (plane("the table", (0.0, 0.0, 0.06), (0.0, 0.0, 1.0)),))


def lowest(joints: tuple[float, ...]) -> float:
    return min(gap.distance for gap in TABLE.gaps(ARM.at(joints), 9.0))


@pytest.mark.parametrize("first", [False, True])
def test_for_an_obstacle_the_rotation_is_given_up_before_the_position_unless_it_comes_first(first: bool) -> None:
    """The tool is wanted just above the table, pointing up: the hand behind it would be in the table."""
    start = (0.0, -0.3, 0.5, 0.2, 0.0)
    position, rotation = np.array((0.36, 0.0, 0.10)), from_rotation_vector((0.0, -0.2, 0.0))
    solver = PoseSolver(ARM, BOUNDS, keeps_off=(TABLE,), tuning=Tuning(turns_first=first))
    way = run(solver, start, position, rotation)
    end = ARM.at(way[-1])
    missing, askew = np.linalg.norm(end.position - position), np.linalg.norm(rotation_vector(rotation @ end.rotation.T))
    assert min(map(lowest, way)) > 0.004
    assert swings(way, 100) < 0.02
    assert (missing < 2e-3) == (not first)
    assert (askew < 0.02) == first
    near = solver.step(way[-1], position, rotation, TICK).near
    assert near == ("the table",)


@few
@given(reachable, directions, st.floats(0.05, 0.4), turns)
@example((0.5, -1.5, 1.4375, -0.87109375, 0.0), (0.2265625, 0.0, -0.78125), 0.3125, (1.75, -0.515625, 0.0))
def test_whatever_is_wanted_the_arm_stays_off_the_table(
    start: tuple[float, ...], direction: tuple[float, float, float], far: float, turn: tuple[float, float, float]
) -> None:
    assume(lowest(start) > 0.03)
    begun = ARM.at(start)
    position = begun.position + np.array(direction) / math.hypot(*direction) * far
    solver = PoseSolver(ARM, BOUNDS, keeps_off=(APART, TABLE))
    way = run(solver, start, position, from_rotation_vector(turn) @ begun.rotation)
    assert min(map(lowest, way[::5])) > 0.0
    assert swings(way, 100) < 0.05


@pytest.mark.parametrize(
    ("start", "way", "turn"),
    [
        ((-1.5, 1.1, -0.9, -0.6, -0.5), (-0.1, 0.1, -0.2), (-0.2, -0.2, 1.0)),
        ((-1.4, 0.9, -0.6, -1.4, 0.4), (-0.1, 0.0, -0.3), (-1.4, 0.7, 0.0)),
        ((0.8, 1.0, -0.8, -0.4, -0.2), (0.1, -0.2, -0.3), (1.3, 0.8, -0.3)),
    ],
)
def test_the_far_end_of_a_hand_does_not_come_down_about_the_end_that_is_near(
    start: tuple[float, ...], way: tuple[float, float, float], turn: tuple[float, float, float]
) -> None:
    begun = ARM.at(start)
    assert 0.02 < lowest(start) < 0.05
    solver = PoseSolver(ARM, BOUNDS, keeps_off=(TABLE,))
    position, rotation = begun.position + np.array(way), from_rotation_vector(turn) @ begun.rotation
    joints, before, least = start, None, math.inf
    for _ in range(200):
        solution = solver.step(joints, position, rotation, 0.005, before=before)
        joints, before = solution.joints, solution.rates
        least = min(least, lowest(joints))
    assert least > 0.007


PLATE = {
    "hand": Surface(np.array([(x, y, 0.0) for x in (0.0, 0.08, 0.16) for y in (-0.3, 0.0, 0.3)]), np.full(9, 0.005))
}
DESK = Obstacles(ARM, PLATE, (plane("the table", (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)),))


@pytest.mark.parametrize("seed", [20, 52, 73, 95, 107])
def test_a_wide_hand_that_moves_as_fast_as_the_joints_can_stays_off_the_table(seed: int) -> None:
    """Its corners are many times faster than what is slowed near the table: they have to be slowed from far away."""

    def nearest(joints: tuple[float, ...]) -> float:
        return min(gap.distance for gap in DESK.gaps(ARM.at(joints), 9.0))

    numbers = np.random.default_rng(seed)
    bounds = BOUNDS._replace(rates=tuple(2.0 * rate for rate in BOUNDS.rates))
    lower, upper = 0.9 * np.array(bounds.lower), 0.9 * np.array(bounds.upper)
    joints: tuple[float, ...] = tuple(numbers.uniform(lower, upper))
    while nearest(joints) < 0.03:
        joints = tuple(numbers.uniform(lower, upper))
    solver = PoseSolver(ARM, bounds, keeps_off=(DESK,))
    rates: tuple[float, ...] = (0.0,) * 5
    for number in range(240):
        if number % 60 == 0:
            here = ARM.at(joints)
            position = here.position + 0.2 * numbers.normal(size=3)
            rotation = from_rotation_vector(numbers.uniform(-2.0, 2.0, 3).tolist()) @ here.rotation
        solution = solver.step(joints, position, rotation, TICK, before=rates)
        joints, rates = solution.joints, solution.rates
        assert nearest(joints) > 0.004


@few
@given(reachable, directions, st.floats(0.0, 0.4), turns, st.tuples(*(st.floats(-1.0, 1.0) for _ in range(5))))
def test_a_step_that_was_prepared_is_the_same_step(
    start: tuple[float, ...],
    direction: tuple[float, float, float],
    far: float,
    turn: tuple[float, float, float],
    before: tuple[float, ...],
) -> None:
    solver = PoseSolver(ARM, BOUNDS, keeps_off=(APART, TABLE))
    begun = ARM.at(start)
    position = begun.position + np.array(direction) / math.hypot(*direction) * far
    rotation = from_rotation_vector(turn) @ begun.rotation
    wanted = solver.step(start, position, rotation, TICK, before=before)
    prepared = solver.prepare(start, before)
    assert solver.step(start, position, rotation, TICK, before=before, prepared=prepared) == wanted
    assert solver.step(start, position, rotation, TICK, before=before, prepared=prepared) == wanted, "used twice"
    # What was prepared for other joints or rates is left.
    for other in (solver.prepare(start), solver.prepare(clipped(np.array(start) + 0.1), before)):
        assert solver.step(start, position, rotation, TICK, before=before, prepared=other) == wanted
