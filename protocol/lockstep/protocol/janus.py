"""Requests to a Janus over its WebSocket, and its answers: JSON text, no I/O.

A request carries a `transaction` that its answer repeats. Requests to a plugin are acknowledged at once and answered
by an event with the same transaction. It stands here because the console publishes and the headless client watches.
"""

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from lockstep.protocol.errors import MessageError

__all__ = ["JANUS_PROTOCOL", "VIDEO_ROOM", "Heard", "complete_description", "janus_request", "parse_janus"]

JANUS_PROTOCOL = "janus-protocol"  # WebSocket subprotocol
VIDEO_ROOM = "janus.plugin.videoroom"
SIZE_LINE = "a=max-message-size:65536"
H264_FORMAT = "profile-level-id=42e01f;packetization-mode=1"
RTPMAP_H264 = re.compile(r"a=rtpmap:(\d+) H264/")
Kind = Literal["ack", "success", "event", "error", "ended", "other"]
ENDED = ("hangup", "detached", "timeout")  # of a handle, or of the whole session


@dataclass(frozen=True)
class Heard:
    """One message of Janus."""

    kind: Kind
    transaction: str  # "" when it answers nothing
    handle: int  # 0: about the session
    data: dict[str, Any]  # the plugin's data, or a success' data
    jsep: dict[str, Any] | None  # a description that came with it
    detail: str  # of an error, or why it ended
    code: int  # of an error


def janus_request(kind: str, transaction: str, **fields: object) -> str:
    """`fields` that are None are left out."""
    given = {name: value for name, value in fields.items() if value is not None}
    return json.dumps({"janus": kind, "transaction": transaction, **given})


def parse_janus(text: str | bytes) -> Heard:
    """Raises MessageError when it is not a message of Janus."""
    try:
        message = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise MessageError("not JSON") from error
    if not isinstance(message, dict) or not isinstance(message.get("janus"), str):
        raise MessageError("not a message of Janus")
    said: str = message["janus"]
    plugin = _mapping(message.get("plugindata"))
    data = dict(_mapping(plugin.get("data")) if plugin else _mapping(message.get("data")))
    jsep = message.get("jsep")
    kind, detail, code = _kind(said, data), str(message.get("reason", "")), 0
    if said == "error":
        problem = _mapping(message.get("error"))
        detail, code = str(problem.get("reason", "")), _number(problem.get("code"))
    elif kind == "error":
        detail, code = str(data.get("error", "")), _number(data.get("error_code"))
    return Heard(
        kind=kind,
        transaction=str(message.get("transaction", "")),
        handle=_number(message.get("sender")),
        data=data,
        jsep=dict(jsep) if isinstance(jsep, dict) and isinstance(jsep.get("sdp"), str) else None,
        detail=(detail or said)[:200],
        code=code,
    )


def _kind(said: str, data: Mapping[str, Any]) -> Kind:
    if said == "error" or "error_code" in data:
        return "error"
    if said in ENDED:
        return "ended"
    known: dict[str, Kind] = {"ack": "ack", "success": "success", "event": "event"}
    return known.get(said, "other")


def _mapping(value: object) -> Mapping[str, Any]:
    return value if isinstance(value, dict) else {}


def _number(value: object) -> int:
    return value if isinstance(value, int) else 0


def complete_description(sdp: str) -> str:
    """What Janus 1.1 leaves out: the largest data channel message (RFC 8841 6.1), and H.264's format when the feed
    came from another Janus. Without a format, H.264 means packetization-mode 0, which nobody sends (RFC 6184 8.1)."""
    lines: list[str] = []
    for line in sdp.splitlines():
        lines.append(line)
        h264 = RTPMAP_H264.match(line)
        if h264 and f"a=fmtp:{h264[1]} " not in sdp:
            lines.append(f"a=fmtp:{h264[1]} {H264_FORMAT}")
        elif line.startswith("a=sctp-port:") and "a=max-message-size:" not in sdp:
            lines.append(SIZE_LINE)
    return "\r\n".join(lines) + "\r\n"
