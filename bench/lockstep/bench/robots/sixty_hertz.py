"""The planar robot with a main camera of 60 pictures a second: `lockstep.bench.robots.sixty_hertz:SixtyHertzRobot`."""

from collections.abc import Sequence

import msgspec

from lockstep.protocol.description import RobotDescription
from lockstep.robot_bridge.robots.base import MediaSource
from lockstep.robot_bridge.robots.camera_source import CameraSource
from lockstep.robot_bridge.robots.planar.description import OVERVIEW
from lockstep.robot_bridge.robots.planar.drawing import OverviewDrawing
from lockstep.robot_bridge.robots.planar.robot import PlanarRobot

__all__ = ["SIXTY_HERTZ_ROBOT", "SixtyHertzRobot"]

SIXTY_HERTZ_ROBOT = "lockstep.bench.robots.sixty_hertz:SixtyHertzRobot"  # as the bridge's command takes it
CAMERA = msgspec.structs.replace(OVERVIEW, frame_rate=60.0)


class SixtyHertzRobot(PlanarRobot):
    def describe(self) -> RobotDescription:
        described = super().describe()
        others = [each for each in described.cameras if each.name != CAMERA.name]
        return msgspec.structs.replace(described, cameras=[CAMERA, *others])

    def sources(self) -> Sequence[MediaSource]:
        main, *others = super().sources()
        fast = CameraSource(CAMERA, OverviewDrawing(CAMERA.width, CAMERA.height).draw, lambda: self.state)
        return [fast, *others]
