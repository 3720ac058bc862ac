"""Runs the ticks of a robot. However they end, the robot is brought to rest and stopped.

A tick ends each period of the robot's `tick_seconds`. If the robot allows it, a command, a rest or a stop begins the
tick of the present period at once. Each period has one tick in any case: a flood of commands makes no more of them, so
neither the ramps nor a simulated robot's time become faster. Two ticks are less than two periods apart, which is what
the limits reckon with.
"""

import asyncio
import contextlib
import logging
import time
from collections.abc import Iterator

from lockstep.robot_bridge.control.clock import Clock
from lockstep.robot_bridge.control.coming_to_rest import ComingToRest
from lockstep.robot_bridge.control.command_executor import CommandExecutor
from lockstep.robot_bridge.control.limits.axis_shaper import AxisShaper
from lockstep.robot_bridge.control.ticks.tick_alarm import TickAlarm
from lockstep.robot_bridge.control.ticks.ticker import Ticker
from lockstep.robot_bridge.control.ticks.work_ahead import WorkAhead
from lockstep.robot_bridge.counters import BridgeCounters
from lockstep.robot_bridge.errors import RobotFailed, RobotUnavailable, named
from lockstep.robot_bridge.link.sending.link_publisher import LinkPublisher
from lockstep.robot_bridge.robots.base import Robot
from lockstep.robot_bridge.stop.stop_handler import StopHandler
from lockstep.robot_bridge.watchdog.liveness import Liveness
from lockstep.robot_bridge.watchdog.watchdogs import Watchdogs

__all__ = ["TickLoop"]

GIVE_WAY = 0.002  # s from a feedback until work ahead, in which the program that reads it gets the processor
TIMER = 0.001  # s by which a timer may be late
REST_MARGIN = 0.5  # s on top of hold for the robot to come to rest when the bridge closes
MAX_CATCH_UP = 3  # ticks made good after the loop was blocked; the rest are skipped

_logger = logging.getLogger(__name__)


class TickLoop:
    """Owns the robot's motion while `run` runs, and at its end."""

    def __init__(
        self,
        robot: Robot,
        hold: float,
        shaper: AxisShaper,
        executor: CommandExecutor,
        ahead: WorkAhead,
        stops: StopHandler,
        watchdogs: Watchdogs,
        liveness: Liveness,
        publisher: LinkPublisher,
        alarm: TickAlarm,
        counters: BridgeCounters,
        now: Clock,
    ) -> None:
        """`alarm`: rings when a command, a rest or a stop was taken."""
        self._robot = robot
        self._hold = hold
        self._shaper = shaper
        self._executor = executor
        self._ahead = ahead
        self._stops = stops
        self._watchdogs = watchdogs
        self._liveness = liveness
        self._publisher = publisher
        self._alarm = alarm
        self._counters = counters
        self._now = now
        self._at_rest = asyncio.Event()  # nothing is driven

    async def run(self) -> None:
        """Run the ticks. However they end, this brings the robot to rest and stops it before it ends itself.

        Raises:
            RobotFailed: the adapter raised.
        """
        try:
            await self._tick_on()
        except GeneratorExit:  # the loop is gone: nothing can be awaited any more
            self.rest_at_exit()
            raise
        except asyncio.CancelledError:
            await self._leave()
            raise
        except BaseException as error:
            self._stops.fail(error)
            await self._leave()
            raise

    async def come_to_rest(self, running: asyncio.Task[None]) -> None:
        """Let the ticks go on until nothing is driven; give up if they have ended or take too long.

        `running`: the task that ends when the ticks have ended.
        """
        self._executor.end_actions()
        self._shaper.rest()
        running.add_done_callback(lambda _: self._at_rest.set())
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(self._hold + REST_MARGIN):
                while not (self._shaper.at_rest or running.done()):
                    self._at_rest.clear()
                    await self._at_rest.wait()

    def rest_at_exit(self) -> None:
        """Bring the robot to rest when the event loop is gone."""
        self._executor.end_actions()
        leaving = self._coming_to_rest()
        leaving.at_once()
        leaving.stop()

    def tick(self) -> bool:
        """Run one tick, and send a feedback if one is due. Return whether one was."""
        now = self._now()
        feedback = self._executor.tick(now)
        if self._shaper.at_rest:
            self._at_rest.set()
        if feedback is not None:
            self._publisher.publish_feedback(feedback)
        if (status := self._executor.status(now)) is not None:
            self._publisher.publish_to_operator(status)
        return feedback is not None

    async def _tick_on(self) -> None:
        metronome = Ticker(self._robot.tick_seconds, time.monotonic(), catch_up=MAX_CATCH_UP)
        while True:
            await self._wait(metronome)
            self._counters.skipped_ticks = metronome.skipped
            with _calls_of_the_robot():
                is_fed_back = self.tick()
                self._liveness.ticked()
            if not (is_fed_back and self._robot.ticks_on_command) or await self._gave_way(metronome):
                with _calls_of_the_robot():
                    self._ahead.do()
            else:
                self._ahead.leave_out()

    async def _gave_way(self, metronome: Ticker) -> bool:
        """Give way to whoever reads the feedback that was sent; return whether there is time for work ahead then."""
        seconds = min(GIVE_WAY, metronome.left(time.monotonic()) - self._ahead.seconds - TIMER)
        if seconds < TIMER:
            return False
        if await self._alarm.pause(seconds):
            return True
        return self._ahead.seconds < metronome.until_early(time.monotonic())

    async def _wait(self, metronome: Ticker) -> None:
        """Wait for the next tick."""
        now = time.monotonic()
        seconds = metronome.wait(now)
        if self._robot.ticks_on_command:
            await self._alarm.wait(seconds, at_least=metronome.early(now))
        else:
            await asyncio.sleep(seconds)

    async def _leave(self) -> None:
        self._executor.end_actions()
        leaving = self._coming_to_rest()
        try:
            while True:
                self._tell_watchdogs()
                done = leaving.step(self._now())
                self._liveness.ticked()
                if done:
                    break
                await asyncio.sleep(self._robot.tick_seconds)
        finally:  # also when this is cancelled once more
            if not leaving.rests:
                leaving.at_once()
            leaving.stop()
            self._tell_watchdogs()
            self._executor.note_motion()

    def _tell_watchdogs(self) -> None:
        """Tell the watchdogs of a tick on the way to rest, where a call may hang too."""
        try:
            self._watchdogs.ticked(self._now(), not self._shaper.at_rest)
        except RobotUnavailable as error:
            _logger.error("%s", error)

    def _coming_to_rest(self) -> ComingToRest:
        return ComingToRest(self._robot, self._shaper, self._hold, self._now())


@contextlib.contextmanager
def _calls_of_the_robot() -> Iterator[None]:
    """Turn whatever the adapter raises into `RobotFailed`. Await nothing within: a cancellation would count as one.

    Raises:
        RobotFailed: anything was raised.
    """
    try:
        yield
    except BaseException as error:
        raise RobotFailed(named(error)) from error
