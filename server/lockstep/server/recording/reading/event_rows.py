"""A recording as a table: one row for each event."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from lockstep.protocol.description import RobotDescription
from lockstep.protocol.serial import event_gap
from lockstep.server.recording.format.drivers import NOBODY, EventDriver
from lockstep.server.recording.format.episodes import EpisodeEntry
from lockstep.server.recording.format.payload import own_record_of
from lockstep.server.recording.format.records import CommandRecord, FeedbackRecord, SeatRecord
from lockstep.server.recording.format.topics import CAMERA, MICROPHONE, OWN_TOPICS
from lockstep.server.recording.reading.drivers import DRIVER_TOPICS, RecordedDrivers
from lockstep.server.recording.reading.episode_of_event import EpisodeOfEvent
from lockstep.server.recording.reading.reader import RecordingReader

__all__ = ["EventRow", "columns_of", "event_rows", "values_of"]

Value = str | int | float | bool | None
WRENCH = ("fx", "fy", "fz", "tx", "ty", "tz")
EPISODE = {"episode": "id", "episode_state": "state", "task": "task", "outcome": "outcome"}  # fields by column
READ = {*DRIVER_TOPICS, OWN_TOPICS[SeatRecord]}


class EventRow(NamedTuple):
    """One row: an event, with times in ns since 1970."""

    feedback: FeedbackRecord  # the first of the event
    arrived: int
    captured: int
    command: CommandRecord | None  # command that became the event; None for the file's first event
    driver: str  # name of the seat's holder
    stamps: dict[str, int]  # of the newest picture and sound that had arrived, by stream
    driven_by: EventDriver = NOBODY  # sender of the command that became the event
    episode: EpisodeEntry | None = None  # the episode that it was driven in


def event_rows(
    reader: RecordingReader, episodes: Sequence[EpisodeEntry] = (), *, kept: bool = False
) -> Iterator[EventRow]:
    """Yield the rows in the order of their events.

    `episodes`: those of the recording. `kept`: those of kept episodes alone. Raises RecordingError.
    """
    places = EpisodeOfEvent(episodes)
    event = 0
    command: CommandRecord | None = None
    driver = ""
    stamps: dict[str, int] = {}
    drivers = RecordedDrivers()
    for record in reader.records():
        for prefix in (CAMERA, MICROPHONE):
            if record.topic.startswith(prefix):
                stamps[record.topic.removeprefix(prefix)] = record.event
        if record.topic not in READ:
            continue
        own = own_record_of(record.schema, record.data)
        drivers.take(own)
        match own:
            case CommandRecord(outcome="forwarded") as forwarded:
                command = forwarded
            case SeatRecord(name=name):
                driver = name
            case FeedbackRecord() as feedback if feedback.event != event:
                event = feedback.event
                episode = places.of(event)
                if kept and (episode is None or episode.state != "kept"):
                    continue
                became = command if command is not None and command.event == event else None
                yield EventRow(
                    feedback,
                    record.arrived,
                    record.captured,
                    became,
                    driver,
                    dict(stamps),
                    drivers.of(feedback),
                    episode,
                )


def columns_of(description: RobotDescription, streams: list[str], *, has_episodes: bool = False) -> dict[str, type]:
    """Return the names and types of the columns, in order. Units are SI; names of times say theirs."""
    columns: dict[str, type] = {
        "event": int,
        "arrived_us": int,
        "captured_us": int,
        "bridge_time_s": float,
        "driver": str,
        "driver_kind": str,
        "intervention": bool,
        "command_peer": str,
        "command_issue": int,
    }
    if has_episodes:
        columns |= dict.fromkeys(EPISODE, str)
    columns |= {f"command.{axis.name}": float for axis in description.axes}
    columns |= {f"axis.{axis.name}": float for axis in description.axes}
    columns |= {f"goal.{axis.name}": float for axis in description.axes if axis.kind == "goal"}
    columns |= {f"joint.{joint.name}": float for joint in description.joints}
    if description.wrench is not None:
        columns |= {f"wrench.{name}": float for name in WRENCH}
    if description.ranges is not None:
        columns |= {f"range.{number}": float for number in range(description.ranges.count)}
    columns |= {"at_rest": bool, "stopped": bool, "faults": str, "limits": str}
    for stream in streams:
        columns |= {f"stamp.{stream}": int, f"gap.{stream}": int}
    return columns


def values_of(
    row: EventRow, description: RobotDescription, streams: list[str], *, has_episodes: bool = False
) -> list[Value]:
    """Return the values in the order of `columns_of`; None: not known, or a command for a goal axis to stay."""
    feedback, command = row.feedback, row.command
    values: list[Value] = [
        feedback.event,
        row.arrived // 1000,
        row.captured // 1000,
        feedback.time,
        row.driver,
        row.driven_by.kind,
        row.driven_by.intervention,
        "" if command is None else command.peer,
        None if command is None else command.issue,
    ]
    if has_episodes:
        episode = row.episode
        values += [""] * len(EPISODE) if episode is None else [getattr(episode, name) for name in EPISODE.values()]
    values += _filled([] if command is None else command.values, len(description.axes))
    values += _filled(feedback.axes, len(description.axes))
    goals = _filled(feedback.goals, len(description.axes))
    values += [goal for axis, goal in zip(description.axes, goals, strict=True) if axis.kind == "goal"]
    values += _filled(feedback.joints, len(description.joints))
    if description.wrench is not None:
        values += _filled(feedback.wrench, len(WRENCH))
    if description.ranges is not None:
        values += _filled(feedback.ranges, description.ranges.count)
    values += [feedback.at_rest, feedback.stop.stopped, "; ".join(feedback.faults), "; ".join(feedback.limits)]
    for stream in streams:
        stamp = row.stamps.get(stream)
        values += [stamp, None if stamp is None else event_gap(feedback.event, stamp)]
    return values


def _filled(values: Sequence[float | None], count: int) -> list[float | None]:
    return [*values[:count], *[None] * (count - len(values))]
