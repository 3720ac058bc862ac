import msgspec

from lockstep.bench.experiment.operator_script import INTERVALS, OperatorScript
from lockstep.protocol.description import Axis
from lockstep.robot_bridge.robots.planar.description import DESCRIPTION

TIMES = [number * 0.1 for number in range(600)]


def moves(seed: int) -> list[tuple[list[float | None], float, bool]]:
    script = OperatorScript(DESCRIPTION.axes, seed)
    return [tuple(script.at(time)) for time in TIMES]  # type: ignore[misc]


def test_the_same_seed_moves_the_same_way() -> None:
    assert moves(3) == moves(3)
    assert moves(3) != moves(4)


def test_how_often_it_is_asked_changes_nothing() -> None:
    often, seldom = OperatorScript(DESCRIPTION.axes, 7), OperatorScript(DESCRIPTION.axes, 7)
    for number in range(1000):
        move = often.at(number * 0.02)
    assert seldom.at(999 * 0.02) == move


def test_values_stay_within_the_axes_and_rates_vary_between_2_and_25_a_second() -> None:
    found = moves(1)
    for values, interval, _ in found:
        for value, axis in zip(values, DESCRIPTION.axes, strict=True):
            assert value is not None
            assert axis.minimum <= value <= axis.maximum
        assert INTERVALS[0] <= interval <= INTERVALS[1]
    intervals = {interval for _, interval, _ in found}
    assert min(intervals) < 0.08
    assert max(intervals) > 0.3


def test_now_and_then_the_stick_is_let_go() -> None:
    pauses = [values for values, _, pause in moves(1) if pause]
    assert 0 < len(pauses) < len(TIMES) / 2
    assert {tuple(values) for values in pauses} == {(0.0, 0.0, 0.0)}


JOINT = Axis(name="j1", label="J1", unit="rad", minimum=-1.0, maximum=1.0, slew=1.0, brake=4.0, kind="goal", reach=0.5)


def test_a_goal_axis_moves_within_reach_of_any_place_where_it_can_be_then() -> None:
    script = OperatorScript([*DESCRIPTION.axes, JOINT], 5)
    found = [script.at(time, [None, None, None, 0.25]).values[3] for time in TIMES]
    driven = [value for value in found if value is not None]
    assert len(driven) > len(TIMES) / 2
    assert len(driven) < len(TIMES)  # pauses
    assert max(driven) - min(driven) < JOINT.reach
    assert all(abs(value - 0.25) <= 0.3 * JOINT.reach for value in driven)


def test_a_goal_axis_stays_within_its_range_and_one_that_turns_on_and_on_needs_none() -> None:
    for axis, beyond in ((JOINT, False), (msgspec.structs.replace(JOINT, wrap=2.0), True)):
        script = OperatorScript([axis], 5)
        found = [script.at(time, [0.95]).values[0] for time in TIMES]
        assert (max(value for value in found if value is not None) > 1.0) == beyond


def test_a_goal_axis_stays_until_its_place_is_known_and_begins_anew_far_away() -> None:
    script = OperatorScript([JOINT], 5)
    assert script.at(0.0).values == [None]
    near = [value for time in TIMES[:300] if (value := script.at(time, [-0.5]).values[0]) is not None]
    far = [value for time in TIMES[300:] if (value := script.at(time, [0.5]).values[0]) is not None]
    assert all(abs(value + 0.5) < 0.25 for value in near)
    assert all(abs(value - 0.5) < 0.25 for value in far)
