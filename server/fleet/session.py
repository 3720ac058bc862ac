"""One robot of a fleet: its routes, and its session, which is started again when it fails. No other one notices."""

import asyncio
from collections.abc import Callable
from pathlib import Path

import structlog

from server.access import Access
from server.app import attach_session, session_app
from server.audit import Actor, AuditRecord
from server.backoff import Backoff
from server.console import Console
from server.fleet.fleet_metrics import FleetMetrics
from server.fleet.pulse import Pulse
from server.house import House
from server.log_context import name_robot
from server.metrics import Metrics
from server.page import page_router
from server.robot_session import running_session
from server.services import Services
from server.settings import Settings
from server.state_dir import StateDir

__all__ = ["FleetSession"]

log = structlog.get_logger(__name__)

RESTARTED = "restart"  # where a stop comes from that an earlier session has left
HEALTHY_AFTER = 30.0  # s that a session lives, then its next failure is answered soon again
FIRST_WAIT, LONGEST_WAIT = 0.5, 10.0  # s before a session that failed is started again


class FleetSession:
    """Run `run` as a task. The routes answer from the beginning on, by name while there is no session.

    Attributes:
        app: the robot's routes, to be mounted
        settled: set when the session was started for the first time, or has failed to
    """

    def __init__(self, name: str, settings: Settings) -> None:
        self.name = name
        self.settings = settings
        self.pulse = Pulse()
        self.settled = asyncio.Event()
        self.app = session_app(settings)
        self.app.include_router(page_router())
        attach_session(self.app, None)
        self._backoff = Backoff(FIRST_WAIT, LONGEST_WAIT)
        self._kept_stop: tuple[Actor, str, str] | None = None  # that the next session begins with
        self._last: Console | None = None  # that of the session which runs, or ran last
        self._access: Access | None = None
        self._ended_before = 0  # connections of earlier sessions

    @property
    def services(self) -> Services | None:
        """None while the session has failed."""
        found: Services | None = self.app.state.services
        return found

    @property
    def ended(self) -> int:
        """Connections, ever."""
        here = self.services
        return self._ended_before + (0 if here is None else here.console.peers.ended)

    @property
    def moving(self) -> bool:
        here = self.services
        return here is not None and here.console.clock.moving

    @property
    def access(self) -> Access:
        """Who may come to this robot; known as long as it runs."""
        if self._access is None:
            raise TypeError("the fleet is not running")
        return self._access

    def stop(self, by: Actor, where: str, reason: str) -> tuple[bool, int]:
        """Whether the robot was told, and its event. Without a session the stop is the first that the next one does."""
        here = self.services
        if here is None:
            self._kept_stop = (by, where, reason)
            log.warning("stop kept", by=by.name, where=where, reason=reason, robot=self.name)
            return False, 0
        return here.stop(by, where, reason)

    async def run(
        self, house: House, directory: Path, metrics: FleetMetrics, told: Callable[[str, AuditRecord], None]
    ) -> None:
        """Until cancelled. `told` hears every record of its audit."""
        self.app.state.house = house
        self._access = house.state.access.at(self.name)
        self.app.state.stop_keeper = self
        name_robot(self.name)
        loop = asyncio.get_running_loop()
        while True:
            since = loop.time()
            try:
                await self._live(house, directory, metrics, told)
            except Exception:
                metrics.session_failures.labels(self.name).inc()
                log.exception("the session of this robot has failed")
                if _ending():
                    return
            self._inherit_stop()
            self.settled.set()
            if loop.time() - since > HEALTHY_AFTER:
                self._backoff.healthy()
            await asyncio.sleep(self._backoff.next())

    async def _live(
        self, house: House, directory: Path, metrics: FleetMetrics, told: Callable[[str, AuditRecord], None]
    ) -> None:
        own = Metrics(process=False)
        async with running_session(self.settings, house, own, StateDir(directory), self.name) as made:
            made.audit.on_record = lambda record: told(self.name, record)
            attach_session(self.app, made)
            self._last = made.console
            if self._kept_stop is not None:
                made.console.stop(*self._kept_stop)
                self._kept_stop = None
            metrics.watch(self.name, made)
            self.settled.set()
            try:
                await asyncio.Event().wait()
            finally:
                self._ended_before = self.ended
                attach_session(self.app, None)
                metrics.forget(self.name)

    def _inherit_stop(self) -> None:
        """A stop that nobody has reset outlives a fault of ours, also where the robot has not heard of it yet."""
        stop = None if self._last is None else self._last.latched_stop
        if stop is not None and self._kept_stop is None:
            self._kept_stop = (Actor(stop.by), RESTARTED, stop.reason)
        self._last = None

    def look(self, now: float) -> None:
        """Once a second: how it does."""
        here = self.services
        if here is None:
            self.pulse.look(now, up=False, epoch="", event=1)
        else:
            clock = here.console.clock
            self.pulse.look(now, up=here.console.robot.up, epoch=clock.epoch, event=clock.event)


def _ending() -> bool:
    """Whether this task was told to end, and a fault in ending has hidden that."""
    task = asyncio.current_task()
    return task is not None and task.cancelling() > 0
