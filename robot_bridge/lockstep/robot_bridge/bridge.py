"""Assembles the bridge and owns its tasks: link server, command executor, ticks, media sources, event log."""

import asyncio
import atexit
import logging
import secrets
from collections import Counter
from types import TracebackType
from typing import TYPE_CHECKING, Self

from lockstep.robot_bridge.actions.action_runner import ActionRunner
from lockstep.robot_bridge.control import clock
from lockstep.robot_bridge.control.command_executor import CommandExecutor
from lockstep.robot_bridge.control.event_core import EventCore
from lockstep.robot_bridge.control.feedback_issuer import FeedbackIssuer
from lockstep.robot_bridge.control.goals.measured_axes import MeasuredAxes
from lockstep.robot_bridge.control.limits.axis_shaper import AxisShaper
from lockstep.robot_bridge.control.limits.motion_limits import MotionLimits
from lockstep.robot_bridge.control.ticks.tick_alarm import TickAlarm
from lockstep.robot_bridge.control.ticks.tick_loop import TickLoop
from lockstep.robot_bridge.control.ticks.work_ahead import WorkAhead
from lockstep.robot_bridge.counters import BridgeCounters
from lockstep.robot_bridge.description.check_axes import check_braking
from lockstep.robot_bridge.description.check_description import check_description
from lockstep.robot_bridge.dial.console_access import ConsoleAccess
from lockstep.robot_bridge.encoding.media_encoding import MediaEncoding
from lockstep.robot_bridge.errors import RobotFailed, named
from lockstep.robot_bridge.event_log import EventLog
from lockstep.robot_bridge.link.check_link import check_link
from lockstep.robot_bridge.link.link_server import LinkServer
from lockstep.robot_bridge.link.refusals import Refusals
from lockstep.robot_bridge.maps.map_sender import MapSender
from lockstep.robot_bridge.media_sources import MediaSources
from lockstep.robot_bridge.robots.base import Robot
from lockstep.robot_bridge.settings import BridgeSettings
from lockstep.robot_bridge.stop.lockout_file import LockoutFile
from lockstep.robot_bridge.stop.stop_handler import StopHandler
from lockstep.robot_bridge.stop.stop_keeper import StopKeeper
from lockstep.robot_bridge.watchdog.liveness import Liveness
from lockstep.robot_bridge.watchdog.stall import watchdog_seconds
from lockstep.robot_bridge.watchdog.watchdogs import Watchdogs

if TYPE_CHECKING:
    from lockstep.robot_bridge.dial.dialer import Dialer

__all__ = ["Bridge"]

ADDRESSES_FILE = "addresses.txt"  # in the state directory

_logger = logging.getLogger(__name__)


