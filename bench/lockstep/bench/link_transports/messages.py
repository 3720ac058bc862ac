"""The messages of the measurement: their sizes and rates are those of a robot that encodes beside the camera."""

import struct
import time
from typing import NamedTuple

__all__ = [
    "COMMAND_BYTES",
    "EVENT_SECONDS",
    "FEEDBACK_BYTES",
    "HEAD",
    "Message",
    "framed",
    "picture_bytes",
    "take_frames",
]

EVENT_SECONDS = 0.04  # between two commands, if the feedback of the first has come
COMMAND_BYTES, FEEDBACK_BYTES = 200, 500
PICTURES_PER_SECOND = 25
KEYFRAME_EVERY = 100  # pictures
BITS_PER_SECOND = 500_000
KEYFRAME_SHARE = 8  # times the size of another picture
HEAD = struct.Struct(">IId")  # length of all, number, time of sending (monotonic, of this machine)


class Message(NamedTuple):
    number: int
    sent: float
    size: int

    def data(self) -> bytes:
        return HEAD.pack(self.size, self.number, self.sent) + bytes(self.size - HEAD.size)


def framed(number: int, size: int, sent: float | None = None) -> bytes:
    return Message(number, time.monotonic() if sent is None else sent, size).data()


def take_frames(waiting: bytearray) -> list[Message]:
    """Take the whole messages from the front of `waiting`."""
    found = []
    while len(waiting) >= HEAD.size:
        size, number, sent = HEAD.unpack_from(waiting)
        if len(waiting) < size:
            break
        found.append(Message(number, sent, size))
        del waiting[:size]
    return found


def picture_bytes(number: int) -> int:
    """Return the size of a picture: H.264 of about half a megabit a second, a keyframe every 4 s."""
    group = BITS_PER_SECOND / 8 / PICTURES_PER_SECOND * KEYFRAME_EVERY
    other = group / (KEYFRAME_EVERY - 1 + KEYFRAME_SHARE)
    return round(other * (KEYFRAME_SHARE if number % KEYFRAME_EVERY == 0 else 1))
