"""What goes out to a command topic, and when."""

import pytest

from lockstep.robot_bridge.robots.ros2.drives.command_stream import CommandStream, Said

TICK = 0.01
REST = [0.0, 0.0]
GO = [0.4, 0.1]


class Ticks:
    """A stream, and what it said tick by tick."""

    def __init__(self, rate: float = 25.0) -> None:
        self.stream = CommandStream(rate, REST, TICK)
        self.now = 100.0

    def run(self, ticks: int, values: list[float], lost: bool = False) -> list[Said]:
        said = []
        for _ in range(ticks):
            said.append(self.stream.step(values, lost, self.now).said)
            self.now += TICK
        return said


def test_at_rest_nothing_is_said() -> None:
    assert set(Ticks().run(100, REST)) == {Said.NOTHING}


def test_motion_begins_at_once_and_is_repeated_at_the_rate() -> None:
    said = Ticks(rate=25.0).run(100, GO)
    assert said[0] is Said.VALUES
    assert [number for number, each in enumerate(said) if each is Said.VALUES] == list(range(0, 100, 4))


def test_the_end_of_a_motion_is_one_zero_and_then_silence() -> None:
    ticks = Ticks()
    ticks.run(7, GO)
    assert ticks.run(50, REST) == [Said.ZERO] + [Said.NOTHING] * 49


def test_each_motion_has_its_own_zero() -> None:
    ticks = Ticks()
    said = ticks.run(5, GO) + ticks.run(5, REST) + ticks.run(1, GO) + ticks.run(5, REST)
    assert said.count(Said.ZERO) == 2


def test_when_the_robot_is_lost_zero_is_said_at_once_and_only_once() -> None:
    ticks = Ticks()
    ticks.run(7, GO)
    assert ticks.run(50, GO, lost=True) == [Said.ZERO] + [Said.NOTHING] * 49
    assert ticks.stream.withheld


def test_a_robot_that_came_back_is_driven_only_after_the_stick_was_let_go() -> None:
    ticks = Ticks()
    ticks.run(7, GO)
    ticks.run(7, GO, lost=True)
    assert set(ticks.run(50, GO)) == {Said.NOTHING}
    assert set(ticks.run(1, REST)) == {Said.NOTHING}
    assert ticks.run(1, GO) == [Said.VALUES]
    assert not ticks.stream.withheld


def test_what_is_withheld_is_also_not_counted_as_driven() -> None:
    stream = CommandStream(25.0, REST, TICK)
    assert stream.step(GO, True, 0.0).values == REST


@pytest.mark.parametrize("ticks_driven", [0, 1, 3])
def test_the_end_of_the_bridge_owes_a_zero_only_after_motion(ticks_driven: int) -> None:
    ticks = Ticks()
    ticks.run(ticks_driven, GO)
    assert ticks.stream.end() == (ticks_driven > 0)
    assert not ticks.stream.end()
