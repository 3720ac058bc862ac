import itertools
import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.client.control.clutch import REACH_SHARE, Clutch
from lockstep.protocol.description import Axis, Pose, RobotDescription
from lockstep.protocol.messages import Feedback, StopState
from tests.client.control.vectors import load_vectors
from tests.makers import goal_axis

VECTORS = load_vectors("clutch.json")
CASES: list[dict[str, Any]] = VECTORS["cases"]
EVENTS = itertools.count(10, 10)


def clutch_of(case: dict[str, Any]) -> Clutch:
    axes = tuple(
        goal_axis(str(i), most=1e4, reach=axis["reach"], wrap=axis["wrap"]) for i, axis in enumerate(case["axes"])
    )
    scales = {str(i): axis["scale"] for i, axis in enumerate(case["axes"])}
    poses = tuple(
        Pose(name=f"p{i}", label="", body="", position=(str(i), "", ""), settling=axis["settling"])
        for i, axis in enumerate(case["axes"])
        if "settling" in axis
    )
    return Clutch(RobotDescription(name="arm", label="Arm", axes=axes, poses=poses), scales)


def measured(axes: list[float], goals: list[float | None], **rest: Any) -> Feedback:
    time, event = rest.pop("time", 0.0), rest.pop("event", None) or next(EVENTS)
    return Feedback(event=event, issue=1, time=time, axes=axes, goals=goals, **rest)


def check_step(clutch: Clutch, step: dict[str, Any]) -> None:
    match step:
        case {"feedback": found}:
            clutch.observe(measured(**found))
        case {"engage": device}:
            assert clutch.engage(device) == step["engaged"]
        case {"move": device}:
            goals = clutch.goals(device)
            assert goals == [goal if goal is None else pytest.approx(goal, abs=1e-9) for goal in step["goals"]]
            assert clutch.clipped == tuple(map(str, step["clipped"]))
        case {"lost": "feedback"}:
            clutch.lost_feedback()
        case {"lost": "seat" | "arming"} | {"release": True}:
            clutch.release()
        case _:
            pytest.fail(f"the table has a step that this test does not know: {step}")
    assert clutch.engaged == step["engaged"]


@pytest.mark.parametrize("case", CASES, ids=[case["name"] for case in CASES])
def test_the_clutch_goes_through_the_shared_table(case: dict[str, Any]) -> None:
    clutch = clutch_of(case)
    for number, step in enumerate(case["steps"]):
        try:
            check_step(clutch, step)
        except AssertionError as error:
            error.add_note(f"step {number}")
            raise


def test_the_share_of_reach_is_that_of_the_shared_table() -> None:
    assert VECTORS["share"] == REACH_SHARE


ARM = RobotDescription(
    name="arm",
    label="Arm",
    axes=(
        Axis(name="base", label="Base", unit="m/s", minimum=-1, maximum=1, slew=1, brake=4),
        goal_axis("j1", most=1e4, reach=0.5),
        goal_axis("j2", most=1e4, reach=0.5),
    ),
)


def test_its_axes_are_found_by_name_and_its_values_are_what_drive_takes() -> None:
    clutch = Clutch(ARM, {"j2": -1.0, "j1": 1.0})
    clutch.observe(measured([0, 1, 2], [None, 1, 2]))
    assert clutch.engage([0, 0])
    assert clutch.values([0.25, 0.125]) == {"j2": 1.75, "j1": 1.125}


@pytest.mark.parametrize("scales", [{"j3": 1.0}, {"base": 1.0}, {"j1": math.nan}])
def test_it_is_made_of_goal_axes_and_finite_scales_only(scales: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="no goal axis|NaN"):
        Clutch(ARM, scales)


def test_another_number_of_readings_than_axes_is_the_callers_mistake() -> None:
    clutch = Clutch(ARM, {"j1": 1.0})
    with pytest.raises(ValueError, match="2 readings for 1 axes"):
        clutch.engage([0, 0])


@pytest.mark.parametrize(
    "found",
    [
        measured([0, 0, 0], [None, 0, 0], stop=StopState(stopped=True)),
        measured([0, 0, 0], [None, None, 0]),
        measured([0, 0, 0], []),
        measured([0, 0], [None, 0]),
    ],
    ids=["stopped", "without its goal", "without goals", "of another robot"],
)
def test_a_feedback_that_it_cannot_bind_to_counts_as_lost(found: Feedback) -> None:
    clutch = Clutch(ARM, {"j1": 1.0})
    clutch.observe(measured([0, 0, 0], [None, 0, 0]))
    assert clutch.engage([0])
    clutch.observe(found)
    assert clutch.goals([0]) == [None]
    assert not clutch.engage([0])


numbers = st.floats(-100, 100, allow_nan=False)
steps = st.lists(
    st.one_of(
        st.tuples(st.just("feedback"), numbers, numbers),
        st.tuples(st.just("engage"), numbers, numbers),
        st.tuples(st.just("move"), numbers, numbers),
        st.tuples(st.just("release"), numbers, numbers),
        st.tuples(st.just("lost"), numbers, numbers),
        st.tuples(st.just("unknown"), numbers, numbers),
    ),
    max_size=60,
)


@given(steps, st.sampled_from([1.0, -1.0, 0.25, 3.0]), st.sampled_from([None, 6.0]))
def test_the_first_goal_is_the_applied_goal_and_no_goal_is_beyond_both_its_share_of_reach_and_the_applied_goal(
    steps: list[tuple[str, float, float]], scale: float, wrap: float | None
) -> None:
    axis = goal_axis("j", most=1e4, reach=0.5, wrap=wrap)
    clutch = Clutch(RobotDescription(name="arm", label="Arm", axes=(axis,)), {"j": scale})
    applied, position, first = 0.0, 0.0, False
    for kind, one, other in steps:
        match kind:
            case "feedback":
                applied, position, first = one, one + other / 100, False
                clutch.observe(measured([position], [applied]))
            case "engage":
                first = clutch.engage([one])
                if first:
                    assert clutch.goals([one]) == [applied]  # exactly, whatever the device's position is
            case "move":
                (goal,) = clutch.goals([one])
                assert (goal is not None) == clutch.engaged
                if goal is not None:
                    away = goal - position if wrap is None else math.remainder(goal - position, wrap)
                    lead = applied - position if wrap is None else math.remainder(applied - position, wrap)
                    assert abs(away) <= max(REACH_SHARE * axis.reach, abs(lead)) + 1e-9
            case "release":
                clutch.release()
            case "lost":
                clutch.lost_feedback()
            case _:
                assert clutch.goals([math.nan]) == [None]
        assert clutch.engaged or clutch.goals([one]) == [None]


@given(st.lists(st.floats(-0.1, 0.1), max_size=50), st.lists(st.floats(-0.05, 0.05), min_size=50, max_size=50))
def test_goals_change_no_more_than_the_device_and_the_robot_have_moved(moves: list[float], drifts: list[float]) -> None:
    clutch = Clutch(ARM, {"j1": 2.0})
    device, position, before = 0.0, 0.0, 0.0
    clutch.observe(measured([0, 0, 0], [None, 0, 0]))
    clutch.engage([device])
    for move, drift in zip(moves, drifts, strict=False):
        device, position = device + move, position + drift
        clutch.observe(measured([0, position, 0], [None, position, 0]))
        (goal,) = clutch.goals([device])
        assert goal is not None
        assert abs(goal - before) <= abs(2 * move) + abs(drift) + 1e-9
        before = goal
