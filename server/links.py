"""The links that open the console, as they are printed."""

import socket
from typing import NamedTuple

from server.access import Access
from server.settings import Settings

__all__ = ["ConsoleLinks", "console_links"]

ANY = ("0.0.0.0", "::")


class ConsoleLinks(NamedTuple):
    """The tokens stand in the fragment: no server and no log ever sees them."""

    console: str
    operator: str
    observer: str
    supervisor: str
    robot: str

    def for_people(self) -> str:
        return (
            f"\n  Lockstep is ready. The robot is at {self.robot}.\n"
            f"\n  To drive, open:   {self.operator}\n"
            f"\n  To watch, open:   {self.observer}\n"
            f"\n  To supervise:     {self.supervisor}\n"
            "\n  Whoever has the first link can drive the robot; share the second. The third may take control from anybody."
            "\n  `lockstep invite` makes links that end when you say. Ctrl-C ends everything.\n\n"
        )


def console_links(settings: Settings, listener: socket.socket, access: Access) -> ConsoleLinks:
    """The links for what `listener` really listens on."""
    host, port = listener.getsockname()[:2]
    shown = _own_address() if host in ANY else host
    scheme = "https" if settings.encrypted else "http"
    console = settings.public_url or f"{scheme}://{f'[{shown}]' if ':' in shown else shown}:{port}"
    return ConsoleLinks(
        console=console,
        operator=f"{console}/#token={access.issue('operator', 'operator')}",
        observer=f"{console}/#token={access.issue('observer', 'observer')}",
        supervisor=f"{console}/#token={access.issue('supervisor', 'supervisor')}",
        robot=settings.robot,
    )


def _own_address() -> str:
    """The address that others most likely reach us at; sends nothing."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(("192.0.2.1", 9))  # TEST-NET-1, RFC 5737
        except OSError:
            return "127.0.0.1"
        address: str = probe.getsockname()[0]
        return address