class Bridge:
    """One run of a robot: one epoch. `start` returns when links may come; `close` leaves the robot at rest."""

    def __init__(
        self, robot: Robot, settings: BridgeSettings, now: clock.Clock = clock.now, *, liveness: Liveness | None = None
    ) -> None:
        """`now`: the clock that bounds motion; it counts suspended time.

        `liveness`: ends the process when the bridge hangs; the process must be the bridge's alone. None: nothing does.

        Raises:
            DescriptionError: the robot's description contradicts itself, or its ticks.
            InsecureLink: any client that reaches the address could drive, and the settings do not say that this is
            wanted.
            SecretError: the TLS files cannot be used.
        """
        check_link(settings)
        self.description = robot.describe()
        check_description(self.description)
        check_braking(self.description, robot.tick_seconds)
        self.epoch = secrets.token_hex(8)
        self.address = (settings.host, settings.port)
        self.counters = BridgeCounters()
        self._robot = robot
        self._settings = settings
        self._now = now
        description, counters = self.description, self.counters
        self._core = EventCore(
            description.axes,
            max_event_age=description.max_event_age,
            max_event_rate=description.max_event_rate,
            first_event=settings.first_event,
            start_warning=description.start_warning,
            poses=description.poses,
            measured=(measured := MeasuredAxes(robot, len(description.axes))),
        )
        self._log = EventLog(settings.event_log)
        self._keeper = StopKeeper(settings.state_dir, settings.older_state_dirs)
        self._lockout = None if settings.lockout_file is None else LockoutFile(settings.lockout_file)
        self._liveness = liveness or Liveness()
        longest_tick = robot.tick_seconds * (2 if robot.ticks_on_command else 1)  # s from one tick to the next
        self._watchdogs = Watchdogs(robot, watchdog_seconds(description, longest_tick), now)
        limits = MotionLimits(description, robot, robot.tick_seconds, longest_tick=longest_tick)
        shaper = self._shaper = AxisShaper(
            description.axes, hold=description.hold, limiter=limits, poses=description.poses, pursued=robot.goals
        )
        refusals, alarm = Refusals(counters, self._log), TickAlarm()
        self._stops = StopHandler(robot, self._core, shaper, self._keeper, self._lockout, refusals, self._log, now)
        self._feedback = FeedbackIssuer(robot, description, self._core, shaper, counters, self._log, now)
        actions = ActionRunner(robot, description, self._core, shaper, counters, self._log, now)
        encoding = None
        if settings.encode is not None:
            encoding = MediaEncoding(settings.encode, description, counters.left_out)
        executor = CommandExecutor(
            *(robot, description, self._core, shaper, limits, self._watchdogs, self._stops),
            feedback=self._feedback,
            actions=actions,
            measured=measured,
            refusals=refusals,
            alarm=alarm,
            counters=counters,
            log=self._log,
            now=now,
            own_status=tuple if encoding is None else encoding.status,
        )
        self._links = LinkServer(
            executor,
            description,
            self.epoch,
            counters,
            max_links=settings.max_links,
            max_strangers=settings.max_strangers,
            operator_grace=settings.operator_grace,
            addresses_file=None if settings.state_dir is None else settings.state_dir / ADDRESSES_FILE,
            secret=settings.secret,
            tls=None if settings.tls is None else settings.tls.bridge_context(),
            encoding=encoding,
        )
        self._dialer = None if settings.console is None else _dialer(settings.console, self._links)
        self._ticks = TickLoop(
            *(robot, description.hold, shaper, executor, WorkAhead(robot, measured), self._stops),
            *(self._watchdogs, self._liveness, self._links.publisher, alarm, counters),
            now,
        )
        self._sources = MediaSources(
            *(robot, self._core, self._feedback, self._links.publisher, counters, self._log),
            event_strip=settings.event_strip,
            encoding=encoding,
        )
        self._maps = MapSender(robot, description, self._core, self._links.publisher, now)
        self._running: asyncio.Task[None] | None = None
        self._closed = False

    @property
    def event(self) -> int:
        """The event reference."""
        return self._core.current

    @property
    def links(self) -> int:
        """The number of open connections."""
        return self._links.links

    @property
    def drops(self) -> Counter[str]:
        """The messages that slow links have missed, by message kind or stream."""
        return self._links.drops()

    async def start(self) -> None:
        """Start the bridge; returns when it listens, and dials its console if it has one.

        Raises:
            ListenError: the address cannot be had.
            RobotUnavailable: the robot's watchdog process cannot be had.
            StateDirInUse, StateDirUnusable: the stop cannot be kept in the directory of the settings.
            OSError: the event log cannot be opened.
            RobotFailed: the robot adapter raised at its first measurement; the next bridge begins stopped.
        """
        try:
            self._core.stops.latch = await self._keeper.open(self._now())
            self._log.open()
            if self._lockout is not None:
                await asyncio.to_thread(self._lockout.start)
            await self._watchdogs.start()
            if self._settings.listen:
                self.address = await self._links.listen(self._settings.host, self._settings.port)
            self._begin()
        except BaseException:
            await self.close()
            raise

    def _begin(self) -> None:
        self._stops.begin()
        stop = self._core.stops.state
        self._log.record("start", self._core.current, epoch=self.epoch, stopped=stop.stopped, number=stop.number)
        try:
            if self._shaper.has_goals:
                self._shaper.begin(self._robot.measured_axes(), self._robot.goals())
            feedback = self._feedback.issue()
        except BaseException as error:  # an adapter may raise one that ends the loop or cancels the task
            self._stops.fail(error)
            raise RobotFailed(named(error)) from error
        self._links.publisher.publish_feedback(feedback)
        atexit.register(self._ticks.rest_at_exit)
        self._liveness.start(self._keeper.note_end)
        # No group of the caller: the ticks go on while the caller is cancelled, until `close` has brought the robot to
        # rest; and a failure must not cancel the caller, which closes the bridge.
        self._running = asyncio.get_running_loop().create_task(self._run(), name="bridge")

    async def wait(self, leave: asyncio.Event | None = None) -> None:
        """Wait until the bridge is closed, or `leave` is set because the caller wants to close it.

        Raises:
            RobotFailed: the robot adapter or a part of the bridge raised; the robot rests and the bridge has ended.
        """
        running, leave = self._running, leave or asyncio.Event()
        if running is None:
            return
        running.add_done_callback(lambda _: leave.set())
        await leave.wait()
        if running.done() and not running.cancelled() and (error := running.exception()) is not None:
            raise error

    async def close(self) -> None:
        """Bring the robot to rest, end all links and the robot. May be called again."""
        if self._closed:
            return
        self._closed = True
        self._liveness.leaving()
        if self._dialer is not None:
            self._dialer.leave()
        try:
            await self._links.close()
            if self._running is not None:
                await self._ticks.come_to_rest(self._running)
        finally:
            await self._end_run()
            in_order = False
            try:
                if self._lockout is not None:
                    await asyncio.to_thread(self._lockout.close)
                await asyncio.to_thread(self._watchdogs.close)
                self._liveness.ticked()
                self._robot.close()
                self._liveness.ticked()
                in_order = not self._stops.failure
            finally:
                await self._keeper.close(in_order=in_order)
                if self._settings.event_log is not None:
                    await asyncio.to_thread(self._log.close)
                self._liveness.close()

    async def _end_run(self) -> None:
        """End the ticks, which always apply the rest values and call the robot's own stop."""
        if self._running is not None:
            self._running.cancel()
            await asyncio.wait([self._running])
            if not self._running.cancelled():
                self._running.exception()  # `wait` raises it; here it only must not count as unnoticed
        atexit.unregister(self._ticks.rest_at_exit)

    async def __aenter__(self) -> Self:
        await self.start()
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.close()

    async def _run(self) -> None:
        try:
            async with asyncio.TaskGroup() as group:
                group.create_task(self._ticks.run())  # first: it brings the robot to rest, however the others end
                group.create_task(self._links.run())
                group.create_task(self._run_reports())
                group.create_task(self._sources.run())
                group.create_task(self._maps.run())
                if self._dialer is not None:
                    group.create_task(self._dialer.run())
        except (asyncio.CancelledError, GeneratorExit):
            raise
        except BaseException as errors:
            error = first_cause(errors)
            self._stops.fail(error)
            self._tell_failure()
            await self._links.close(self._stops.failure)
            raise error if isinstance(error, RobotFailed) else RobotFailed(named(error)) from error

    def _tell_failure(self) -> None:
        try:
            self._links.publisher.publish_feedback(self._feedback.issue_failed(self._stops.failure))
        except Exception as error:
            _logger.error("the bridge cannot report the failure: %s", error, exc_info=error)

    async def _run_reports(self) -> None:
        while True:
            await asyncio.sleep(self._settings.log_interval)
            self.report()

    def report(self) -> None:
        """Log one line with the counters."""
        counters = self.counters
        _logger.info(
            "event %d, executed %d, issued %d, media %d, skipped ticks %d, stalls %d, limits %s, refusals %s, "
            "bad input %s, drops %s, left out %s, endings %s",
            self._core.current,
            counters.executed,
            counters.issued,
            counters.media,
            counters.skipped_ticks,
            counters.stalls,
            dict(counters.limits),
            dict(counters.refusals),
            dict(counters.bad_input),
            dict(self.drops),
            dict(counters.left_out),
            dict(counters.endings),
        )


def _dialer(access: ConsoleAccess, links: LinkServer) -> "Dialer":
    """Return what dials the console. It is imported here, because a ROS installation's Python has no `websockets`."""
    from lockstep.robot_bridge.dial.dialer import Dialer

    return Dialer(access, links)


def first_cause(error: BaseException) -> BaseException:
    """Return the first exception that ended a group of tasks."""
    while isinstance(error, BaseExceptionGroup):
        error = error.exceptions[0]
    return error
