"""Which entry of a leader's action drives which axis."""

import pytest

from lockstep.client.lead.mapping import BadMapping, map_axes
from lockstep.protocol.description import Axis, RobotDescription


def goal(name: str) -> Axis:
    return Axis(name=name, label=name, unit="deg", minimum=-90, maximum=90, slew=60, brake=240, kind="goal", reach=30)


WHEEL = Axis(name="x.vel", label="x", unit="m/s", minimum=-1, maximum=1, slew=1, brake=1)
ROBOT = RobotDescription(name="arm", label="Arm", axes=(WHEEL, goal("pan.pos"), goal("lift.pos")))


def test_entries_and_goal_axes_of_the_same_name_belong_together() -> None:
    mapping = map_axes(ROBOT, ["lift.pos", "pan.pos", "wrist.pos", "x.vel"], [])
    assert mapping == (["lift.pos", "pan.pos"], {"lift.pos": 1.0, "pan.pos": 1.0})


def test_a_pair_may_be_given_with_a_scale() -> None:
    mapping = map_axes(ROBOT, ["a", "pan.pos"], ["a=lift.pos*-0.5"])
    assert mapping.scales == {"pan.pos": 1.0, "lift.pos": -0.5}
    assert mapping.names == ["pan.pos", "a"]


@pytest.mark.parametrize("given", ["b=pan.pos", "a=wrist.pos", "a=x.vel", "a=pan.pos*x", "a=lift.pos", "a"])
def test_what_is_not_there_or_driven_twice_is_an_error(given: str) -> None:
    with pytest.raises(BadMapping):
        map_axes(ROBOT, ["a", "lift.pos"], [given])


def test_nothing_to_drive_is_an_error() -> None:
    with pytest.raises(BadMapping, match="--map"):
        map_axes(ROBOT, ["a"], [])
