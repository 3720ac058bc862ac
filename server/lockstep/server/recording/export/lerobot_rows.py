"""The rows of a LeRobot dataset: which events of a recording become rows, with which state, action and pictures.

The rule (docs/episodes.md, "How rows are aligned"): a row is an event `s` of a kept episode. Its state is feedback
`s`, its action command `s+1`, which answered it, and its picture of each camera the first one stamped `s`, or else the
newest older one of the same episode. An event is in no row where one of its values or command `s+1` is not known, or a
picture is more than the tolerance older. With a rate of its own, `lerobot_sampling` says which events the rows are.
"""

from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from statistics import median
from typing import NamedTuple

from lockstep.protocol.description import RobotDescription
from lockstep.protocol.episodes import EpisodeOutcome
from lockstep.protocol.serial import event_after, event_gap, is_newer
from lockstep.server.recording.episodes.edit_rules import EditedEpisode, apply_edits
from lockstep.server.recording.episodes.edits import read_edits
from lockstep.server.recording.errors import RecordingDamaged
from lockstep.server.recording.export.episode_commands import COMMAND_TOPICS, CommandTally, EpisodeCommands
from lockstep.server.recording.export.lerobot_layout import DatasetLayout
from lockstep.server.recording.export.lerobot_sampling import sampled
from lockstep.server.recording.format.drivers import NOBODY, EventDriver
from lockstep.server.recording.format.episodes import EpisodeBook, EpisodeEntry
from lockstep.server.recording.format.info import RecordingInfo
from lockstep.server.recording.format.payload import own_record_of
from lockstep.server.recording.format.records import CommandRecord, Degraded, EpisodeRecord, FeedbackRecord
from lockstep.server.recording.format.topics import OWN_TOPICS
from lockstep.server.recording.reading.drivers import RecordedDrivers
from lockstep.server.recording.reading.reader import Record, RecordingReader

__all__ = [
    "EpisodeRows",
    "Frame",
    "Stretch",
    "aligned_stamps",
    "check_same_robot",
    "episodes_now",
    "episodes_of",
    "picture_records",
    "rate_of",
    "rows_of",
    "stretches_of",
]

DEGRADED = OWN_TOPICS[Degraded]


class Frame(NamedTuple):
    """One event: the state of the robot, and the command that answered it."""

    event: int
    time: float  # s, the bridge's clock
    state: dict[str, list[float]]  # by column
    action: list[float]
    driver: EventDriver  # of the action: of the event that the command became


class Stretch(NamedTuple):
    """A part of a recording that becomes one episode of the dataset."""

    path: Path
    info: RecordingInfo
    episode: str  # its id; "" where the recording has no episodes, and is one as a whole
    first_event: int
    last_event: int
    task: str
    outcome: EpisodeOutcome
    ended: int  # µs since 1970; pictures that came later are not of it, so that nobody has to wait for them
    recorded: tuple[str, ...] = ()  # ids of the recorded episodes that it was made of
    marks: tuple[tuple[int, str], ...] = ()  # event, words
    drivers: tuple[str, ...] = ()  # names of those who drove in it
    problems: tuple[str, ...] = ()  # that the live checks have seen


class EpisodeRows(NamedTuple):
    """The rows of one episode.

    Attributes:
        frames: an event may be in several rows when the dataset has a rate of its own
        stamps: of each camera's picture of each row, by topic
        ages: s, of the row's event at the row's moment; 0 where each event is a row
        left_out: events that are in no row because a picture was too old
        rate: Hz, by the median interval of the events
        commands: of the episode's events, also of those that are in no row
    """

    stretch: Stretch
    frames: list[Frame]
    stamps: dict[str, list[int]]
    ages: list[float]
    left_out: int
    rate: float
    commands: EpisodeCommands


