"""The actions of a ROS 2 robot, by their names: services, actions, grippers, and the goal on the map."""

import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

from lockstep.protocol.actions import ParameterValue
from lockstep.robot_bridge.control import clock
from lockstep.robot_bridge.errors import RobotUnavailable
from lockstep.robot_bridge.robots.actions import ActionNotPossible, ActionRun
from lockstep.robot_bridge.robots.navigation import PlanarPose
from lockstep.robot_bridge.robots.ros2.actions.goal_fields import BadField, put_pose, set_field
from lockstep.robot_bridge.robots.ros2.actions.goal_readings import FieldReading, GripperReading
from lockstep.robot_bridge.robots.ros2.actions.goals import GoalClient, GoalRun, Reading
from lockstep.robot_bridge.robots.ros2.actions.services import Services
from lockstep.robot_bridge.robots.ros2.description import GOAL_ACTION
from lockstep.robot_bridge.robots.ros2.ros_side import RosSide
from lockstep.robot_bridge.robots.ros2.settings import ActionField, Gripper, MapTopics, Ros2Settings, RosAction

__all__ = ["GRIPPER_TYPE", "RosActions", "parameter_name"]

GRIPPER_TYPE = "control_msgs/GripperCommand"
SETTLE_SECONDS = 0.5  # for cancelled goals to end when the bridge ends
UNANSWERED_SECONDS = 2.0  # for a server to accept a cancelled goal then, after which it is cancelled
SETTLE_STEP = 0.01  # s
SOME_POSE = (0.0, 0.0, 0.0)

Parameters = Mapping[str, ParameterValue]
Begin = Callable[[Parameters], ActionRun]


class RosActions:
    """Begins actions. Call `tick` in every tick, and `settle` before the node ends.

    Attributes:
        moving: full names of the action servers whose goals move the robot
    """

    def __init__(self, ros: RosSide, settings: Ros2Settings) -> None:
        """Make all clients.

        Raises:
            RobotUnavailable: a service or an action is not installed, or has not the fields that the settings name.
        """
        self._ros = ros
        self._goals: list[GoalClient] = []
        self._begin: dict[str, Begin] = {}
        self.moving: list[str] = []
        self._going: tuple[GoalRun, PlanarPose] | None = None  # the goal on the map that runs
        services = Services(ros, settings.services)
        for service in settings.services:
            self._begin[service.name] = partial(services.begin, service.name)
        for action in settings.actions:
            self._begin[action.name] = self._plain(action)
        for gripper in settings.grippers:
            self._begin[gripper.name] = self._gripper(gripper)
        if settings.map is not None and settings.map.goal is not None:
            self._begin[GOAL_ACTION] = self._navigation(settings.map)

    def begin(self, name: str, parameters: Parameters) -> ActionRun:
        """Begin an action.

        Raises:
            ActionNotPossible: nobody offers it now.
        """
        return self._begin[name](parameters)

    def tick(self) -> None:
        now = clock.now()
        for goals in self._goals:
            goals.tick(now)

    def faults(self, now: float) -> list[str]:
        return [fault for goals in self._goals for fault in goals.faults(now)]

    def goal(self) -> PlanarPose | None:
        """Return the pose on the map that the robot is on its way to; None: it is on none."""
        if self._going is None or self._going[0].over:
            return None
        return self._going[1]

    def settle(self) -> None:
        """Wait shortly until cancelled goals have ended: later nobody cancels them. Blocks; the node still runs."""
        began = time.monotonic()
        deadline = began + SETTLE_SECONDS
        while any(goals.has_ending for goals in self._goals) and time.monotonic() < deadline:
            if any(goals.has_unanswered for goals in self._goals):
                # A goal that is accepted on the last instant still needs its time to end.
                deadline = min(time.monotonic(), began + UNANSWERED_SECONDS) + SETTLE_SECONDS
            self.tick()
            time.sleep(SETTLE_STEP)

    def _client(self, type: str, action: str, timeout: float, *, moves: bool) -> GoalClient:
        client = GoalClient(self._ros, type, action, timeout)
        self._goals.append(client)
        if moves:
            self.moving.append(client.full_name)
        return client

    def _plain(self, action: RosAction) -> Begin:
        client = self._client(action.type, action.action, action.timeout, moves=action.moves)
        template = client.kind.Goal()
        for path, value in action.goal.items():
            _check(action.name, template, path, value)
        for parameter in action.parameters:
            _check(action.name, template, parameter.field, _some_value(parameter))

        def begin(parameters: Parameters) -> ActionRun:
            goal = client.kind.Goal()
            fields = [(path, value) for path, value in action.goal.items()]
            fields += [(each.field, parameters[parameter_name(each)]) for each in action.parameters]
            return client.begin(_filled(goal, fields), _reading_of(action))

        return begin

    def _gripper(self, gripper: Gripper) -> Begin:
        client = self._client(GRIPPER_TYPE, gripper.action, gripper.timeout, moves=True)

        def begin(parameters: Parameters) -> ActionRun:
            share = parameters["opening"]
            assert isinstance(share, float | int)  # the bridge has checked it
            position = gripper.closed + float(share) / 100 * (gripper.open - gripper.closed)
            fields = [("command.position", position), ("command.max_effort", gripper.effort)]
            return client.begin(_filled(client.kind.Goal(), fields), GripperReading(gripper.unit))

        return begin

    def _navigation(self, topics: MapTopics) -> Begin:
        settings = topics.goal
        assert settings is not None
        client = self._client(settings.type, settings.action, settings.timeout, moves=True)
        put_pose(client.kind.Goal(), settings.pose, *SOME_POSE, topics.frame, self._ros.now_message())

        def begin(parameters: Parameters) -> ActionRun:
            x, y, yaw = (float(parameters[name]) for name in ("x", "y", "yaw"))
            goal = client.kind.Goal()
            put_pose(goal, settings.pose, x, y, yaw, topics.frame, self._ros.now_message())
            run = client.begin(goal, FieldReading(left=settings.left, result=settings.result, unit="m"))
            self._going = (run, (x, y, yaw))
            return run

        return begin


def parameter_name(parameter: ActionField) -> str:
    """Return the name that a parameter has as the robot's."""
    return parameter.name or parameter.field


def _reading_of(action: RosAction) -> Reading:
    return FieldReading(left=action.left, progress=action.progress, text=action.text, result=action.result)


def _filled(goal: Any, fields: Sequence[tuple[str, ParameterValue]]) -> Any:
    """Return the goal with these fields.

    Raises:
        ActionNotPossible: a field does not take its value.
    """
    try:
        for path, value in fields:
            set_field(goal, path, value)
    except BadField as error:
        raise ActionNotPossible(error.detail) from error
    return goal


def _check(name: str, template: Any, path: str, value: ParameterValue) -> None:
    try:
        set_field(template, path, value)
    except BadField as error:
        raise RobotUnavailable(f"action {name}: {error.detail}") from error


def _some_value(parameter: ActionField) -> ParameterValue:
    if parameter.default is not None:
        return parameter.default
    if parameter.kind == "number":
        return parameter.minimum or 0.0
    return parameter.choices[0] if parameter.kind == "choice" else True
