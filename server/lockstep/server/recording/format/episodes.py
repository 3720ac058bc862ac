"""The episodes of a recording, found from its records. No I/O.

An episode counts only if the file has its record `start` and, later, its record `kept` of the same epoch. One without
an end was open when the file ended; it is `cut`, like those that have a record of that.
"""

from typing import Literal

import msgspec

from lockstep.protocol.episodes import EpisodeOutcome
from lockstep.server.recording.format.records import EpisodeRecord, Whole

__all__ = ["MAX_EPISODES", "EpisodeBook", "EpisodeEntry"]

MAX_EPISODES = 10_000  # of a file
MAX_MARKS = 100  # of an episode


class EpisodeEntry(msgspec.Struct, frozen=True, kw_only=True):
    """One episode. Times in µs since 1970."""

    id: str
    number: Whole
    state: Literal["open", "kept", "discarded", "cut"]
    task: str
    outcome: EpisodeOutcome = ""
    first_event: Whole
    last_event: Whole
    started: Whole
    ended: Whole
    by: str = ""
    why: str = ""  # it was cut
    drivers: list[str] = []
    problems: list[str] = []
    marks: list[tuple[int, str]] = []  # event, text


class EpisodeBook:
    """Show it each record of an episode, in the order of the file."""

    def __init__(self) -> None:
        self._entries: dict[str, EpisodeEntry] = {}
        self._epochs: dict[str, str] = {}

    def take(self, record: EpisodeRecord, arrived: int) -> None:
        """Take a record that arrived at `arrived`, in µs since 1970."""
        known = self._entries.get(record.episode)
        if record.kind == "start":
            if known is None and len(self._entries) < MAX_EPISODES:
                self._epochs[record.episode] = record.epoch
                self._entries[record.episode] = _begun(record, arrived)
            return
        if known is None or known.state != "open" or self._epochs[record.episode] != record.epoch:
            return
        if record.kind == "mark":
            if len(known.marks) < MAX_MARKS:
                mark = (record.event, record.text)
                self._entries[record.episode] = msgspec.structs.replace(known, marks=[*known.marks, mark])
            return
        self._entries[record.episode] = msgspec.structs.replace(
            known,
            state=record.kind,
            outcome=record.outcome,
            last_event=record.last_event,
            ended=arrived,
            why=record.why,
            drivers=record.drivers,
            problems=record.problems,
        )

    def entries(self) -> list[EpisodeEntry]:
        """Return the episodes in the order of their begin; those without an end as `open`."""
        return list(self._entries.values())


def _begun(record: EpisodeRecord, arrived: int) -> EpisodeEntry:
    return EpisodeEntry(
        id=record.episode,
        number=record.number,
        state="open",
        task=record.task,
        first_event=record.first_event,
        last_event=record.last_event,
        started=arrived,
        ended=arrived,
        by=record.by,
        drivers=record.drivers,
    )
