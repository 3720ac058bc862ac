"""A bridge of the planar robot that uses little of the machine.

`python -m lockstep.bench.fleet_soak.spare_planar PORT EVENT_LOG RATE`.

It sends RATE pictures a second of one camera, or none, and no sound. Eight robots that draw all pictures of both
cameras would leave two processors no time to measure anything else.
"""

import json
import sys
from collections.abc import Sequence
from pathlib import Path

import msgspec
import uvloop

from lockstep.protocol.description import RobotDescription
from lockstep.robot_bridge.bridge import Bridge
from lockstep.robot_bridge.robots.base import MediaSource
from lockstep.robot_bridge.robots.camera_source import CameraSource
from lockstep.robot_bridge.robots.planar.description import OVERVIEW
from lockstep.robot_bridge.robots.planar.drawing import OverviewDrawing
from lockstep.robot_bridge.robots.planar.robot import PlanarRobot
from lockstep.robot_bridge.settings import BridgeSettings

__all__ = ["SparePlanarRobot"]


class SparePlanarRobot(PlanarRobot):
    def __init__(self, picture_rate: float) -> None:
        """`picture_rate`: Hz; 0: no camera."""
        super().__init__()
        camera = msgspec.structs.replace(OVERVIEW, frame_rate=picture_rate)
        self._cameras = [camera] if picture_rate else []
        drawing = OverviewDrawing(camera.width, camera.height)
        self._spare = [CameraSource(each, drawing.draw, lambda: self.state) for each in self._cameras]

    def describe(self) -> RobotDescription:
        return msgspec.structs.replace(super().describe(), cameras=self._cameras, microphones=[])

    def sources(self) -> Sequence[MediaSource]:
        return self._spare


async def _run(port: int, event_log: Path, picture_rate: float) -> None:
    async with Bridge(SparePlanarRobot(picture_rate), BridgeSettings(port=port, event_log=event_log)) as bridge:
        host, own_port = bridge.address[:2]
        sys.stdout.write(json.dumps({"robot": f"tcp://{host}:{own_port}"}) + "\n")
        sys.stdout.flush()
        await bridge.wait()


if __name__ == "__main__":
    uvloop.run(_run(int(sys.argv[1]), Path(sys.argv[2]), float(sys.argv[3])))
