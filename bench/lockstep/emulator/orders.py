"""Commands to a running network, one line each, from a person or another process."""

import asyncio
import json
import math
import os
import sys
from collections.abc import Callable
from typing import Protocol

from lockstep.emulator.network_statistics import NetworkStatistics

__all__ = ["Impaired", "carry_out", "obey"]

KNOWN = 'the orders are "outage SECONDS", "hold SECONDS", either after "robot", "cut", "statistics"'
READ = 4096  # bytes; a line is shorter


class Impaired(Protocol):
    """A running network."""

    def outage(self, seconds: float, *, hold: bool = False, robot: bool = False) -> None: ...

    def cut_robot(self) -> None: ...

    def statistics(self) -> NetworkStatistics: ...


def carry_out(order: str, network: Impaired) -> str:
    """Carry out an order, and return the answer; "" without an answer."""
    match order.split():
        case []:
            return ""
        case ["statistics"]:
            return json.dumps(network.statistics().fields())
        case ["cut"]:
            network.cut_robot()
            return ""
        case [*where, ("outage" | "hold") as what, amount] if where in ([], ["robot"]) and (
            seconds := _seconds(amount)
        ):
            network.outage(seconds, hold=what == "hold", robot=bool(where))
            return ""
        case _:
            return json.dumps({"error": KNOWN})


def _seconds(text: str) -> float | None:
    try:
        seconds = float(text)
    except ValueError:
        return None
    return seconds if seconds > 0 and math.isfinite(seconds) else None


async def obey(network: Impaired, answer: Callable[[str], None]) -> None:
    """Obey orders until standard input ends."""
    loop, source, ended = asyncio.get_running_loop(), sys.stdin.fileno(), asyncio.Event()
    pending = b""

    def read() -> None:
        # Read only when data is there, not in non-blocking mode: that would stay with the terminal.
        nonlocal pending
        data = os.read(source, READ)
        *lines, pending = (pending + data).split(b"\n")
        for line in lines:
            if said := carry_out(line.decode(errors="replace"), network):
                answer(said)
                sys.stdout.flush()
        if not data or len(pending) > READ:
            loop.remove_reader(source)
            ended.set()

    try:
        loop.add_reader(source, read)
    except OSError:  # a file, which is never waited for
        return
    try:
        await ended.wait()
    finally:
        loop.remove_reader(source)
