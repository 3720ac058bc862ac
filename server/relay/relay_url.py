"""Where a relay is: `janus:ws://host:8188/ROOM` or `livekit:wss://host?room=NAME`."""

from typing import Literal, NamedTuple
from urllib.parse import parse_qs, urlsplit

__all__ = ["RelayUrl", "parse_relay_url"]


class RelayUrl(NamedTuple):
    engine: Literal["janus", "livekit"]
    address: str  # WebSocket URL without room and secrets: safe to log and to hand out
    room: str

    @property
    def host(self) -> str:
        return urlsplit(self.address).hostname or ""

    @property
    def origin(self) -> str:
        """For a content security policy: scheme, host and port."""
        parts = urlsplit(self.address)
        return f"{parts.scheme}://{parts.netloc}"


def parse_relay_url(text: str) -> RelayUrl:
    """Raises ValueError, which says what is wrong."""
    engine, _, rest = text.partition(":")
    parts = urlsplit(rest)
    if engine not in ("janus", "livekit"):
        raise ValueError(f"{text!r} begins with neither janus: nor livekit:")
    if parts.scheme not in ("ws", "wss") or not parts.hostname or parts.username or parts.password:
        raise ValueError(f"{text!r} is not {engine}:ws(s)://host[:port]/…")
    if engine == "janus":
        path, _, room = parts.path.rpartition("/")
        if not room.isdecimal() or parts.query or parts.fragment or int(room) >= 2**53:
            raise ValueError(f"{text!r} is not janus:ws(s)://host[:port]/ROOM with a number for a room")
        return RelayUrl("janus", f"{parts.scheme}://{parts.netloc}{path}", str(int(room)))
    rooms = parse_qs(parts.query).get("room", [])
    if len(rooms) != 1:
        raise ValueError(f"{text!r} is not livekit:ws(s)://host[:port]?room=NAME")
    return RelayUrl("livekit", f"{parts.scheme}://{parts.netloc}{parts.path}", rooms[0])
