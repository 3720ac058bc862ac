"""Actions that a console cannot offer are named when the bridge starts."""

import math

import msgspec
import pytest

from lockstep.protocol.description import Action, ActionParameter
from lockstep.robot_bridge.description.check_description import check_description
from lockstep.robot_bridge.errors import DescriptionError
from lockstep.robot_bridge.robots.planar.description import DESCRIPTION

NUMBER = ActionParameter(name="height", label="Height", kind="number", unit="m", minimum=0.0, maximum=1.0, default=0.5)
CHOICE = ActionParameter(name="dock", label="Dock", kind="choice", choices=("left", "right"), default="left")
SWITCH = ActionParameter(name="on", label="On", kind="switch")


def check(*actions: Action) -> None:
    check_description(msgspec.structs.replace(DESCRIPTION, actions=actions, map=None))


def with_parameter(parameter: ActionParameter, **changes: object) -> Action:
    return Action(name="a", label="A", parameters=(msgspec.structs.replace(parameter, **changes),))


def test_sound_actions_pass() -> None:
    check()
    check(Action(name="a", label="A", parameters=(NUMBER, CHOICE, SWITCH), confirm="Is the way free?"))


@pytest.mark.parametrize(
    ("actions", "message"),
    [
        ([Action(name=f"a{number}", label="A") for number in range(33)], "33 actions"),
        ([Action(name="a", label="A"), Action(name="a", label="B")], "used twice"),
        ([Action(name="", label="A")], "empty"),
        ([Action(name="a", label="A\n")], "cannot be printed"),
        ([Action(name="a", label="A", confirm="x" * 201)], "201 characters"),
        ([Action(name="a", label="A", parameters=(SWITCH, SWITCH))], "used twice"),
        (
            [
                Action(
                    name="a",
                    label="A",
                    parameters=tuple(msgspec.structs.replace(SWITCH, name=f"{n}") for n in range(9)),
                )
            ],
            "at most 8",
        ),
        ([with_parameter(NUMBER, minimum=2.0)], "minimum"),
        ([with_parameter(NUMBER, maximum=math.inf)], "finite"),
        ([with_parameter(NUMBER, default=2.0)], "default"),
        ([with_parameter(NUMBER, default=True)], "default"),
        ([with_parameter(CHOICE, choices=())], "choices"),
        ([with_parameter(CHOICE, choices=("left", "left"))], "choices"),
        ([with_parameter(CHOICE, default="up")], "default"),
        ([with_parameter(CHOICE, choices=tuple(map(str, range(33))), default="1")], "33 choices"),
        ([with_parameter(SWITCH, choices=("on",))], "choices"),
        ([with_parameter(SWITCH, default="on")], "default"),
    ],
)
def test_a_contradiction_is_named(actions: list[Action], message: str) -> None:
    with pytest.raises(DescriptionError, match=message):
        check(*actions)
