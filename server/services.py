"""What the routes need, made by the app's lifespan."""

from dataclasses import dataclass

from fastapi import Request
from starlette.requests import HTTPConnection

from server.access import Access, Identity
from server.audit_log import AuditLog
from server.console import Console
from server.errors import SceneUnavailable
from server.guard import Guard
from server.link_warden import LinkWarden
from server.media.plane import MediaPlane
from server.metrics import Metrics
from server.relay.desk import RelayDesk
from server.scene import SceneView
from server.settings import Settings
from server.state import ConsoleState
from server.voice import VoiceService

__all__ = ["Services", "authorized", "services"]


@dataclass(frozen=True)
class Services:
    settings: Settings
    metrics: Metrics
    console: Console
    media: MediaPlane
    state: ConsoleState
    audit: AuditLog
    warden: LinkWarden
    guard: Guard
    scene: SceneView | None  # None when it is switched off or could not start
    relays: RelayDesk
    voice: VoiceService

    @property
    def access(self) -> Access:
        return self.state.access

    def scene_or_error(self) -> SceneView:
        """Raises SceneUnavailable when there is no 3D scene."""
        if self.scene is None:
            raise SceneUnavailable("the 3D scene is switched off")
        return self.scene


def services(connection: HTTPConnection) -> Services:
    found = connection.app.state.services
    if not isinstance(found, Services):
        raise TypeError("the app is not running")
    return found


def authorized(request: Request) -> Identity:
    """Who asks. Raises AccessError."""
    return services(request).access.bearer(request.headers.get("authorization"))
