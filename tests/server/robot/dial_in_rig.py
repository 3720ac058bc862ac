"""A console with TLS that waits for a robot, and real bridges that dial it, in one process."""

import datetime
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

from lockstep.protocol.dial_in import PairingCode
from lockstep.robot_bridge.bridge import Bridge
from lockstep.robot_bridge.dial.console_access import ConsoleAccess
from lockstep.robot_bridge.dial.console_address import ConsoleAddress
from lockstep.robot_bridge.dial.console_key import ConsoleKey
from lockstep.robot_bridge.dial.pairing import pair
from lockstep.robot_bridge.settings import BridgeSettings
from lockstep.server.http.transport.tls import Certificate, self_signed
from lockstep.server.robot.dial_in import DialIn
from tests.robot_bridge.bridge_helpers import RecordingRobot
from tests.server.rig import Rig, eventually, running_console

__all__ = [
    "address_of",
    "code_for",
    "dial_in_of",
    "dialling_bridge",
    "made_certificate",
    "paired_key",
    "waiting_console",
]


def made_certificate(directory: Path) -> Certificate:
    return self_signed(directory, {"127.0.0.1", "localhost"}, datetime.datetime.now(datetime.UTC))


@asynccontextmanager
async def waiting_console(directory: Path, **settings: Any) -> AsyncIterator[Rig]:
    """A console whose certificate only those trust that were told to."""
    certificate = made_certificate(directory)
    async with running_console(
        0, certificate=certificate, robot="dial-in", tls_cert=certificate.chain, tls_key=certificate.key, **settings
    ) as rig:
        yield rig


def dial_in_of(rig: Rig) -> DialIn:
    found = rig.dependencies.dial_in
    assert found is not None
    return found


def address_of(rig: Rig, port: int | None = None) -> ConsoleAddress:
    """`port`: of a path that leads there."""
    url = rig.url if port is None else f"{rig.url.rpartition(':')[0]}:{port}"
    return ConsoleAddress.parse(url)


async def code_for(rig: Rig) -> PairingCode:
    answer = await rig.http.post("/api/dial-in/code", headers=rig.token("supervisor"))
    assert answer.status_code == 201, answer.text
    return PairingCode.parse(answer.json()["code"])


async def paired_key(rig: Rig, port: int | None = None) -> ConsoleKey:
    return await pair(address_of(rig, port), await code_for(rig), "planar", None)


@asynccontextmanager
async def dialling_bridge(
    address: ConsoleAddress, key: ConsoleKey, robot: RecordingRobot | None = None, **settings: Any
) -> AsyncIterator[Bridge]:
    access = ConsoleAccess(address, key)
    wanted = BridgeSettings(**({"listen": False, "port": 0} | settings), console=access)
    async with Bridge(robot or RecordingRobot(), wanted) as bridge:
        yield bridge


async def until_up(rig: Rig, *, up: bool = True) -> None:
    await eventually(lambda: rig.dependencies.console.robot.up is up)
