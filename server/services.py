"""What the routes of one robot need, made by its session."""

import math
import shutil
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from fastapi import Request
from starlette.requests import HTTPConnection

from server.access import Access, Right
from server.audit_log import AuditLog
from server.console import Console
from server.errors import RobotFailed, SceneUnavailable
from server.guard import Guard
from server.house import House
from server.link_warden import LinkWarden
from server.media.plane import MediaPlane
from server.metrics import Metrics
from server.publishers import Publishers
from server.recording.recorder import Recorder
from server.recording.service import RecordingService
from server.relay.desk import RelayDesk
from server.scene import SceneView
from server.settings import Settings
from server.state import ConsoleState
from server.stop_presses import Press
from server.stop_service import StopAnswer
from server.voice import VoiceService

__all__ = ["Services", "TakesStops", "authorized", "known_caller", "services", "takes_stops"]


class TakesStops(Protocol):
    """Whom a STOP of one robot is said to."""

    @property
    def access(self) -> Access: ...

    async def stop(self, press: Press) -> StopAnswer:
        """Latched at once; returns when the robot has answered, or that it has not. Raises Silenced."""
        ...


@dataclass(frozen=True, kw_only=True)
class Services:
    robot: str  # its name in a fleet; "" is the only robot of a console
    settings: Settings
    metrics: Metrics
    console: Console
    media: MediaPlane
    house: House
    access: Access
    audit: AuditLog
    warden: LinkWarden
    scene: SceneView | None  # None when it is switched off or could not start
    recorder: Recorder
    relays: RelayDesk
    voice: VoiceService
    publishers: Publishers
    recordings: RecordingService

    @property
    def state(self) -> ConsoleState:
        return self.house.state

    @property
    def guard(self) -> Guard:
        return self.house.guard

    async def stop(self, press: Press) -> StopAnswer:
        """Latched at once; returns when the robot has answered, or that it has not. Raises Silenced."""
        self.console.stops.stop(press)
        outcome = await self.console.stops.outcome(press.id)
        return StopAnswer(outcome, self.console.clock.event, self.console.robot.up)

    def collect(self) -> None:
        """Bring into the metrics what is counted elsewhere."""
        self.metrics.collect(self.console.robot.bad_input(), self.console.robot.drops())
        self.metrics.links_unreadable.set(bool(self.state.invitations.trouble))
        self.metrics.collect_audit(self.audit.lost, self.audit.failures)
        self.house.collect()
        self.publishers.collect()
        self.metrics.recording_failed.set(self.recorder.state().state == "failed")
        self.metrics.free_bytes.set(free_bytes(self.recorder.shelf.directory))

    def scene_or_error(self) -> SceneView:
        """Raises SceneUnavailable when there is no 3D scene."""
        if self.scene is None:
            raise SceneUnavailable("the 3D scene is switched off")
        return self.scene


def free_bytes(directory: Path) -> float:
    """Where `directory` is, or is to be made; NaN when that cannot be known."""
    for place in (directory, *directory.parents):
        with suppress(OSError):
            return float(shutil.disk_usage(place).free)
    return math.nan


def services(connection: HTTPConnection) -> Services:
    """Raises RobotFailed while the session has failed and is started again."""
    found = connection.app.state.services
    if found is None:
        raise RobotFailed("the console's session of this robot has failed; it is started again")
    if not isinstance(found, Services):
        raise TypeError("the app is not running")
    return found


def takes_stops(connection: HTTPConnection) -> TakesStops:
    """In a fleet there is somebody also while the session has failed."""
    keeper: TakesStops | None = getattr(connection.app.state, "stop_keeper", None)
    return services(connection) if keeper is None else keeper


async def authorized(request: Request) -> Right:
    """What whoever asks may do. Raises AccessError, StateUnavailable."""
    return known_caller(request, services(request).access.bearer(request.headers.get("authorization")))


def known_caller(request: Request, caller: Right) -> Right:
    """Whoever asks, on a route whose refusals are in the audit."""
    request.state.actor = caller.actor
    return caller
