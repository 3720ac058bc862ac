"""A map and a click name joints and actions that are there, and that can be asked for by a hand."""

from typing import Any

import msgspec
import pytest

from lockstep.protocol.description import Action, ActionParameter, Camera, MapView, RobotDescription
from lockstep.robot_bridge.description.check_description import check_description
from lockstep.robot_bridge.errors import DescriptionError
from lockstep.robot_bridge.robots.planar.description import DESCRIPTION

replace = msgspec.structs.replace
MAP = DESCRIPTION.map or MapView(x="", y="", yaw="")


def number(name: str) -> ActionParameter:
    return ActionParameter(name=name, label=name, kind="number")


def robot(*names: str, map: MapView | None = None, camera: Camera | None = None, **changes: Any) -> RobotDescription:
    action = Action(name="go_to", label="Go to", parameters=tuple(number(each) for each in names))
    return replace(
        DESCRIPTION,
        actions=(replace(action, **changes),),
        map=map,
        cameras=DESCRIPTION.cameras if camera is None else (camera,),
    )


@pytest.mark.parametrize("names", [("x", "y"), ("x", "y", "yaw")])
def test_a_goal_with_and_without_a_heading_passes(names: tuple[str, ...]) -> None:
    check_description(robot(*names, map=MAP))
    check_description(robot(*names, map=replace(MAP, goal="")))


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        (robot("x", "y", map=replace(MAP, x="arm.x")), "joint 'arm.x'"),
        (robot("x", "y", map=replace(MAP, x="base.y")), "three joints"),
        (robot("x", "y", map=replace(MAP, radius=0.0)), "radius"),
        (robot("x", "y", map=replace(MAP, goal="fly")), "action 'fly'"),
        (robot("x", map=MAP), "numbers x and y"),
        (robot("x", "y", "z", map=MAP), "numbers x and y"),
        (robot("x", "y", map=MAP, confirm="Sure?"), "asks a question"),
        (
            robot(map=MAP, parameters=(number("x"), ActionParameter(name="y", label="y", kind="switch"))),
            "have to be numbers",
        ),
        (robot("x", "y", camera=replace(DESCRIPTION.cameras[0], click="go_to")), "x, y and event"),
        (robot("x", "y", camera=replace(DESCRIPTION.cameras[0], click="fly")), "action 'fly'"),
    ],
)
def test_what_could_not_be_shown_or_asked_for_is_refused(wrong: RobotDescription, says: str) -> None:
    with pytest.raises(DescriptionError, match=says):
        check_description(wrong)


def test_a_camera_may_be_clicked_on() -> None:
    check_description(robot("x", "y", "event", camera=replace(DESCRIPTION.cameras[0], click="go_to")))
