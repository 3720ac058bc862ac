"""Assembles the bridge: link server, event core, axis shaper, robot, media sources, event log."""

import asyncio
import atexit
import contextlib
import logging
import math
import secrets
import time
from collections import Counter
from collections.abc import Callable
from types import TracebackType
from typing import Self

from lockstep.protocol.messages import MAX_FAULTS, Command, Media, Refusal, Reset, Rest, Stop
from lockstep.robot_bridge.control import clock
from lockstep.robot_bridge.control.axis_shaper import AxisShaper
from lockstep.robot_bridge.control.coming_to_rest import ComingToRest
from lockstep.robot_bridge.control.event_core import Answered, EventCore, Executed, Refused
from lockstep.robot_bridge.control.event_times import EventTimes
from lockstep.robot_bridge.control.last_known import LastKnown
from lockstep.robot_bridge.control.motion_limits import MotionLimits
from lockstep.robot_bridge.control.start_signal import StartSignal
from lockstep.robot_bridge.control.ticker import Ticker
from lockstep.robot_bridge.counters import BridgeCounters
from lockstep.robot_bridge.description.check_description import check_description
from lockstep.robot_bridge.errors import RobotFailed, RobotUnavailable
from lockstep.robot_bridge.event_log import EventKind, EventLog
from lockstep.robot_bridge.link.check_link import check_link
from lockstep.robot_bridge.link.link_server import LinkPeer, LinkServer
from lockstep.robot_bridge.link.link_session import BadInput
from lockstep.robot_bridge.robots.base import Measurement, MediaSource, Robot, Stamp
from lockstep.robot_bridge.settings import BridgeSettings
from lockstep.robot_bridge.stop.lockout_file import LockoutFile
from lockstep.robot_bridge.stop.stop_keeper import StopKeeper
from lockstep.robot_bridge.stop.stop_latch import OVERTAKEN, ResetRefused, ResetTaken, ResetWaits, StopGiven
from lockstep.robot_bridge.watchdog.liveness import Liveness
from lockstep.robot_bridge.watchdog.stall import watchdog_seconds
from lockstep.robot_bridge.watchdog.watchdogs import Held, Watchdogs

__all__ = ["Bridge"]

REST_MARGIN = 0.5  # s on top of hold for the robot to come to rest when the bridge closes
ADDRESSES_FILE = "addresses.txt"  # in the state directory
MAX_FAULT = 500  # characters in one fault
MAX_CATCH_UP = 3  # ticks made good after the loop was blocked; the rest are skipped

_logger = logging.getLogger(__name__)


def _marker(settings: BridgeSettings) -> Callable[[Media], Media]:
    """Return the function that draws the event into pictures, for measurements.

    Drawing needs numpy, which a robot's own bridge may not have.
    """
    if not settings.event_strip:
        return lambda media: media
    from lockstep.robot_bridge.robots.event_strip import with_event_strip

    return with_event_strip


