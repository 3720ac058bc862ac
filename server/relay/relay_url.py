"""Where a relay is: `janus:ws://host:8188/ROOM`, `livekit:wss://host?room=NAME`."""

import re
from typing import Literal, NamedTuple
from urllib.parse import SplitResult, parse_qs, urlsplit

__all__ = ["EngineName", "RelayUrl", "parse_relay_url"]

EngineName = Literal["janus", "livekit"]

MOST_ROOM = 2**53  # what a page can count to
ROOM_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}")


class RelayUrl(NamedTuple):
    engine: EngineName
    address: str  # WebSocket URL without room and secrets: safe to log and to hand out
    room: str  # Janus: a number

    @property
    def host(self) -> str:
        return urlsplit(self.address).hostname or ""


def parse_relay_url(text: str) -> RelayUrl:
    """Raises ValueError, which says what is wrong and repeats nothing that could be a secret."""
    engine, _, rest = text.partition(":")
    if engine not in ("janus", "livekit"):
        raise ValueError("a relay begins with janus: or livekit:")
    wanted = "janus:ws(s)://host[:port]/ROOM" if engine == "janus" else "livekit:ws(s)://host[:port]?room=NAME"
    parts = urlsplit(rest)
    if parts.username or parts.password:
        raise ValueError(f"no name and password in {wanted}: secrets have settings of their own")
    if parts.scheme not in ("ws", "wss") or not parts.hostname or parts.fragment:
        raise ValueError(f"{text.partition('?')[0]!r} is not {wanted}")
    return _janus(parts, wanted) if engine == "janus" else _livekit(parts, wanted)


def _janus(parts: SplitResult, wanted: str) -> RelayUrl:
    path, _, room = parts.path.rpartition("/")
    if not room.isdecimal() or parts.query or int(room) >= MOST_ROOM:
        raise ValueError(f"a number for a room, and nothing behind it: {wanted}")
    return RelayUrl("janus", f"{parts.scheme}://{parts.netloc}{path}", str(int(room)))


def _livekit(parts: SplitResult, wanted: str) -> RelayUrl:
    query = parse_qs(parts.query, keep_blank_values=True)
    rooms = query.pop("room", [])
    if query:
        raise ValueError(f"nothing but the room's name: {wanted}")
    if len(rooms) != 1 or not ROOM_NAME.fullmatch(rooms[0]):
        raise ValueError(f"a room's name has letters, digits, dots, dashes, at most 64: {wanted}")
    return RelayUrl("livekit", f"{parts.scheme}://{parts.netloc}{parts.path.rstrip('/')}", rooms[0])
