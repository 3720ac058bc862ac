"""The links that open the console."""

import socket
from collections.abc import Mapping
from typing import NamedTuple

import structlog

from lockstep.protocol.console import Role
from lockstep.server.auth.invitations import Invitation, Invitations
from lockstep.server.robot.dial_in import DIAL_IN
from lockstep.server.settings import Settings
from lockstep.server.state.persistent_state import ConsoleState
from lockstep.server.util.state_dir import StateDirUnusable

__all__ = ["ConsoleLinks", "console_link", "console_links", "listening_url"]

log = structlog.get_logger(__name__)

AT_START: tuple[Role, ...] = ("operator", "observer", "supervisor")  # `lockstep invite` makes links for policies
ANY = ("0.0.0.0", "::")


class ConsoleLinks(NamedTuple):
    """The links of a console. The tokens are in the fragment, so no server and no log ever sees them."""

    console: str
    operator: str
    observer: str
    supervisor: str
    robot: str  # address of the robot; "" in a fleet
    robots: Mapping[str, str] = {}  # of a fleet: addresses by name

    def address(self, name: str) -> str:
        """Return the address of the robot of this name; "" is the only one of a console."""
        return self.robots.get(name, self.robot)

    def fields(self) -> dict[str, object]:
        """Return the fields that are printed for programs."""
        return {name: value for name, value in self._asdict().items() if value}

    def for_people(self) -> str:
        return (
            f"\n  Lockstep is ready. {self._whereabouts()}\n"
            f"\n  To drive, open:   {self.operator}\n"
            f"\n  To watch, open:   {self.observer}\n"
            f"\n  To supervise:     {self.supervisor}\n"
            "\n  Anyone with the first link can drive the robot. Share the second. The third takes control from anyone."
            "\n  `lockstep invite` makes links that expire when you choose. Ctrl-C ends everything.\n\n"
        )

    def _whereabouts(self) -> str:
        if not self.robots:
            return "The robot dials in." if self.robot == DIAL_IN else f"The robot is at {self.robot}."
        each = "".join(f"\n    {name:<20} {address}" for name, address in self.robots.items())
        return f"The robots:{each}"


def console_link(console: str, token: str) -> str:
    return f"{console}/#token={token}"


def listening_url(settings: Settings, listener: socket.socket) -> str:
    """Return the URL by which others reach `listener`, unless the settings say better."""
    host, port = listener.getsockname()[:2]
    shown = next(iter(settings.advertise), None) or _own_address() if host in ANY else host
    scheme = "https" if settings.encrypted else "http"
    return settings.public_url or f"{scheme}://{f'[{shown}]' if ':' in shown else shown}:{port}"


def console_links(settings: Settings, console: str, state: ConsoleState) -> ConsoleLinks:
    """Return one link for each role of people: those of the last start, while they are good for long enough."""
    now = state.invitations.clock.now()

    def for_start(known: Invitations) -> dict[Role, Invitation]:
        return {role: known.for_start(role, settings.token_seconds, now) for role in AT_START}

    try:
        made = state.invitations.update(for_start)
    except StateDirUnusable as error:
        log.error("the links that are printed cannot be revoked and end with this console", detail=str(error))
        made = for_start(Invitations(state.invitations.known.all))
    links = {role: console_link(console, state.access.sign(each.identity, each.created)) for role, each in made.items()}
    return ConsoleLinks(console, links["operator"], links["observer"], links["supervisor"], settings.robot)


def _own_address() -> str:
    """Return the address at which others most likely reach this machine. Sends nothing."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(("192.0.2.1", 9))  # TEST-NET-1, RFC 5737
        except OSError:
            return "127.0.0.1"
        address: str = probe.getsockname()[0]
        return address
