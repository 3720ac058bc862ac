"""Where a relay is: `janus:ws://host:8188/ROOM`."""

from typing import NamedTuple
from urllib.parse import urlsplit

__all__ = ["RelayUrl", "parse_relay_url"]

MOST_ROOM = 2**53  # what a page can count to


class RelayUrl(NamedTuple):
    address: str  # WebSocket URL without room and secrets: safe to log and to hand out
    room: int

    @property
    def host(self) -> str:
        return urlsplit(self.address).hostname or ""


def parse_relay_url(text: str) -> RelayUrl:
    """Raises ValueError, which says what is wrong."""
    engine, _, rest = text.partition(":")
    parts = urlsplit(rest)
    if engine == "livekit":
        raise ValueError("LiveKit is not supported yet; janus:ws://host:8188/ROOM is")
    if engine != "janus":
        raise ValueError(f"{text!r} does not begin with janus:")
    if parts.scheme not in ("ws", "wss") or not parts.hostname or parts.username or parts.password:
        raise ValueError(f"{text!r} is not janus:ws(s)://host[:port]/ROOM")
    path, _, room = parts.path.rpartition("/")
    if not room.isdecimal() or parts.query or parts.fragment or int(room) >= MOST_ROOM:
        raise ValueError(f"{text!r} is not janus:ws(s)://host[:port]/ROOM with a number for a room")
    return RelayUrl(f"{parts.scheme}://{parts.netloc}{path}", int(room))
