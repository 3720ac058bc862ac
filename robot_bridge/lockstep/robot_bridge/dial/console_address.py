"""The address of a console as a robot is told it: wss://host[:port][/robots/NAME]. No I/O."""

from typing import NamedTuple
from urllib.parse import urlsplit

from lockstep.protocol.dial_in import DIAL
from lockstep.robot_bridge.errors import BadConsoleAddress
from lockstep.robot_bridge.loopback import is_loopback

__all__ = ["ConsoleAddress"]


class ConsoleAddress(NamedTuple):
    url: str  # "wss://console.example.org/robots/left", without a slash at the end

    @classmethod
    def parse(cls, text: str) -> "ConsoleAddress":
        """Read an address. `https://` means `wss://`.

        Raises:
            BadConsoleAddress: not such an address, or one without TLS that leaves this machine.
        """
        try:
            parts = urlsplit(text.strip())
            port = parts.port  # raises for a bad one
        except ValueError as error:
            raise BadConsoleAddress(f"{text[:200]!r}: {error}") from error
        scheme = {"https": "wss", "http": "ws"}.get(parts.scheme, parts.scheme)
        if scheme not in ("wss", "ws") or not parts.hostname or parts.query or parts.fragment or parts.username:
            raise BadConsoleAddress(f"{text[:200]!r} is not wss://host, wss://host:port or wss://host/robots/NAME")
        if scheme == "ws" and not is_loopback(parts.hostname):
            raise BadConsoleAddress(
                f"{text[:200]!r}: without TLS anybody on the way could drive the robot; use wss:// and let the console"
                " speak TLS (`lockstep serve --tls self-signed`, or a proxy in front of it)"
            )
        host = f"[{parts.hostname}]" if ":" in parts.hostname else parts.hostname
        return cls(f"{scheme}://{host}{'' if port is None else f':{port}'}{parts.path.rstrip('/')}")

    @property
    def is_encrypted(self) -> bool:
        return self.url.startswith("wss://")

    def path(self, name: str) -> str:
        """Return the URL of "operator", "media" or "pair"."""
        return f"{self.url}{DIAL}{name}"
