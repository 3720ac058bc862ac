"""Parses the address of a relay: `janus:ws://host:8188/ROOM`."""

from typing import NamedTuple
from urllib.parse import urlsplit

__all__ = ["RelayUrl", "parse_relay_url"]

WANTED = "janus:ws(s)://host[:port]/ROOM"
MOST_ROOM = 2**53  # JavaScript counts integers up to this


class RelayUrl(NamedTuple):
    address: str  # WebSocket URL without room and secrets: safe to log and to hand out
    room: int

    @property
    def host(self) -> str:
        return urlsplit(self.address).hostname or ""


def parse_relay_url(text: str) -> RelayUrl:
    """Parse a relay's address. Raises ValueError with the reason, and with nothing that could be a secret."""
    engine, _, rest = text.partition(":")
    if engine != "janus":
        raise ValueError(f"a relay must be a Janus server: {WANTED}")
    parts = urlsplit(rest)
    if parts.username or parts.password:
        raise ValueError(f"the address may hold no name and password: {WANTED}")
    if parts.scheme not in ("ws", "wss") or not parts.hostname or parts.fragment:
        raise ValueError(f"{text.partition('?')[0]!r} is not {WANTED}")
    path, _, room = parts.path.rpartition("/")
    if not room.isdecimal() or parts.query or int(room) >= MOST_ROOM:
        raise ValueError(f"the address must end with the number of a room: {WANTED}")
    return RelayUrl(f"{parts.scheme}://{parts.netloc}{path}", int(room))
