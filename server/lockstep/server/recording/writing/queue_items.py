"""The items that the console hands to the recording thread, which encodes them. Times in ns since 1970."""

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import msgspec

from lockstep.protocol.description import RobotDescription
from lockstep.protocol.messages import Feedback
from lockstep.server.recording.format.drivers import NOBODY, EventDriver
from lockstep.server.recording.format.foxglove import (
    camera_message,
    command_messages,
    feedback_messages,
    log_message,
    robot_messages,
    sound_message,
)
from lockstep.server.recording.format.map_messages import map_messages
from lockstep.server.recording.format.records import (
    CommandRecord,
    FeedbackRecord,
    MapRecord,
    NavigationRecord,
    OwnRecord,
    RobotRecord,
)
from lockstep.server.recording.format.records_in_words import in_words
from lockstep.server.recording.format.topics import LOG, OWN_TOPICS, PICTURE_FORMATS, SOUND_FORMATS, media_topic
from lockstep.server.recording.writing.writer import Entry

__all__ = ["FeedbackItem", "Item", "MediaItem", "OwnItem", "RobotItem", "entries_of", "feedback_record"]


class RobotItem(NamedTuple):
    """The robot, or the state of its link. A new epoch begins a new file."""

    arrived: int
    record: RobotRecord
    codecs: Mapping[str, str]  # by stream


class FeedbackItem(NamedTuple):
    arrived: int
    captured: int
    epoch: str
    feedback: Feedback
    driver: EventDriver = NOBODY


class MediaItem(NamedTuple):
    arrived: int
    captured: int
    epoch: str
    stream: str
    codec: str  # "H264", "VP8", "opus" or "PCMU"
    stamp: int
    keyframe: bool
    data: bytes


class OwnItem(NamedTuple):
    arrived: int
    record: OwnRecord


Item = RobotItem | FeedbackItem | MediaItem | OwnItem


def entries_of(item: Item, description: RobotDescription) -> Iterator[Entry]:
    """Yield the records that `item` becomes."""
    match item:
        case MediaItem():
            yield _media(item)
        case FeedbackItem(arrived, captured):
            record = feedback_record(item)
            yield _own(record, arrived, captured)
            yield from feedback_messages(description, record, arrived, captured)
        case RobotItem(arrived=arrived, record=record) | OwnItem(arrived=arrived, record=record):
            yield _own(record, arrived, arrived)
            words = in_words(record)
            if words:
                data = log_message(arrived, words.text, warning=words.warning)
                yield Entry(LOG, record.event, arrived, arrived, data)
            if isinstance(record, CommandRecord):
                yield from command_messages(description, record, arrived, arrived)
            if isinstance(record, MapRecord | NavigationRecord):
                yield from map_messages(description, record, arrived)
            if isinstance(item, RobotItem):
                yield from robot_messages(description, record.event, arrived)


def feedback_record(item: FeedbackItem) -> FeedbackRecord:
    """Return the record of a feedback, with who drove its event."""
    driver = item.driver
    return FeedbackRecord(
        epoch=item.epoch,
        **msgspec.structs.asdict(item.feedback),
        driver=driver.name,
        driver_kind=driver.kind,
        intervention=driver.intervention,
    )


def _own(record: OwnRecord, arrived: int, captured: int) -> Entry:
    topic = OWN_TOPICS[type(record)]
    return Entry(topic, record.event, arrived, captured, msgspec.json.encode(record), record=record)


def _media(item: MediaItem) -> Entry:
    topic = media_topic(item.stream, item.codec)
    picture_format = PICTURE_FORMATS.get(item.codec)
    if picture_format is not None:
        data = camera_message(item.stream, item.captured, item.data, picture_format)
        return Entry(topic, item.stamp, item.arrived, item.captured, data, keyframe=item.keyframe)
    data = sound_message(SOUND_FORMATS[item.codec], item.captured, item.data)
    return Entry(topic, item.stamp, item.arrived, item.captured, data)