class Bridge:
    """One run of a robot: one epoch. `start` returns when the bridge listens; `close` leaves the robot at rest."""

    def __init__(
        self, robot: Robot, settings: BridgeSettings, now: clock.Clock = clock.now, *, liveness: Liveness | None = None
    ) -> None:
        """`now`: the clock that bounds motion; it counts suspended time.

        `liveness`: ends the process when the bridge hangs; the process must be the bridge's alone. None: nothing does.

        Raises:
            DescriptionError: the robot's description contradicts itself.
            InsecureLink: any client that reaches the address could drive, and the settings do not say that this is
            wanted.
            SecretError: the TLS files cannot be used.
        """
        check_link(settings)
        self.description = robot.describe()
        check_description(self.description)
        self.epoch = secrets.token_hex(8)
        self.address = (settings.host, settings.port)
        self.counters = BridgeCounters()
        self._robot = robot
        self._settings = settings
        self._now = now
        self._core = EventCore(
            self.description.axes,
            max_event_age=self.description.max_event_age,
            max_event_rate=self.description.max_event_rate,
            first_event=settings.first_event,
            start_warning=self.description.start_warning,
        )
        self._keeper = StopKeeper(settings.state_dir, settings.older_state_dirs)
        self._resetting: tuple[LinkPeer, Reset] | None = None  # the link whose reset waits for the disk
        self._lockout = None if settings.lockout_file is None else LockoutFile(settings.lockout_file)
        self._signal = StartSignal(self.description)
        self._limits = MotionLimits(self.description, robot, robot.tick_seconds)
        self._shaper = AxisShaper(self.description.axes, hold=self.description.hold, limiter=self._limits)
        self._links = LinkServer(
            self,
            self.description,
            self.epoch,
            self.counters,
            max_links=settings.max_links,
            max_strangers=settings.max_strangers,
            operator_grace=settings.operator_grace,
            addresses_file=None if settings.state_dir is None else settings.state_dir / ADDRESSES_FILE,
            secret=settings.secret,
            tls=None if settings.tls is None else settings.tls.bridge_context(),
        )
        self._watchdogs = Watchdogs(robot, watchdog_seconds(self.description, robot.tick_seconds), now)
        self._liveness = liveness or Liveness()
        self._rested_why = ""  # why the robot came to rest on its own, until a command executes; "": it did not
        self._log: EventLog | None = None
        self._times = EventTimes()
        self._last_known = LastKnown(self.description)
        self._mark = _marker(settings)
        self._acting: frozenset[str] = frozenset()  # limits that slowed the robot in the last tick
        self._blind: frozenset[str] = frozenset()  # those among them that did because the position was unknown
        self._acted: set[str] = set()  # limits that slowed it since the last feedback
        self._source_faults: list[str] = []  # "camera overview: ..."
        self._running: asyncio.Task[None] | None = None
        self._at_rest = asyncio.Event()  # nothing is driven
        self._rested = True  # nothing was driven at the last tick
        self._robot_error: BaseException | None = None
        self._stop_due = False  # the robot's own stop follows when the axes are at rest
        self._failure = ""  # why the run has ended, "robot failed: OSError: ..."; "" while it goes on
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
        """Start the bridge; returns when it listens.

        Raises:
            ListenError: the address cannot be had.
            RobotUnavailable: the robot's watchdog process cannot be had.
            StateDirInUse, StateDirUnusable: the stop cannot be kept in the directory of the settings.
            OSError: the event log cannot be opened.
        """
        try:
            self._core.begin(await self._keeper.open(self._now()))
            if self._settings.event_log is not None:
                self._log = EventLog(self._settings.event_log)
            if self._lockout is not None:
                await asyncio.to_thread(self._lockout.start)
            await self._watchdogs.start()
            self.address = await self._links.listen(self._settings.host, self._settings.port)
        except BaseException:
            await self.close()
            raise
        self._keeper.start(self._written)
        stop = self._core.stop_state
        self._record("start", self._core.current, epoch=self.epoch, stopped=stop.stopped, number=stop.number)
        if stop.stopped:
            self._stop_due = True
        self._issue()
        atexit.register(self._rest_at_exit)
        self._liveness.start(self._keeper.note_end)
        self._running = asyncio.get_running_loop().create_task(self._run(), name="bridge")

    async def wait(self) -> None:
        """Wait until the bridge is closed.

        Raises:
            RobotFailed: the robot adapter or a part of the bridge raised; the robot rests and the bridge has ended.
        """
        if self._running is not None:
            await asyncio.wait([self._running])
            if not self._running.cancelled() and (error := self._running.exception()) is not None:
                raise error

    async def close(self) -> None:
        """Bring the robot to rest, end all links and the robot. May be called again."""
        if self._closed:
            return
        self._closed = True
        self._liveness.leaving()
        try:
            await self._links.close()
            if self._running is not None:
                await self._come_to_rest(self._running)
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
                in_order = not self._failure
            finally:
                await self._keeper.close(in_order=in_order)
                if self._log is not None:
                    await asyncio.to_thread(self._log.close)
                self._liveness.close()

    async def _end_run(self) -> None:
        """End the ticks, which always apply the rest values and call the robot's own stop."""
        if self._running is None:
            return
        self._running.cancel()
        await asyncio.wait([self._running])
        if not self._running.cancelled():
            self._running.exception()  # `wait` raises it; here it only must not count as unnoticed
        atexit.unregister(self._rest_at_exit)

    def _rest_at_exit(self) -> None:
        """Bring the robot to rest when the process ends without `close`: the bridge's loop is gone."""
        leaving = self._coming_to_rest()
        leaving.at_once()
        leaving.stop()

    async def _come_to_rest(self, running: asyncio.Task[None]) -> None:
        """Let the ticks go on until nothing is driven; give up if they have ended or take too long."""
        self._shaper.rest()
        running.add_done_callback(lambda _: self._at_rest.set())
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(self.description.hold + REST_MARGIN):
                while not (self._shaper.at_rest or running.done()):
                    self._at_rest.clear()
                    await self._at_rest.wait()

    async def __aenter__(self) -> Self:
        await self.start()
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.close()

    # LinkHandler

    def link_opened(self, peer: LinkPeer) -> None:
        if peer is self._links.operator:
            self._need_neutral()
        self._core.want_issue()

    def link_message(self, peer: LinkPeer, message: Command | Rest | Stop | Reset) -> None:
        match message:
            case Command():
                self._command(peer, message)
            case Rest():
                applied = self._core.rest(message.event)
                if applied:
                    self._shaper.rest()
                self._record("rest", message.event, applied=applied)
            case Stop():
                self._stop(peer, message)
            case Reset():
                self._reset(peer, message)

    def link_bad_input(self, peer: LinkPeer, bad: BadInput) -> None:
        if bad.name == "malformed" or bad.name == "not_allowed":
            self._refuse(peer, self._core.refusal(bad.event, bad.name, bad.detail))

    def operator_lost(self) -> None:
        self._shaper.rest()

    def _command(self, peer: LinkPeer, command: Command) -> None:
        now = self._now()
        outcome = self._core.command(command, now)
        if isinstance(outcome, Executed):
            self._rested_why = ""
            self._shaper.drive(outcome.values, now)
            self.counters.executed += 1
            self._record("executed", outcome.event, issue=command.issue, values=outcome.values)
        elif isinstance(outcome, Answered):
            peer.send(outcome.feedback)
        elif isinstance(outcome, Refused):
            self._refuse(peer, outcome.refusal)

    def _refuse(self, peer: LinkPeer, refusal: Refusal) -> None:
        self.counters.refusals[refusal.reason] += 1
        self._record("refused", refusal.event, reason=refusal.reason, current=refusal.current)
        peer.send(refusal)

    def _stop(self, peer: LinkPeer, stop: Stop) -> None:
        given = self._core.stop(stop.press, stop.by, stop.reason, self._now())
        self._note_stop(given, stop.by, stop.reason, stop.press)
        self._keeper.answer(peer, stop.press, given.number)

    def _note_stop(self, given: StopGiven, by: str, reason: str, press: str = "") -> None:
        """Bring the axes to rest first, before any other effect of a stop."""
        if not given.is_new:
            return
        self._shaper.rest()
        self._stop_due |= given.latched
        self._keeper.changed()
        if given.overtaken and self._resetting is not None:
            self._refuse_reset(self._resetting[0], ResetRefused(given.overtaken, "stale_reset", OVERTAKEN))
            self._resetting = None
        self._record("stop", self._core.current, by=by, reason=reason, number=given.number, press=press)

    def _reset(self, peer: LinkPeer, reset: Reset) -> None:
        outcome = self._core.reset(reset.number, self._now())
        if isinstance(outcome, ResetTaken):
            self._released(outcome, reset.by)
        elif isinstance(outcome, ResetWaits):
            self._resetting = peer, reset
            self._keeper.changed()
        elif isinstance(outcome, ResetRefused):
            self._refuse_reset(peer, outcome)

    def _written(self, version: int, error: str) -> None:
        """Tell the core that the latch was written to the disk, or could not be, and answer a waiting reset."""
        outcome = self._core.written(version, error)
        if outcome is None or self._resetting is None:
            return
        (peer, reset), self._resetting = self._resetting, None
        if isinstance(outcome, ResetTaken):
            self._released(outcome, reset.by)
        else:
            self._refuse_reset(peer, outcome)

    def _refuse_reset(self, peer: LinkPeer, refused: ResetRefused) -> None:
        self._refuse(peer, self._core.refusal(0, refused.reason, refused.detail, stop=refused.number))

    def _released(self, reset: ResetTaken, by: str) -> None:
        if not self._stop_due:  # else the robot has not been told to stop yet
            self._call_robot(self._robot.reset)
        self._stop_due = False
        self._record("reset", self._core.current, by=by, number=reset.number)

    def _need_neutral(self) -> None:
        """Bring the axes to rest; they move on only after a neutral command."""
        self._shaper.rest()
        self._core.need_neutral()

    def _call_robot(self, call: Callable[[], None]) -> None:
        """Call the adapter; if it raises, the bridge ends at the next tick, not the link that led to the call."""
        try:
            call()
        except BaseException as error:
            self._robot_error = error

    # the tick

    async def _run(self) -> None:
        try:
            async with asyncio.TaskGroup() as group:
                group.create_task(self._run_ticks())  # first: it brings the robot to rest, however the others end
                group.create_task(self._links.run())
                group.create_task(self._run_reports())
                group.create_task(self._run_sources(group))
        except (asyncio.CancelledError, GeneratorExit):
            raise
        except BaseException as errors:
            error = first_cause(errors)
            self._fail(error)
            self._tell_failure()
            await self._links.close(self._failure)
            raise error if isinstance(error, RobotFailed) else RobotFailed(named(error)) from error

    async def _run_ticks(self) -> None:
        """Run the ticks. However they end, this brings the robot to rest and stops it before it ends itself."""
        try:
            await self._tick_on()
        except GeneratorExit:  # the loop is gone: nothing can be awaited any more
            self._rest_at_exit()
            raise
        except asyncio.CancelledError:
            await self._leave()
            raise
        except BaseException as error:
            self._fail(error)
            await self._leave()
            raise

    async def _leave(self) -> None:
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
            if not self._rested:
                self._rested = True
                self._record("at_rest", self._core.current)

    def _tell_watchdogs(self) -> None:
        """Tell the watchdogs of a tick on the way to rest, where a call may hang too."""
        try:
            self._watchdogs.ticked(self._now(), not self._shaper.at_rest)
        except RobotUnavailable as error:
            _logger.error("%s", error)

    def _coming_to_rest(self) -> ComingToRest:
        return ComingToRest(self._robot, self._shaper, self.description.hold, self._now())

    def _fail(self, error: BaseException) -> None:
        """Latch the stop: after a restart of the bridge no axis moves until a reset."""
        if self._failure:
            return
        self._failure = f"robot failed: {named(error)}"[:500]
        _logger.error("%s", self._failure, exc_info=error)
        self._note_stop(self._core.stop("", "", self._failure, self._now()), "", self._failure)

    def _tell_failure(self) -> None:
        """Feed back the new state, with the last measured values if the robot cannot be measured any more."""
        try:
            measured = self._robot.measure()
        except BaseException:  # the robot is not to be trusted any more
            axes, joints = ([math.nan] * len(each) for each in (self.description.axes, self.description.joints))
            measured = Measurement(axes=axes, joints=joints, wrench=[], ranges=[], at_rest=False, faults=[])
        try:
            self._issue_measured(measured._replace(faults=[*measured.faults, self._failure]), time.monotonic())
        except Exception as error:
            _logger.error("the bridge cannot report the failure: %s", error, exc_info=error)

    async def _tick_on(self) -> None:
        metronome = Ticker(self._robot.tick_seconds, time.monotonic(), catch_up=MAX_CATCH_UP)
        while True:
            await asyncio.sleep(metronome.wait(time.monotonic()))
            self.counters.skipped_ticks = metronome.skipped
            try:
                self._tick(self._now())
                self._liveness.ticked()
            except BaseException as error:  # an adapter may raise one that ends the loop or cancels the task
                raise RobotFailed(named(error)) from error

    def _tick(self, now: float) -> None:
        if self._robot_error is not None:
            raise self._robot_error
        self._look_at_lockout(now)
        moved = not self._shaper.at_rest
        values = self._shaper.step(now, self._robot.tick_seconds)  # asks for positions, which may hang too
        if (held := self._watchdogs.begin(now, moved)) is not None:
            self._held_up(held)
            values = self._shaper.values
        self._watchdogs.ticked(now, not self._shaper.at_rest)
        self._robot.apply(self._signal.on(values) if self._core.warns(now) else values)
        self._robot.tick()
        if self._limits.acting != self._acting:
            self._note_limits(self._limits.acting)
        if self._limits.blind != self._blind:
            self._note_blind(self._limits.blind)
        if self._shaper.at_rest:
            self._at_rest.set()
            if self._stop_due:
                self._stop_due = False
                self._robot.stop()
        if self._shaper.at_rest != self._rested:
            self._rested = self._shaper.at_rest
            self._record("at_rest" if self._rested else "driven", self._core.current)
        if self._core.issue_due(now):
            self._issue()

    def _look_at_lockout(self, now: float) -> None:
        """Check the lock-out file and the robot's own input: a person at the robot comes before a remote one."""
        file = "" if self._lockout is None else self._lockout.reason
        reason = " · ".join(filter(None, (file, self._robot.locked_out())))[:500]
        if reason == self._core.stop_state.locked_out:
            return
        if not reason:
            self._core.let_in()
            self._record("let_in", self._core.current)
            return
        self._record("locked_out", self._core.current, reason=reason)
        if (given := self._core.lock_out(reason, now)) is not None:
            self._note_stop(given, "at the robot", reason)

    def _held_up(self, held: Held) -> None:
        """Make the operator begin anew after too long without a tick: the robot's motion meanwhile is unknown."""
        self._shaper.cut()
        self._core.need_neutral()
        self.counters.stalls += 1
        self.counters.watchdog += held.acted
        self._rested_why = f"came to rest: the bridge was held up for {held.seconds:.2f} s"
        _logger.error(
            "%s%s", self._rested_why, "; a watchdog brought the robot to rest meanwhile" if held.acted else ""
        )
        self._record("stall", self._core.current, seconds=held.seconds, watchdog=held.acted)

    def _issue(self) -> None:
        taken = time.monotonic()
        self._issue_measured(self._robot.measure(), taken)

    def _issue_measured(self, measured: Measurement, taken: float) -> None:
        """Issue a feedback. `taken`: time of the measurement on the clock of capture times."""
        measured, unknown = self._last_known.settle(measured)
        if self._source_faults or self._rested_why:
            rested = [self._rested_why] if self._rested_why else []
            measured = measured._replace(faults=[*measured.faults, *rested, *self._source_faults])
        measured = measured._replace(
            at_rest=measured.at_rest and self._shaper.at_rest,
            faults=[fault[:MAX_FAULT] for fault in measured.faults[-MAX_FAULTS:]],
        )
        limits = sorted(self._acted | self._acting)
        feedback = self._core.issue(measured, self._now(), limits, unknown, time=taken)
        measured_by = time.monotonic()  # a picture that was captured before may show less than this feedback has
        self._times.changed(feedback.event, measured_by)
        self._acted.clear()
        self.counters.issued += 1
        self._record_at(measured_by, "feedback", feedback.event, issue=feedback.issue, at_rest=feedback.at_rest)
        self._links.publish_feedback(feedback)

    def _note_limits(self, acting: frozenset[str]) -> None:
        """Count each spell of a limit once, and record its beginning and its end."""
        self.counters.limits.update(acting - self._acting)
        self._acted |= acting | self._acting
        self._acting = acting
        self._record("limit", self._core.current, acting=sorted(acting))

    def _note_blind(self, blind: frozenset[str]) -> None:
        """Bring the axes to rest if a position is unknown.

        A deadman that is held until the position is known again must not start the robot.
        """
        begun, self._blind = blind - self._blind, blind
        if begun:
            self._need_neutral()
            self._rested_why = f"came to rest: the position is unknown ({', '.join(sorted(begun))})"

    # media

    async def _run_sources(self, group: asyncio.TaskGroup) -> None:
        try:
            sources = list(self._robot.sources())
        except BaseException as error:
            self._note_source_fault(error)
            return
        for source in sources:
            group.create_task(self._run_source(source))

    async def _run_source(self, source: MediaSource) -> None:
        """Run a media source; its failure is a fault of the robot, and does not end the bridge."""
        try:
            await source.run(_Stamper(self._core, self._times), self._emit)
        except GeneratorExit:
            raise
        except BaseException as error:
            task = asyncio.current_task()
            if isinstance(error, asyncio.CancelledError) and task is not None and task.cancelling():
                raise
            self._note_source_fault(error)

    def _note_source_fault(self, error: BaseException) -> None:
        _logger.error("a media source failed: %s", error, exc_info=error)
        self._source_faults.append(f"media: {type(error).__name__}: {error}"[:200])
        self._core.want_issue()

    def _emit(self, media: Media) -> None:
        self.counters.media += 1
        self._record("media", media.stamp, stream=media.stream, captured=media.time)
        self._links.publish_media(self._mark(media))

    # reporting

    async def _run_reports(self) -> None:
        while True:
            await asyncio.sleep(self._settings.log_interval)
            self.report()

    def report(self) -> None:
        """Log one line with the counters."""
        counters = self.counters
        _logger.info(
            "event %d, executed %d, issued %d, media %d, skipped ticks %d, stalls %d, limits %s, refusals %s, "
            "bad input %s, drops %s, endings %s",
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
            dict(counters.endings),
        )

    def _record(self, kind: EventKind, event: int, **fields: str | float | bool | list[float] | list[str]) -> None:
        self._record_at(time.monotonic(), kind, event, **fields)

    def _record_at(
        self, now: float, kind: EventKind, event: int, **fields: str | float | bool | list[float] | list[str]
    ) -> None:
        if self._log is not None:
            self._log.record(kind, now, event, **fields)


class _Stamper:
    def __init__(self, core: EventCore, times: EventTimes) -> None:
        self._core = core
        self._times = times

    def __call__(self) -> Stamp:
        return Stamp(self._core.current, time.monotonic())

    def at(self, time: float) -> Stamp | None:
        return self._times.at(time)


def first_cause(error: BaseException) -> BaseException:
    """Return the first exception that ended a group of tasks."""
    while isinstance(error, BaseExceptionGroup):
        error = error.exceptions[0]
    return error


def named(error: BaseException) -> str:
    """Return the error as "OSError: no such device"; the detail of a RobotFailed, which has that form already."""
    return error.detail if isinstance(error, RobotFailed) else f"{type(error).__name__}: {error}"