def episodes_of(reader: RecordingReader) -> list[EpisodeEntry]:
    """Return the episodes of a recording from its records, since nothing checks an index. Raises RecordingError."""
    book = EpisodeBook()
    for record in reader.records(topics={OWN_TOPICS[EpisodeRecord]}):
        own = own_record_of(record.schema, record.data)
        if isinstance(own, EpisodeRecord):
            book.take(own, record.arrived // 1000)
    return book.entries()


def episodes_now(reader: RecordingReader) -> list[EditedEpisode]:
    """Return the episodes of a recording with all changes to them. Raises RecordingError."""
    return apply_edits(episodes_of(reader), read_edits(reader.path)).episodes


def stretches_of(reader: RecordingReader, episodes: Sequence[EditedEpisode], whole: str | None) -> list[Stretch]:
    """Return what becomes an episode of the dataset: the kept ones, or the file as a whole.

    Args:
        episodes: of the recording, with all changes
        whole: the task, if the file is to be one episode where it has none; "": named after the recording; None: it is
            not to be. `whole_recordings` says which files may be one.
    """
    if not episodes and whole is not None:
        return [_whole_stretch(reader, whole)]
    return [_stretch(reader, each) for each in episodes if each.entry.state == "kept"]


def _stretch(reader: RecordingReader, episode: EditedEpisode) -> Stretch:
    entry = episode.entry
    return Stretch(
        reader.path,
        reader.info,
        entry.id,
        entry.first_event,
        entry.last_event,
        entry.task,
        entry.outcome,
        entry.ended,
        episode.recorded,
        tuple(mark for mark in entry.marks if _is_marked_in(mark[0], entry)),
        tuple(entry.drivers),
        tuple(entry.problems),
    )


def _is_marked_in(event: int, entry: EpisodeEntry) -> bool:
    return event_gap(event, entry.first_event) >= 0 and event_gap(entry.last_event, event) >= 0


def _whole_stretch(reader: RecordingReader, task: str) -> Stretch:
    task = task or reader.info.name or "teleoperation"
    first, last = reader.index.first_event, reader.index.last_event
    return Stretch(reader.path, reader.info, "", first, last, task, "", reader.index.ended)


def rows_of(
    reader: RecordingReader,
    layout: DatasetLayout,
    stretches: list[Stretch],
    cameras: list[str],
    tolerance: int,
    rate: int | None = None,
) -> list[EpisodeRows]:
    """Return the rows of each stretch. Raises RecordingError.

    Args:
        rate: Hz, of the rows; None: each event is a row
    """
    return [_episode(reader, layout, stretch, cameras, tolerance, rate) for stretch in stretches]


def _episode(
    reader: RecordingReader,
    layout: DatasetLayout,
    stretch: Stretch,
    cameras: list[str],
    tolerance: int,
    rate: int | None,
) -> EpisodeRows:
    tally = CommandTally(stretch.first_event, stretch.last_event, stretch.recorded)
    mine = [frame for frame in _frames(reader, layout, stretch, tally) if _is_within(frame.event, stretch)]
    events = [frame.event for frame in mine]
    stamps = {topic: dict(_stamps(reader, topic, stretch, events)) for topic in cameras}
    kept = [
        frame
        for frame in mine
        if all(_fits(frame.event, stamps[topic].get(frame.event), tolerance) for topic in cameras)
    ]
    own_rate = rate_of([frame.time for frame in kept])
    left_out = len(mine) - len(kept)
    if rate is None:
        ages = [0.0] * len(kept)
    else:
        samples = sampled([frame.time for frame in kept], rate)
        kept, ages = [kept[sample.place] for sample in samples], [sample.age for sample in samples]
    of_kept = {topic: [stamps[topic][frame.event] for frame in kept] for topic in cameras}
    return EpisodeRows(stretch, kept, of_kept, ages, left_out, own_rate, tally.result())


def rate_of(times: Sequence[float]) -> float:
    """Return the events per second by their median interval, so that pauses do not count; 0 where there is none."""
    intervals = [later - earlier for earlier, later in pairwise(times) if later > earlier]
    return 1 / median(intervals) if intervals else 0.0


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
        if picture is not None and (begun or picture.keyframe) and record.arrived // 1000 <= stretch.ended:
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


def _frames(reader: RecordingReader, layout: DatasetLayout, stretch: Stretch, tally: CommandTally) -> Iterator[Frame]:
    """Yield a frame for each event, but for those without an answer, as the last one, or with an incomplete state."""
    events = list(_events(reader, stretch, tally))
    for place, (answer, command, driver) in enumerate(events[1:], 1):
        feedback = events[place - 1].feedback
        if command is None or answer.event != event_after(feedback.event):
            continue  # the recorder has left something out
        after = events[place + 1].feedback if place + 1 < len(events) else None
        if after is not None and after.event != event_after(answer.event):
            after = None
        state, action = layout.state(feedback), layout.action(command, answer, after)
        if state is not None and action is not None:
            yield Frame(feedback.event, feedback.time, state, action, driver)


class _Event(NamedTuple):
    feedback: FeedbackRecord  # the first of the event
    command: CommandRecord | None  # that became the event; None: not in the recording
    driver: EventDriver


def _events(reader: RecordingReader, stretch: Stretch, tally: CommandTally) -> Iterator[_Event]:
    """Yield the events of the stretch, and show their records to the tally."""
    event = 0
    command: CommandRecord | None = None
    drivers, driver = RecordedDrivers(), NOBODY
    for record in reader.records(stretch.first_event, stretch.last_event, COMMAND_TOPICS):
        own = own_record_of(record.schema, record.data)
        drivers.take(own)
        if isinstance(own, FeedbackRecord):
            driver = drivers.of(own)
        tally.take(own, record.arrived, driver)
        match own:
            case CommandRecord(outcome="forwarded") as forwarded:
                command = forwarded
            case FeedbackRecord() as feedback if feedback.event != event:
                event = feedback.event
                became = command if command is not None and command.event == event else None
                yield _Event(feedback, became, driver)


def check_same_robot(first: RobotDescription, other: RobotDescription) -> None:
    """Raise RecordingDamaged unless recordings of both fit into one dataset."""
    if _measured(first) != _measured(other):
        raise RecordingDamaged(
            f"recordings of different robots do not fit into one dataset: {first.name}, {other.name}"
        )


def _measured(robot: RobotDescription) -> tuple[str, list[str], list[str], bool, int]:
    axes, joints = [axis.name for axis in robot.axes], [joint.name for joint in robot.joints]
    return robot.name, axes, joints, robot.wrench is not None, robot.ranges.count if robot.ranges else 0
