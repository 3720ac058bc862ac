"""Whether the next test may use a console that others have used. Its robot drives home where it has to."""

import asyncio
from math import hypot, remainder, tau
from typing import Any

import httpx

from lockstep.client import Console, ConsoleError
from tests.client.held_up import act_on
from tests.support.stack import Stack

__all__ = ["as_new", "emptied"]

NEAR = 1.5  # m from where the robot starts; a test drives no further than the 2 m to the wall that are left
AHEAD = 0.3  # rad, and m to either side: else a zone that it keeps out of may be before it, and no wall
PATIENCE = 10.0  # s for pages that were closed to be gone, and for a new stop to be old enough for its reset
AGAIN = 0.1  # s
HOME_SECONDS = 20.0  # s; turned around it takes 4 s, and a new console takes 3 to 10 s of a processor


async def as_new(stack: Stack) -> bool:
    """`emptied`, and the planar robot is near where it starts; false when a new console is needed."""
    session = await emptied(stack)
    if session is not None and not _is_near(session):
        session = await emptied(stack) if await _goes_home(stack) else None
    return session is not None and _is_near(session)


def _is_near(session: dict[str, Any]) -> bool:
    x, y, heading = session["feedback"]["joints"]
    return bool(hypot(x, y) < NEAR and max(abs(y), abs(remainder(heading, tau))) < AHEAD)


async def _goes_home(stack: Stack) -> bool:
    """Whether it has driven home; something may be in the way."""
    try:
        async with (
            asyncio.timeout(HOME_SECONDS),
            Console(stack.operator, video=False, audio=False) as console,
        ):
            await console.take_seat()
            await act_on(console, "home")
    except (TimeoutError, ConsoleError):
        return False
    return True


async def emptied(stack: Stack) -> dict[str, Any] | None:
    """Release a stop and wait until everybody has left; what the console then says; None when a new one is needed."""
    if stack.process.returncode is not None:
        return None
    headers = {"Authorization": f"Bearer {stack.supervisor.partition('#token=')[2]}"}
    try:
        async with (
            asyncio.timeout(PATIENCE),
            httpx.AsyncClient(base_url=stack.console, headers=headers, trust_env=False) as http,
        ):
            while not _is_left(session := (await http.get("/api/session")).json()):
                if session["stop"]["stopped"]:
                    await http.post("/api/reset", json={"number": session["stop"]["number"]})
                await asyncio.sleep(AGAIN)
    except (TimeoutError, httpx.TransportError):
        return None
    found: dict[str, Any] = session
    return found


def _is_left(session: dict[str, Any]) -> bool:
    empty = session["participants"] == [] and session["seat"]["holder"] == ""
    rests = session["link"]["up"] and session["feedback"] is not None and session["feedback"]["at_rest"]
    return bool(empty and rests and not session["stop"]["stopped"])
