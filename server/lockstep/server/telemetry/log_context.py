"""Adds to every log line which robot of a fleet, which run of the robot bridge and which event it belongs to."""

from collections.abc import MutableMapping
from contextvars import ContextVar
from typing import Any

from starlette.types import ASGIApp, Receive, Scope, Send

from lockstep.server.event_clock import EventClock

__all__ = ["LogContext", "add_session", "follow_clock", "name_robot"]

_clock: ContextVar[EventClock | None] = ContextVar("lockstep_event_clock", default=None)
_robot: ContextVar[str] = ContextVar("lockstep_robot", default="")


def follow_clock(clock: EventClock, robot: str = "") -> None:
    """Use `clock` from now on in this task, and in those that it starts. `robot`: its name in a fleet."""
    _clock.set(clock)
    _robot.set(robot)


def name_robot(robot: str) -> None:
    """Set the robot's name as `follow_clock` does, before there is a clock."""
    _robot.set(robot)


def add_session(logger: object, method: str, line: MutableMapping[str, Any]) -> MutableMapping[str, Any]:
    """Add `robot` in a fleet, `epoch`, and as `s` the current event reference; a structlog processor."""
    if robot := _robot.get():
        line.setdefault("robot", robot)
    clock = _clock.get()
    if clock is not None and clock.feedback is not None:
        line.setdefault("epoch", clock.epoch)
        line.setdefault("s", clock.event)
    return line


class LogContext:
    """A middleware that gives requests, and the peers that they begin, the clock made by the app's lifespan."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        found = getattr(scope["app"].state, "dependencies", None) if "app" in scope else None
        if found is not None:
            follow_clock(found.console.clock, found.robot)
        await self._app(scope, receive, send)
