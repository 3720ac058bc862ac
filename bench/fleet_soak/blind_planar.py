"""A bridge of the planar robot without cameras: `python -m bench.fleet_soak.blind_planar PORT EVENT_LOG`.

Eight that draw pictures would leave two processors no time to measure anything else.
"""

import json
import sys
from collections.abc import Sequence
from pathlib import Path

import msgspec
import uvloop

from robot_bridge.bridge import Bridge
from robot_bridge.protocol.description import RobotDescription
from robot_bridge.robots.base import MediaSource
from robot_bridge.robots.planar.robot import PlanarRobot
from robot_bridge.settings import BridgeSettings

__all__ = ["BlindPlanarRobot"]


class BlindPlanarRobot(PlanarRobot):
    def describe(self) -> RobotDescription:
        return msgspec.structs.replace(super().describe(), cameras=[], microphones=[])

    def sources(self) -> Sequence[MediaSource]:
        return ()


async def _run(port: int, event_log: Path) -> None:
    async with Bridge(BlindPlanarRobot(), BridgeSettings(port=port, event_log=event_log)) as bridge:
        host, own_port = bridge.address[:2]
        sys.stdout.write(json.dumps({"robot": f"tcp://{host}:{own_port}"}) + "\n")
        sys.stdout.flush()
        await bridge.wait()


if __name__ == "__main__":
    uvloop.run(_run(int(sys.argv[1]), Path(sys.argv[2])))
