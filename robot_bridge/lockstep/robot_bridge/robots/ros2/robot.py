"""A robot behind ROS 2 topics, as the bridge sees it."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Final

from lockstep.protocol.actions import ParameterValue, StatusItem
from lockstep.protocol.description import RobotDescription
from lockstep.robot_bridge.control import clock
from lockstep.robot_bridge.robots.actions import ActionRun
from lockstep.robot_bridge.robots.base import Measurement, MediaSource, Robot
from lockstep.robot_bridge.robots.go_to import GoTo
from lockstep.robot_bridge.robots.navigation import GridMap, NavigationNow
from lockstep.robot_bridge.robots.ros2.actions.ros_actions import RosActions
from lockstep.robot_bridge.robots.ros2.drives.arm_drive import ArmDrive
from lockstep.robot_bridge.robots.ros2.drives.base_drive import BaseDrive
from lockstep.robot_bridge.robots.ros2.drives.drive import Drive
from lockstep.robot_bridge.robots.ros2.drives.goal_arm_drive import GoalArmDrive
from lockstep.robot_bridge.robots.ros2.drives.servo_drive import ServoDrive
from lockstep.robot_bridge.robots.ros2.drives.watchdog_rest import REST_CALL, rest_arguments
from lockstep.robot_bridge.robots.ros2.joint_axes import is_goal_arm
from lockstep.robot_bridge.robots.ros2.mapping.frame_listener import FrameListener
from lockstep.robot_bridge.robots.ros2.mapping.map_topics import MapReader
from lockstep.robot_bridge.robots.ros2.ros_side import RosSide
from lockstep.robot_bridge.robots.ros2.saved_poses import pose_goals
from lockstep.robot_bridge.robots.ros2.sensing.battery import BatteryTopic
from lockstep.robot_bridge.robots.ros2.sensing.camera import CameraSource
from lockstep.robot_bridge.robots.ros2.sensing.camera_info import CameraInfoTopic
from lockstep.robot_bridge.robots.ros2.sensing.diagnostics import DiagnosticsTopic
from lockstep.robot_bridge.robots.ros2.sensing.reading import ReadingTopic
from lockstep.robot_bridge.robots.ros2.sensing.sensors import LockoutTopic, RangeSensor, WrenchTopic
from lockstep.robot_bridge.robots.ros2.settings import Arm, Ros2Settings

__all__ = ["Ros2Robot"]

NOT_THERE: Final = "the arm stays short of the pose: something is in its way, or nobody drives it"


class Ros2Robot(Robot):
    """Drives the parts of the robot, and gathers their measurements and those of the sensors."""

    tick_seconds = 0.01
    rests_from_thread = True

    def __init__(self, settings: Ros2Settings, description: RobotDescription) -> None:
        """Start the node.

        Raises:
            RobotUnavailable: ROS 2 is missing or does not start.
        """
        self._description = description
        self._poses = {} if settings.arm is None else pose_goals(settings.arm, description.axes)
        self._ros = RosSide(settings)
        try:
            tick = self.tick_seconds
            base = None if settings.base is None else BaseDrive(self._ros, settings.base, tick)
            arm = None if settings.arm is None else arm_drive(self._ros, settings.arm, description, tick)
            servo = None if settings.servo is None else ServoDrive(self._ros, settings.servo, tick)
            self._drives: list[Drive] = [drive for drive in (base, arm, servo) if drive is not None]
            frames = FrameListener(self._ros) if needs_frames(settings) else None
            self._map = None
            if settings.map is not None and base is not None:
                self._map = MapReader(self._ros, settings.map, base.pose, frames)
            self._actions = RosActions(self._ros, settings)
            self.rest_arguments = rest_arguments(
                settings,
                base=None if base is None else base.topic.full_name,
                arm=None if arm is None else arm.topic.full_name,
                servo=None if servo is None else servo.topic.full_name,
                actions=self._actions.moving,
            )
            if self.rest_arguments:
                self.rest_call = REST_CALL
            self._ranges = None if settings.ranges is None else RangeSensor(self._ros, settings.ranges, frames)
            self._wrench = None if settings.wrench is None else WrenchTopic(self._ros, settings.wrench)
            self._lockout = None if settings.lockout is None else LockoutTopic(self._ros, settings.lockout)
            self._batteries = [BatteryTopic(self._ros, battery) for battery in settings.batteries]
            diagnostics = settings.diagnostics
            self._diagnostics = None if diagnostics is None else DiagnosticsTopic(self._ros, diagnostics)
            self._readings = [ReadingTopic(self._ros, reading) for reading in settings.readings]
            self._cameras = [CameraSource(self._ros, camera) for camera in settings.cameras]
            self._infos = [
                CameraInfoTopic(self._ros, camera, camera.calibration, camera.info)
                for camera in settings.cameras
                if camera.calibration is not None and camera.info
            ]
            self._ros.start()
            if self._lockout is not None:
                self._lockout.wait()
        except BaseException:
            self._ros.close()
            raise

    def describe(self) -> RobotDescription:
        return self._description

    def pursue_poses(self, names: Sequence[str]) -> None:
        for drive in self._drives:
            if isinstance(drive, GoalArmDrive):
                drive.pursues = bool(names)

    def apply(self, values: Sequence[float]) -> None:
        start = 0
        for drive in self._drives:
            drive.step(values[start : start + drive.size], self.tick_seconds)
            start += drive.size

    def tick(self) -> None:
        if self._ros.failure is not None:
            raise self._ros.failure
        self._actions.tick()

    def prepare(self) -> None:
        for drive in self._drives:
            if isinstance(drive, GoalArmDrive):
                drive.prepare()

    def measure(self) -> Measurement:
        now = clock.now()
        sensed = [drive.sense(now) for drive in self._drives]
        faults = [fault for drive in self._drives for fault in drive.faults(now)]
        for sensor in (self._ranges, self._wrench, *self._cameras):
            if sensor is not None:
                faults += sensor.faults(now)
        faults += self._actions.faults(now)
        if self._map is not None:
            faults += self._map.faults(now)
        return Measurement(
            axes=[value for part in sensed for value in part.axes],
            joints=[value for part in sensed for value in part.joints],
            wrench=[] if self._wrench is None else self._wrench.values(now),
            ranges=[] if self._ranges is None else self._ranges.values(now),
            at_rest=all(part.at_rest for part in sensed),
            faults=faults,
        )

    def locked_out(self) -> str:
        return "" if self._lockout is None else self._lockout.reason(clock.now())

    def hardware_stop(self) -> bool | None:
        return None if self._lockout is None else self._lockout.pressed(clock.now())

    def begin_action(self, name: str, parameters: Mapping[str, ParameterValue]) -> ActionRun:
        if (goals := self._poses.get(name)) is not None:
            axes, tick = self._description.axes, self.tick_seconds
            return GoTo(goals, axes, self.measured_axes, tick, f"pose {name}", NOT_THERE)
        return self._actions.begin(name, parameters)

    def status(self) -> Sequence[StatusItem]:
        now = clock.now()
        items = [item for battery in self._batteries for item in battery.items(now)]
        items += [item for reading in self._readings for item in reading.items(now)]
        items += [item for info in self._infos for item in info.items()]
        return items + ([] if self._diagnostics is None else self._diagnostics.items(now))

    def grid_map(self) -> GridMap | None:
        return None if self._map is None else self._map.grid_map()

    def navigation(self) -> NavigationNow | None:
        return None if self._map is None else self._map.navigation(self._actions.goal())

    def positions(self) -> Sequence[float]:
        now = clock.now()
        return [value for drive in self._drives for value in drive.joints(now)]

    def measured_axes(self) -> Sequence[float]:
        now = clock.now()
        return [value for drive in self._drives for value in drive.measured_axes(now)]

    def goals(self) -> Sequence[float]:
        now = clock.now()
        return [value for drive in self._drives for value in drive.goals(now)]

    def take_up(self) -> Sequence[float]:
        now = clock.now()
        return [
            value
            for drive in self._drives
            for value in (drive.take_up(now) if isinstance(drive, GoalArmDrive) else [math.nan] * drive.size)
        ]

    def rest_from_thread(self) -> None:
        """rclpy publishes from any thread; a middleware that blocks all of them blocks this one too."""
        call_all([drive.rest_from_thread for drive in self._drives])

    def stop(self) -> None:
        """Publish zero to every part whose last message was another, and no motion until `reset`."""
        call_all([drive.stop for drive in self._drives])

    def reset(self) -> None:
        for drive in self._drives:
            drive.reset()

    def sources(self) -> Sequence[MediaSource]:
        return self._cameras

    def close(self) -> None:
        try:
            call_all([*(drive.end for drive in self._drives), self._actions.settle])
        finally:
            self._ros.close()


def arm_drive(ros: RosSide, arm: Arm, description: RobotDescription, tick_seconds: float) -> ArmDrive | GoalArmDrive:
    """Return the drive of an arm by goals or by velocities, as its settings say."""
    if is_goal_arm(arm):
        return GoalArmDrive(ros, arm, description, tick_seconds)
    return ArmDrive(ros, arm, tick_seconds)


def needs_frames(settings: Ros2Settings) -> bool:
    """Return whether something has to be looked up in TF."""
    place = None if settings.map is None else settings.map.place
    return (place is not None and place.source == "tf") or (settings.ranges is not None and settings.ranges.frame != "")


def call_all(calls: Sequence[Callable[[], None]]) -> None:
    """Make every call, even if one raises; then raise the first exception."""
    errors: list[Exception] = []
    for call in calls:
        try:
            call()
        except Exception as error:
            errors.append(error)
    if errors:
        raise errors[0]
