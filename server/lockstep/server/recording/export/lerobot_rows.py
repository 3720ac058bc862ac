"""The rows of a LeRobot dataset: which events of a recording become rows, with which state, action and pictures.

The rule (docs/episodes.md, "How rows are aligned"): a row is an event `s` of a kept episode. Its state is feedback
`s`, its action command `s+1`, which answered it, and its picture of each camera the first one stamped `s`, or else the
newest older one of the same episode. A row is left out where command `s+1` is not known or a picture is more than the
tolerance older.
"""

from collections.abc import Iterable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

from lockstep.protocol.description import RobotDescription
from lockstep.protocol.episodes import EpisodeOutcome
from lockstep.protocol.serial import event_after, event_gap, is_newer
from lockstep.server.recording.errors import RecordingDamaged
from lockstep.server.recording.format.episodes import EpisodeBook, EpisodeEntry
from lockstep.server.recording.format.info import RecordingInfo
from lockstep.server.recording.format.payload import own_record_of
from lockstep.server.recording.format.records import CommandRecord, Degraded, EpisodeRecord, FeedbackRecord, SeatRecord
from lockstep.server.recording.format.topics import OWN_TOPICS
from lockstep.server.recording.reading.event_rows import WRENCH
from lockstep.server.recording.reading.reader import Record, RecordingReader

__all__ = [
    "EpisodeRows",
    "Frame",
    "Stretch",
    "aligned_stamps",
    "check_same_robot",
    "episodes_of",
    "picture_records",
    "rows_of",
    "state_names",
    "state_of",
    "stretches_of",
]

DEGRADED = OWN_TOPICS[Degraded]
READ = {OWN_TOPICS[kind] for kind in (FeedbackRecord, CommandRecord, SeatRecord)}


class Frame(NamedTuple):
    """One event: the state of the robot, and the command that answered it."""

    feedback: FeedbackRecord
    action: list[float]
    driver: str  # name of the seat's holder


class Stretch(NamedTuple):
    """A part of a recording that becomes one episode of the dataset."""

    path: Path
    info: RecordingInfo
    episode: str  # its id; "" where the recording has no episodes, and is one as a whole
    first_event: int
    last_event: int
    task: str
    outcome: EpisodeOutcome


class EpisodeRows(NamedTuple):
    """The rows of one episode.

    Attributes:
        stamps: of each camera's picture of each row, by topic
        left_out: rows that were left out because a picture was too old
    """

    stretch: Stretch
    frames: list[Frame]
    stamps: dict[str, list[int]]
    left_out: int


