"""Messages as MessagePack maps, frames and event references, as docs/robot-link.md says; nothing of Lockstep's."""

import re
from collections.abc import Callable
from typing import Any

import msgpack

__all__ = ["LARGEST", "Malformed", "Message", "event_after", "event_gap", "frame", "read"]

Message = dict[str, Any]
Check = Callable[[Any], bool]

LAST_EVENT = 2**31 - 1
LARGEST = 2**53 - 1  # of numbers and nonces


class Malformed(Exception):
    """These bytes are no message of the protocol."""


# The event reference


def event_after(event: int) -> int:
    return 1 if event == LAST_EVENT else event + 1


def event_gap(newer: int, older: int) -> int:
    return ((newer - older + 2**30) % 2**31) - 2**30


# Types


def whole(least: int = -(2**63), most: int = 2**63 - 1) -> Check:
    return lambda value: type(value) is int and least <= value <= most


def text(most: int = 500) -> Check:
    return lambda value: isinstance(value, str) and len(value) <= most


def written_in(pattern: str) -> Check:
    return lambda value: isinstance(value, str) and re.fullmatch(pattern, value) is not None


def raw(value: Any) -> bool:
    return isinstance(value, bytes) and len(value) <= 64


def number(value: Any) -> bool:
    return type(value) in (int, float)


def values(value: Any) -> bool:
    return isinstance(value, list) and len(value) <= 256 and all(each is None or number(each) for each in value)


def parameters(value: Any) -> bool:
    return (
        isinstance(value, dict)
        and len(value) <= 8
        and all(type(each) in (bool, int, float) or text(200)(each) for each in value.values())
    )


def array(value: Any) -> bool:
    return isinstance(value, list)


def map_or_nil(value: Any) -> bool:
    return value is None or isinstance(value, dict)


event = whole(1, LAST_EVENT)
up_to_largest = whole(0, LARGEST)

# The fields of each kind that a client may send: those that must be there, and those with a default.
REQUIRED: dict[str, dict[str, Check]] = {
    "hello": {"role": text()},
    "command": {"event": event, "issue": whole(1, LARGEST), "values": values},
    "rest": {"event": event},
    "stop": {},
    "reset": {},
    "act": {"id": written_in("[0-9A-Za-z_-]{1,64}"), "name": written_in(r"(?s:.{1,200})")},
    "action_cancel": {},
    "encode": {"streams": array},
    "ping": {"id": whole()},
    "pong": {"id": whole()},
    "goodbye": {"error": text()},
}
OPTIONAL: dict[str, dict[str, tuple[Check, Any]]] = {
    "hello": {
        "version": (whole(), 2),
        "name": (text(), ""),
        "epoch": (text(), ""),
        "description": (map_or_nil, None),
        "nonce": (raw, b""),
        "proof": (raw, b""),
    },
    "command": {
        "nonce": (up_to_largest, 0),
        "action": (written_in("[0-9A-Za-z_-]{0,64}"), ""),
        "speed": (number, 1.0),
    },
    "stop": {"by": (text(), ""), "reason": (text(), ""), "press": (text(64), "")},
    "reset": {"by": (text(), ""), "number": (up_to_largest, 0)},
    "act": {"parameters": (parameters, {}), "nonce": (up_to_largest, 0), "by": (text(), "")},
    "action_cancel": {"id": (written_in("[0-9A-Za-z_-]{0,64}"), "")},
    "goodbye": {"detail": (text(), "")},
}
# A bridge alone sends these: from a client they are no unknown kinds, and not permitted.
BRIDGES_OWN = {
    *("challenge", "feedback", "refusal", "event", "media", "stop_taken", "action", "status", "navigation", "map")
}


def read(payload: bytes) -> Message:
    """Return the message in a frame, with the defaults of the fields that it leaves out.

    Raises:
        Malformed: it is none.
    """
    try:
        found = msgpack.unpackb(payload)
    except (ValueError, msgpack.UnpackException) as error:
        raise Malformed(str(error)) from error
    kind = found.get("type") if isinstance(found, dict) else None
    if not isinstance(kind, str):
        raise Malformed("no map with a type")
    if kind in BRIDGES_OWN:
        return {"type": kind}
    if kind not in REQUIRED:
        raise Malformed(f"the kind {kind!r} is not known")
    message: Message = {"type": kind}
    for name, check in REQUIRED[kind].items():
        if name not in found or not check(found[name]):
            raise Malformed(f"{kind}: {name}")
        message[name] = found[name]
    for name, (check, default) in OPTIONAL.get(kind, {}).items():
        message[name] = found.get(name, default)
        if not check(message[name]):
            raise Malformed(f"{kind}: {name}")
    return message


def frame(message: Message) -> bytes:
    payload: bytes = msgpack.packb(message)
    return len(payload).to_bytes(4, "big") + payload
