"""The order of what one turn of the ticks does, on uvloop, as the bridge runs."""

import asyncio
import socket
from types import SimpleNamespace
from typing import Any, cast

import uvloop

from lockstep.robot_bridge.control import clock
from lockstep.robot_bridge.control.tick_loop import TickLoop

FEEDBACK = b"feedback"


def test_a_feedback_has_left_the_process_when_the_robot_computes_ahead() -> None:
    """uvloop hands data to the kernel at the end of a turn of its loop, behind what a robot computes in that turn."""
    assert uvloop.run(_received_in_prepare()) == [FEEDBACK] * 3


async def _received_in_prepare() -> list[bytes]:
    ours, theirs = socket.socketpair()
    theirs.settimeout(5.0)
    transport, _ = await asyncio.get_running_loop().create_unix_connection(asyncio.Protocol, sock=ours)
    received: list[bytes] = []
    enough = asyncio.Event()

    def prepare() -> None:
        if not enough.is_set():
            received.append(theirs.recv(len(FEEDBACK)))  # blocks, as a computation does
        if len(received) == 3:
            enough.set()

    def nothing(*_: object) -> None:
        return None

    ticks = TickLoop(
        cast(Any, SimpleNamespace(tick_seconds=0.004, ticks_on_command=False, prepare=prepare)),
        0.3,
        cast(Any, SimpleNamespace(at_rest=True)),
        cast(Any, SimpleNamespace(tick=lambda _now: object(), status=nothing)),
        *cast(Any, (SimpleNamespace(), SimpleNamespace())),
        cast(Any, SimpleNamespace(ticked=nothing)),
        cast(Any, SimpleNamespace(publish_feedback=lambda _feedback: transport.write(FEEDBACK))),
        *cast(Any, (SimpleNamespace(), SimpleNamespace())),
        clock.now,
    )
    running = asyncio.create_task(ticks.tick_on())
    await enough.wait()
    running.cancel()
    await asyncio.wait([running])
    transport.close()
    theirs.close()
    return received
