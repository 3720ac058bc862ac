"""The bridge behind LeRobot's teleoperator `lockstep` with `page`: `python -m …teleoperator_process`, asked on a pipe.

A console connects to this bridge as to any robot. LeRobot asks for the applied goals at its own rate. At the end of the
pipe, or of the process whose number is the argument, the bridge ends too.
"""

import asyncio
import logging
import os
import signal
import sys
from typing import Any, BinaryIO

import msgspec
from msgspec.structs import replace

from lockstep.protocol.description import RobotDescription
from lockstep.protocol.errors import SecretError
from lockstep.protocol.link_secret import LinkSecret
from lockstep.protocol.pipe.parent_process import parent_ended, parent_of
from lockstep.protocol.pipe.pipe_frames import BadFrame, read_request, to_frame
from lockstep.robot_bridge.bridge import Bridge
from lockstep.robot_bridge.errors import BridgeError
from lockstep.robot_bridge.robots.lerobot.description import describe
from lockstep.robot_bridge.robots.lerobot.device import AxisFacts, DeviceFacts
from lockstep.robot_bridge.robots.lerobot.settings import AxisSettings, LeRobotSettings
from lockstep.robot_bridge.robots.lerobot.virtual_arm import VirtualArm
from lockstep.robot_bridge.settings import BridgeSettings
from lockstep.robot_bridge.stop.state_directory import default_place
from lockstep.robot_bridge.yaml_file import SettingsPlace

__all__ = ["Open", "arm_of"]

SECRET_VARIABLE = "LOCKSTEP_LINK_SECRET"


class Open(msgspec.Struct, forbid_unknown_fields=True, tag_field="do", tag="open"):
    """Begin. The answer names the bridge's address."""

    axes: dict[str, AxisSettings]  # each with its unit, minimum, maximum, slew and reach
    start: dict[str, float] = {}  # where the arm is at first; others: 0, or the nearest place to it
    name: str = "lerobot-teleoperator"
    host: str = "127.0.0.1"
    port: int = 5600
    hold: float = 0.5


class Action(msgspec.Struct, forbid_unknown_fields=True, tag_field="do", tag="action"):
    """Return the applied goals."""


def arm_of(request: Open) -> VirtualArm:
    """Return the arm that is asked for.

    Raises:
        SettingsPlace: an axis lacks something.
        ValueError: a start is out of an axis' range.
    """
    facts = DeviceFacts("lockstep", "", tuple(map(AxisFacts, request.axes)), (), has_torque=False)
    settings = LeRobotSettings(name=request.name, label="LeRobot", axes=request.axes, hold=request.hold)
    description = replace(describe(settings, facts), joints=())  # it has no bodies that joints would move
    return VirtualArm(description, _places(description, request.start))


def _places(description: RobotDescription, start: dict[str, float]) -> list[float]:
    unknown = start.keys() - {axis.name for axis in description.axes}
    if unknown:
        raise ValueError(f"no axis {', '.join(sorted(unknown))}")
    places = []
    for axis in description.axes:
        place = start.get(axis.name, min(max(0.0, axis.minimum), axis.maximum))
        if not axis.minimum <= place <= axis.maximum:
            raise ValueError(
                f"{axis.name} cannot begin at {place:g}: it goes from {axis.minimum:g} to {axis.maximum:g}"
            )
        places.append(place)
    return places


async def serve(output: BinaryIO, parent: int) -> None:
    loop = asyncio.get_running_loop()
    loop.add_signal_handler(signal.SIGINT, lambda: None)  # the pipe's end is the end
    reader = asyncio.StreamReader()
    await loop.connect_read_pipe(lambda: asyncio.StreamReaderProtocol(reader), sys.stdin)

    def say(said: dict[str, Any]) -> None:
        output.writelines(to_frame(said))  # a few hundred bytes, which the pipe always has room for
        output.flush()

    said = await _first_request(reader, parent)
    if said is None:
        return
    try:
        request = msgspec.convert(said, Open)
        arm = arm_of(request)
        text = os.environ.get(SECRET_VARIABLE, "")
        settings = BridgeSettings(
            host=request.host,
            port=request.port,
            secret=LinkSecret(text) if text else None,
            state_dir=default_place(request.name),
        )
        async with Bridge(arm, settings) as bridge:
            say({"robot": f"tcp://{bridge.address[0]}:{bridge.address[1]}"})
            await _answer(reader, arm, bridge, say, parent)
    except SettingsPlace as place:
        say({"error": "SettingsError", "text": f"{'.'.join(map(str, place.keys))}: {place.detail}"})
    except (BridgeError, SecretError, OSError, ValueError, msgspec.ValidationError) as error:
        say({"error": type(error).__name__, "text": str(error)})


async def _first_request(reader: asyncio.StreamReader, parent: int) -> dict[str, Any] | None:
    """Return the first request; None if the pipe or the process `parent` ends before it."""
    try:
        async with asyncio.TaskGroup() as tasks:
            reading = tasks.create_task(read_request(reader), name="requests")
            ended = tasks.create_task(parent_ended(parent), name="parent")
            await asyncio.wait([reading, ended], return_when=asyncio.FIRST_COMPLETED)
            for task in (reading, ended):
                task.cancel()
    except BaseExceptionGroup as errors:  # of `read_request`
        raise errors.exceptions[0] from None
    return None if reading.cancelled() else reading.result()


async def _answer(reader: asyncio.StreamReader, arm: VirtualArm, bridge: Bridge, say: Any, parent: int) -> None:
    ended = asyncio.Event()

    failed: list[Exception] = []

    async def read() -> None:
        try:
            while (said := await read_request(reader)) is not None:
                msgspec.convert(said, Action)
                say({"values": arm.action})
        except Exception as error:  # the robot comes to rest first
            failed.append(error)
        ended.set()

    async def watch() -> None:  # processes that LeRobot has forked may keep the pipe open beyond its end
        await parent_ended(parent)
        ended.set()

    try:
        async with asyncio.TaskGroup() as tasks:
            running = [tasks.create_task(read(), name="requests"), tasks.create_task(watch(), name="parent")]
            await bridge.wait(ended)
            for task in running:
                task.cancel()
    except BaseExceptionGroup as errors:  # of the bridge
        raise errors.exceptions[0] from None
    for error in failed:
        raise error


def main() -> None:
    logging.basicConfig(level=logging.WARNING, format="lockstep: %(levelname)s %(name)s: %(message)s")
    output = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # a library that prints must not print into the frames
    try:
        asyncio.run(serve(output, parent_of(sys.argv[1:])))
    except BrokenPipeError:
        pass  # the other side has gone
    except BadFrame as error:
        sys.exit(f"lockstep: {error}")


if __name__ == "__main__":
    main()