def episodes_of(reader: RecordingReader) -> list[EpisodeEntry]:
    """Return the episodes of a recording from its records, since nothing checks an index. Raises RecordingError."""
    book = EpisodeBook()
    for record in reader.records(topics={OWN_TOPICS[EpisodeRecord]}):
        own = own_record_of(record.schema, record.data)
        if isinstance(own, EpisodeRecord):
            book.take(own, record.arrived // 1000)
    return book.entries()


def stretches_of(reader: RecordingReader, episodes: list[EpisodeEntry], task: str) -> list[Stretch]:
    """Return what becomes an episode: the kept ones; the whole of a recording in which none was ever begun."""
    if not episodes:
        task = task or reader.info.name or "teleoperation"
        first, last = reader.index.first_event, reader.index.last_event
        return [Stretch(reader.path, reader.info, "", first, last, task, "")]
    return [
        Stretch(reader.path, reader.info, each.id, each.first_event, each.last_event, each.task, each.outcome)
        for each in episodes
        if each.state == "kept"
    ]


def rows_of(
    reader: RecordingReader, description: RobotDescription, stretches: list[Stretch], cameras: list[str], tolerance: int
) -> list[EpisodeRows]:
    """Return the rows of each stretch. Raises RecordingError."""
    frames = list(_frames(reader, description))
    found = []
    for stretch in stretches:
        mine = [frame for frame in frames if _is_within(frame.feedback.event, stretch)]
        stamps = {
            topic: dict(_stamps(reader, topic, stretch, [frame.feedback.event for frame in mine])) for topic in cameras
        }
        kept = [
            frame
            for frame in mine
            if all(_fits(frame.feedback.event, stamps[topic].get(frame.feedback.event), tolerance) for topic in cameras)
        ]
        of_kept = {topic: [stamps[topic][frame.feedback.event] for frame in kept] for topic in cameras}
        found.append(EpisodeRows(stretch, kept, of_kept, len(mine) - len(kept)))
    return found


def picture_records(reader: RecordingReader, topic: str, stretch: Stretch) -> Iterator[Record]:
    """Yield the pictures that are needed to decode those of the stretch, from a keyframe on.

    Where the recorder has left something out, a picture may be missing that later ones build on: the next one that
    counts is a keyframe.
    """
    begun = False
    for record in reader.records(stretch.first_event, stretch.last_event, {topic, DEGRADED}, decodable=True):
        if record.topic == DEGRADED:
            begun = False
            continue
        picture = record.picture
        if picture is not None and (begun or picture.keyframe):
            begun = True
            yield record


def aligned_stamps(stamps: Iterable[int], events: Iterable[int]) -> Iterator[tuple[int, int | None]]:
    """Yield for each event the place of its picture in `stamps`, and its stamp; -1 and None where there is none yet.

    It is the first picture with the event's stamp, or the newest older one. Both come in the order of the recording.
    """
    source = enumerate(stamps)
    place, current = -1, None
    upcoming = next(source, None)
    for event in events:
        while upcoming is not None and not is_newer(upcoming[1], event):
            if current == event:
                break
            (place, current), upcoming = upcoming, next(source, None)
        yield place, current


def state_names(description: RobotDescription) -> list[str]:
    names = [f"axis.{axis.name}" for axis in description.axes]
    names += [f"joint.{joint.name}" for joint in description.joints]
    names += [f"wrench.{name}" for name in WRENCH if description.wrench is not None]
    return names + [f"range.{number}" for number in range(description.ranges.count if description.ranges else 0)]


def state_of(feedback: FeedbackRecord) -> list[float]:
    return [*feedback.axes, *feedback.joints, *feedback.wrench, *feedback.ranges]


def _is_within(event: int, stretch: Stretch) -> bool:
    """Return whether the event, and the one that answers it, are of the stretch."""
    return not is_newer(stretch.first_event, event) and is_newer(stretch.last_event, event)


def _fits(event: int, stamp: int | None, tolerance: int) -> bool:
    return stamp is not None and 0 <= event_gap(event, stamp) <= tolerance


def _stamps(reader: RecordingReader, topic: str, stretch: Stretch, events: list[int]) -> Iterator[tuple[int, int]]:
    """Yield event and stamp of its picture, where that is of this stretch."""
    stamps = [record.event for record in picture_records(reader, topic, stretch)]
    for event, (_, stamp) in zip(events, aligned_stamps(stamps, events), strict=True):
        if stamp is not None and not is_newer(stretch.first_event, stamp):
            yield event, stamp


def _frames(reader: RecordingReader, description: RobotDescription) -> Iterator[Frame]:
    """Yield a frame for each event, but for those without an answer, as the last one, or with an incomplete state."""
    length = len(state_names(description))
    for (row, driver, _), (following, _, command) in pairwise(_events(reader)):
        if command is None or following.event != event_after(row.event):
            continue  # the recorder has left something out
        action = _action(command, following)
        if action is not None and len(state_of(row)) == length:
            yield Frame(row, action, driver)


def _events(reader: RecordingReader) -> Iterator[tuple[FeedbackRecord, str, CommandRecord | None]]:
    """Yield the first feedback of each event, who held the seat, and the command that became the event."""
    event, driver = 0, ""
    command: CommandRecord | None = None
    for record in reader.records(topics=READ):
        match own_record_of(record.schema, record.data):
            case CommandRecord(outcome="forwarded") as forwarded:
                command = forwarded
            case SeatRecord(name=name):
                driver = name
            case FeedbackRecord() as feedback if feedback.event != event:
                event = feedback.event
                became = command if command is not None and command.event == event else None
                yield feedback, driver, became


def _action(command: CommandRecord, answer: FeedbackRecord) -> list[float] | None:
    """Return the values of a command, and for a goal axis that is to stay its goal then; None if that is not known."""
    stays = answer.goals or [None] * len(command.values)
    values = [goal if value is None else value for value, goal in zip(command.values, stays, strict=False)]
    known = [value for value in values if value is not None]
    return known if len(known) == len(command.values) else None


def check_same_robot(first: RobotDescription, other: RobotDescription) -> None:
    """Raise RecordingDamaged unless recordings of both fit into one dataset."""
    names = [axis.name for axis in first.axes], state_names(first), first.name
    if names != ([axis.name for axis in other.axes], state_names(other), other.name):
        raise RecordingDamaged(
            f"recordings of different robots do not fit into one dataset: {first.name}, {other.name}"
        )
