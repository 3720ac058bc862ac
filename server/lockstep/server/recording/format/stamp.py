"""The topic that names the event of each picture and sound: Foxglove's own messages have no field for it."""

import json

import msgspec

from lockstep.server.recording.format.topics import Topic, stream_of
from lockstep.server.recording.writing.writer import Entry

__all__ = ["STAMP_TOPIC", "stamp_message"]

SECOND = 1_000_000_000


class Time(msgspec.Struct, frozen=True):
    sec: int  # s since 1970
    nsec: int


class Stamp(msgspec.Struct, frozen=True, kw_only=True):
    """The event reference of the picture or sound of `stream` with the same `timestamp`."""

    timestamp: Time
    epoch: str
    event: int
    stream: str


def _schema() -> bytes:
    (_,), components = msgspec.json.schema_components([Stamp], ref_template="#/$defs/{name}")
    return json.dumps({**components.pop("Stamp"), "$defs": components}).encode()


STAMP_TOPIC = Topic("/lockstep/stamp", "lockstep.Stamp", "jsonschema", _schema(), "json")


def stamp_message(entry: Entry, epoch: str) -> bytes:
    """Return the Stamp of a record of a camera or a microphone."""
    captured = Time(entry.captured // SECOND, entry.captured % SECOND)
    stamp = Stamp(timestamp=captured, epoch=epoch, event=entry.event, stream=stream_of(entry.topic))
    return msgspec.json.encode(stamp)
