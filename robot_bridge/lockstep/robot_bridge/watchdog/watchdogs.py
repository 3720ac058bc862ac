"""Checks that the ticks go on: in the loop itself, and in a thread and a process beside it if the robot allows."""

import asyncio
import math
from typing import NamedTuple, Protocol

from lockstep.robot_bridge.control import clock
from lockstep.robot_bridge.robots.base import Robot
from lockstep.robot_bridge.watchdog.stall import StallGauge
from lockstep.robot_bridge.watchdog.watchdog_process import WatchdogProcess
from lockstep.robot_bridge.watchdog.watchdog_thread import WatchdogThread

__all__ = ["Held", "Watchdogs"]


class Watchdog(Protocol):
    def start(self) -> None: ...
    def ticked(self, now: float, moving: bool) -> None: ...
    def take_acted(self) -> bool: ...
    def close(self) -> None: ...


class Held(NamedTuple):
    """A gap in which the ticks were held up."""

    seconds: float  # since the last tick; at least the limit
    acted: bool  # the robot was brought to rest beside the loop


class Watchdogs:
    """All watchdogs of a robot.

    Call `start`; at every tick `begin`, then `ticked` before anything is applied; `close` when the robot rests.
    """

    def __init__(self, robot: Robot, limit: float, now: clock.Clock) -> None:
        self._limit = limit
        self._now = now
        self._gauge: StallGauge | None = None  # None before the first tick
        self._last = now()
        self._moved_at = -math.inf  # s, last tick whose values were not at rest
        self._beside: list[Watchdog] = []
        if robot.rests_from_thread:
            self._beside.append(WatchdogThread(limit, robot.rest_from_thread, now))
        if robot.rest_call:
            self._beside.append(WatchdogProcess(limit, robot.rest_call, robot.rest_arguments))

    async def start(self) -> None:
        """Start the watchdogs beside the loop.

        Raises:
            RobotUnavailable: the robot's own function cannot be called in a process.
        """
        for watchdog in self._beside:
            await asyncio.to_thread(watchdog.start)

    def begin(self, now: float, moving: bool) -> Held | None:
        """Return a gap if the ticks were held up; `moving`: the last applied values are not at rest."""
        acted = sum(watchdog.take_acted() for watchdog in self._beside) > 0  # take each watchdog's answer
        if self._gauge is None:
            self._gauge = StallGauge(self._limit, now)
        seconds, self._last = now - self._last, now
        gap = self._gauge.tick(now, moving)
        if acted:  # perhaps while the tick before this one began: its wait counts
            return Held(max(seconds, self._limit), acted)
        return None if gap is None else Held(seconds, acted)

    def ticked(self, now: float, moving: bool) -> None:
        """Note that the tick goes on; `moving`: its values are not at rest.

        A robot counts as one that moves until rest has been applied for `limit` seconds: the call that applies it may
        hang, and its message may still be on its way when the bridge is killed.

        Raises:
            RobotUnavailable: the watchdog process is gone, so nothing watches over the robot.
        """
        if moving:
            self._moved_at = now
        moves = now - self._moved_at <= self._limit
        for watchdog in self._beside:
            watchdog.ticked(now, moves)

    def close(self) -> None:
        """End the watchdogs. May be called again."""
        for watchdog in self._beside:
            watchdog.close()
