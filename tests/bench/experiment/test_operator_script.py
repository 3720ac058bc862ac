from lockstep.bench.experiment.operator_script import INTERVALS, OperatorScript
from lockstep.robot_bridge.robots.planar.description import DESCRIPTION

TIMES = [number * 0.1 for number in range(600)]


def moves(seed: int) -> list[tuple[list[float], float, bool]]:
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
            assert axis.minimum <= value <= axis.maximum
        assert INTERVALS[0] <= interval <= INTERVALS[1]
    intervals = {interval for _, interval, _ in found}
    assert min(intervals) < 0.08
    assert max(intervals) > 0.3


def test_now_and_then_the_stick_is_let_go() -> None:
    pauses = [values for values, _, pause in moves(1) if pause]
    assert 0 < len(pauses) < len(TIMES) / 2
    assert {tuple(values) for values in pauses} == {(0.0, 0.0, 0.0)}
