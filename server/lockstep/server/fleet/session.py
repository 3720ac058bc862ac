"""One robot of a fleet: its routes, and its session, which is started again when it fails, unnoticed by others."""

import asyncio
from collections.abc import Callable
from functools import partial
from pathlib import Path

import structlog

from lockstep.server.audit.records import AuditRecord
from lockstep.server.auth.tokens import Access
from lockstep.server.composition.robot_app import attach_session, session_app
from lockstep.server.composition.robot_session import running_session
from lockstep.server.control.stop.stop_service import StopAnswer, StopOutcome
from lockstep.server.control.stop.stop_silence import SILENCED
from lockstep.server.errors import Silenced
from lockstep.server.fleet.event_rate import EventRateMeter
from lockstep.server.fleet.metrics import FleetMetrics
from lockstep.server.http.static_files import page_router
from lockstep.server.settings import Settings
from lockstep.server.state.console_context import ConsoleContext
from lockstep.server.state.dependencies import Dependencies
from lockstep.server.stop.stop_keeper import StopKeeper
from lockstep.server.stop.stop_presses import NewPress, Press
from lockstep.server.telemetry.log_context import name_robot
from lockstep.server.telemetry.metrics import Metrics
from lockstep.server.util.backoff import Backoff
from lockstep.server.util.state_dir import StateDir
from lockstep.server.util.uncancelled import attempt

__all__ = ["FleetSession"]

log = structlog.get_logger(__name__)

HEALTHY_AFTER = 30.0  # s of life after which a session is started again soon at its next failure
FIRST_WAIT, LONGEST_WAIT = 0.5, 10.0  # s before a session that failed is started again


class FleetSession:
    """One robot of a fleet. Run `run` as a task; without a session the routes answer with a named error.

    Attributes:
        app: the robot's routes, to be mounted
        settled: set when the session was started for the first time, or has failed to
    """

    def __init__(self, name: str, settings: Settings) -> None:
        self.name = name
        self.settings = settings
        self.rate_meter = EventRateMeter()
        self.settled = asyncio.Event()
        self.app = session_app(settings)
        self.app.include_router(page_router())
        attach_session(self.app, None)
        self._backoff = Backoff(FIRST_WAIT, LONGEST_WAIT)
        self._stops: StopKeeper | None = None  # None before `run`
        self._access: Access | None = None
        self._context: ConsoleContext | None = None
        self._ended_before = 0  # connections of earlier sessions

    @property
    def dependencies(self) -> Dependencies | None:
        """The dependencies of the session; None while it has failed."""
        found: Dependencies | None = self.app.state.dependencies
        return found

    @property
    def ended(self) -> int:
        """The number of connections that have ended so far."""
        here = self.dependencies
        return self._ended_before + (0 if here is None else here.console.peers.ended)

    @property
    def moving(self) -> bool:
        here = self.dependencies
        return here is not None and here.console.clock.moving

    @property
    def access(self) -> Access:
        """The access to this robot; known as long as it runs."""
        if self._access is None:
            raise TypeError("the fleet is not running")
        return self._access

    async def stop(self, press: Press) -> StopAnswer:
        """Stop the robot and return the outcome. Without a session the next one sends it first. Raises Silenced."""
        here = self.dependencies
        if here is not None:
            return await here.stop(press)
        stops = self._stops
        if stops is None or self._context is None:
            raise TypeError("the fleet is not running")
        if press.by.link and self._context.is_silenced(press.by.link):
            raise Silenced(SILENCED)
        stops.presses.forget(press.id)  # only the robot knows whether the stop of this press still holds
        pressed = stops.presses.press(press)
        log.warning("stop kept", by=press.by.name, where=press.where, reason=press.reason, robot=self.name)
        if isinstance(pressed, NewPress) and pressed.replaced is not None:
            stops.settled(pressed.replaced.id)
        stops.keep(press)
        detail = f"the session of this robot has failed; {await stops.kept_words(press.id)}"
        return StopAnswer(StopOutcome(press.id, None, detail), 0, up=False)

    async def run(
        self, context: ConsoleContext, directory: Path, metrics: FleetMetrics, told: Callable[[str, AuditRecord], None]
    ) -> None:
        """Run until cancelled. `told` is called with every record of the robot's audit."""
        self.app.state.context = self._context = context
        self._access = context.state.access.at(self.name)
        stops = self._stops = StopKeeper(directory, self.settings.robot, lasts=context.state.lasts)
        self.app.state.stop_keeper = self
        name_robot(self.name)
        await stops.load()
        async with asyncio.TaskGroup() as tasks:
            keeping = tasks.create_task(stops.run(), name=f"kept stops {self.name}")
            try:
                await self._live_on(context, directory, metrics, told, stops)
            finally:
                keeping.cancel()

    async def _live_on(
        self,
        context: ConsoleContext,
        directory: Path,
        metrics: FleetMetrics,
        told: Callable[[str, AuditRecord], None],
        stops: StopKeeper,
    ) -> None:
        """Run sessions, one after the other."""
        loop = asyncio.get_running_loop()
        while True:
            since = loop.time()
            try:
                await attempt(self._live(context, directory, metrics, told, stops))
            except Exception:
                metrics.session_failures.labels(self.name).inc()
                log.exception("the session of this robot has failed")
            self.settled.set()
            if loop.time() - since > HEALTHY_AFTER:
                self._backoff.healthy()
            await asyncio.sleep(self._backoff.next())

    async def _live(
        self,
        context: ConsoleContext,
        directory: Path,
        metrics: FleetMetrics,
        told: Callable[[str, AuditRecord], None],
        stops: StopKeeper,
    ) -> None:
        own = Metrics(process=False)
        async with running_session(self.settings, context, own, StateDir(directory), self.name, stops) as made:
            made.events.subscribe(AuditRecord, partial(told, self.name))
            attach_session(self.app, made)
            metrics.watch(self.name, made)
            self.settled.set()
            try:
                await asyncio.Event().wait()
            finally:
                self._ended_before = self.ended
                attach_session(self.app, None)
                metrics.forget(self.name)

    def look(self, now: float) -> None:
        """Take the session's event and link state, once a second."""
        here = self.dependencies
        if here is None:
            self.rate_meter.look(now, up=False, epoch="", event=1)
        else:
            clock = here.console.clock
            self.rate_meter.look(now, up=here.console.robot.up, epoch=clock.epoch, event=clock.event)
