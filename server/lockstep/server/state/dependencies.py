"""The dependencies of one robot's routes, made by its session."""

import math
import shutil
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from fastapi import Request
from starlette.requests import HTTPConnection

from lockstep.server.audit.audit_log import AuditLog
from lockstep.server.auth.tokens import Access, Right
from lockstep.server.control.console import Console
from lockstep.server.control.stop.stop_service import StopAnswer
from lockstep.server.errors import RobotFailed, SceneUnavailable
from lockstep.server.foxglove.service import FoxgloveService
from lockstep.server.http.request_rate_limits import RequestRateLimits
from lockstep.server.media.hub import MediaHub
from lockstep.server.peers.token_revocation import TokenRevocation
from lockstep.server.publishing.publishers import Publishers
from lockstep.server.recording.episodes.episode_service import EpisodeService
from lockstep.server.recording.service import RecordingService
from lockstep.server.recording.writing.recorder import Recorder
from lockstep.server.rerun.service import RerunService
from lockstep.server.robot.dial_in import DialIn
from lockstep.server.scene.view import SceneView
from lockstep.server.session_events import SessionEvents
from lockstep.server.settings import Settings
from lockstep.server.sfu.coordinator import SfuCoordinator
from lockstep.server.state.console_context import ConsoleContext
from lockstep.server.state.persistent_state import ConsoleState
from lockstep.server.stop.stop_presses import Press
from lockstep.server.talkback.talkback import Talkback
from lockstep.server.telemetry.metrics import Metrics

__all__ = ["Dependencies", "TakesStops", "authorized", "known_caller", "dependencies", "takes_stops"]


class TakesStops(Protocol):
    """Receives the STOPs of one robot."""

    @property
    def access(self) -> Access: ...

    async def stop(self, press: Press) -> StopAnswer:
        """Latch a STOP at once; return the robot's answer, or that there is none. Raises Silenced."""
        ...


@dataclass(frozen=True, kw_only=True)
class Dependencies:
    robot: str  # its name in a fleet; "" is the only robot of a console
    settings: Settings
    metrics: Metrics
    events: SessionEvents
    console: Console
    media: MediaHub
    context: ConsoleContext
    access: Access
    audit: AuditLog
    revocation: TokenRevocation
    scene: SceneView | None  # None when it is switched off or could not start
    recorder: Recorder
    relays: SfuCoordinator
    voice: Talkback
    publishers: Publishers
    dial_in: DialIn | None  # None: the console connects to the robot
    recordings: RecordingService
    episodes: EpisodeService
    foxglove: FoxgloveService | None = None  # None: no port was named
    rerun: RerunService | None = None  # None: nothing was named

    @property
    def state(self) -> ConsoleState:
        return self.context.state

    @property
    def request_limits(self) -> RequestRateLimits:
        return self.context.request_limits

    async def stop(self, press: Press) -> StopAnswer:
        """Latch a STOP at once; return the robot's answer, or that there is none. Raises Silenced."""
        self.console.stops.stop(press)
        outcome = await self.console.stops.outcome(press.id)
        return StopAnswer(outcome, self.console.clock.event, self.console.robot.up)

    def collect(self) -> None:
        """Update the metrics with counts that are kept elsewhere."""
        self.metrics.collect(self.console.robot.bad_input(), self.console.robot.drops())
        self.metrics.links_unreadable.set(bool(self.state.invitations.trouble))
        self.metrics.collect_audit(self.audit.lost, self.audit.failures)
        self.context.collect()
        self.publishers.collect()
        self.metrics.recording_failed.set(self.recorder.state().state == "failed")
        self.metrics.free_bytes.set(free_bytes(self.recorder.shelf.directory))

    def scene_or_error(self) -> SceneView:
        """Return the 3D scene. Raises SceneUnavailable when there is none."""
        if self.scene is None:
            raise SceneUnavailable("the 3D scene is switched off")
        return self.scene


def free_bytes(directory: Path) -> float:
    """Return the free bytes of the disk on which `directory` is, or is to be made; NaN if not known."""
    for place in (directory, *directory.parents):
        with suppress(OSError):
            return float(shutil.disk_usage(place).free)
    return math.nan


def dependencies(connection: HTTPConnection) -> Dependencies:
    """Return the dependencies. Raises RobotFailed while the session has failed and is started again."""
    found = connection.app.state.dependencies
    if found is None:
        raise RobotFailed("the console's session of this robot has failed; it is started again")
    if not isinstance(found, Dependencies):
        raise TypeError("the app is not running")
    return found


def takes_stops(connection: HTTPConnection) -> TakesStops:
    """Return the receiver of STOPs. A fleet has one also while the session has failed."""
    keeper: TakesStops | None = getattr(connection.app.state, "stop_keeper", None)
    return dependencies(connection) if keeper is None else keeper


async def authorized(request: Request) -> Right:
    """Return the caller's right. Raises AccessError, StateUnavailable."""
    return known_caller(request, dependencies(request).access.bearer(request.headers.get("authorization")))


def known_caller(request: Request, caller: Right) -> Right:
    """Return the caller, noted in the request so that the audit names it in refusals."""
    request.state.actor = caller.actor
    return caller
