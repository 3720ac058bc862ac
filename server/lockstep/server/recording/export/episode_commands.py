"""What a dataset notes of the commands of an episode: how long they took, and which were refused. No I/O.

Only what lies within the episode's events counts, so that the parts of a split episode have each command once:

- the delay of a command that became one of its events, but for the first, which is the state that it began with;
- a refusal while one of its events held. While the last one holds, it is of the episode up to the record of its end;
  where a trim or a split has ended the episode there, it is of what follows.
"""

from collections import Counter
from collections.abc import Collection
from dataclasses import dataclass, field
from typing import Annotated

import msgspec

from lockstep.protocol.console import DriverKind
from lockstep.protocol.serial import is_newer
from lockstep.server.recording.format.drivers import EventDriver
from lockstep.server.recording.format.records import (
    CommandRecord,
    EpisodeRecord,
    FeedbackRecord,
    OwnRecord,
    RefusalRecord,
    Whole,
)
from lockstep.server.recording.format.topics import OWN_TOPICS
from lockstep.server.recording.reading.command_delays import CommandDelays
from lockstep.server.recording.reading.drivers import DRIVER_TOPICS
from lockstep.server.recording.reading.samples import Samples

__all__ = ["COMMAND_TOPICS", "CommandTally", "DriverCommands", "EpisodeCommands"]

COMMAND_TOPICS = DRIVER_TOPICS | {OWN_TOPICS[RefusalRecord]}
"""The topics whose records `CommandTally.take` needs."""

MAX_DRIVERS = 50  # of an episode; a client may take any number of names
OTHERS = "others"


class DriverCommands(msgspec.Struct, frozen=True, kw_only=True):
    """The commands of one driver in an episode. Delays are ms from a command to its feedback, both at the console."""

    name: str  # "": the record of a refusal names nobody
    kind: DriverKind
    median_ms: float | None = None  # None: no command had a feedback
    p95_ms: float | None = None
    # The number of commands by their delay in two digits, 0.1 ms at least, to add up episodes.
    delays: dict[Annotated[float, msgspec.Meta(ge=0)], Whole] = {}
    refused: dict[str, Whole] = {}  # number of commands that were refused, by reason


class EpisodeCommands(msgspec.Struct, frozen=True, kw_only=True):
    """The commands of an episode. `drivers` has all of whom a command had a feedback or was refused."""

    median_ms: float | None = None
    p95_ms: float | None = None
    drivers: list[DriverCommands] = []

    @property
    def refused(self) -> dict[str, int]:
        """The number of commands that were refused, by reason."""
        found: Counter[str] = Counter()
        for each in self.drivers:
            found.update(each.refused)
        return dict(found)


@dataclass
class _Delays:
    exact: Samples = field(default_factory=Samples)
    counts: Counter[float] = field(default_factory=Counter)


class CommandTally:
    """Call `take` with the records of an episode's events in their order, then `result`.

    Args:
        recorded: ids of the recorded episodes that the episode was made of; none: the recording as a whole
    """

    def __init__(self, first_event: int, last_event: int, recorded: Collection[str]) -> None:
        self._first, self._last, self._recorded = first_event, last_event, recorded
        self._answers = CommandDelays()
        self._all = Samples()
        self._delays: dict[tuple[str, DriverKind], _Delays] = {}
        self._kinds: dict[str, DriverKind] = {}  # by name; a refusal does not tell it
        self._refused: Counter[tuple[str, str]] = Counter()  # by name and reason
        self._refused_last: Counter[tuple[str, str]] = Counter()  # those while the last event held
        self._refused_names: set[str] = set()
        self._is_over = False

    def take(self, record: OwnRecord | None, arrived: int, driver: EventDriver) -> None:
        """Take a record that arrived at `arrived`, ns since 1970. `driver`: of the newest event."""
        delay = self._answers.take(record, arrived)
        match record:
            case CommandRecord(name=name, kind=kind):
                if name in self._kinds or len(self._kinds) < MAX_DRIVERS:
                    self._kinds[name] = "human" if kind == "none" else kind  # of before there were policies
            case RefusalRecord() if record.refused and not self._is_over:  # others are no commands: requests, notes
                self._refusal(record)
            case FeedbackRecord(event=event) if delay is not None and is_newer(event, self._first):
                self._delay(driver, delay)
            case EpisodeRecord(episode=episode) if episode in self._recorded:
                self._bound(record)

    def result(self) -> EpisodeCommands:
        refused = self._refused if self._recorded else self._refused + self._refused_last
        found = {key: _driver(*key, delays) for key, delays in self._delays.items()}
        for (name, reason), count in sorted(refused.items()):
            key = name, self._kind(name)
            known = found.get(key) or DriverCommands(name=key[0], kind=key[1])
            found[key] = msgspec.structs.replace(known, refused={**known.refused, reason: count})
        return EpisodeCommands(
            median_ms=_rounded(self._all.percentile(0.5)),
            p95_ms=_rounded(self._all.percentile(0.95)),
            drivers=[found[key] for key in sorted(found)],
        )

    def _delay(self, driver: EventDriver, delay: float) -> None:
        self._all.add(delay)
        key: tuple[str, DriverKind] = driver.name, driver.kind
        if key not in self._delays and len(self._delays) >= MAX_DRIVERS:
            key = OTHERS, "none"
        delays = self._delays.setdefault(key, _Delays())
        delays.exact.add(delay)
        delays.counts[round(float(f"{delay:.2g}"), 1)] += 1

    def _refusal(self, record: RefusalRecord) -> None:
        counts = self._refused_last if record.event == self._last else self._refused
        key = record.name, record.reason
        if record.name not in self._refused_names and len(self._refused_names) >= MAX_DRIVERS:
            key = OTHERS, record.reason
        else:
            self._refused_names.add(record.name)
        counts[key] += 1

    def _bound(self, record: EpisodeRecord) -> None:
        """Take the begin or the end of the episode as it was recorded."""
        if record.kind == "start" and record.first_event == self._first:
            self._refused.clear()
            self._refused_last.clear()
            self._refused_names.clear()
        elif record.kind == "kept" and record.last_event == self._last:
            self._is_over = True
            self._refused += self._refused_last

    def _kind(self, name: str) -> DriverKind:
        driven = [kind for known, kind in self._delays if known == name]
        return self._kinds.get(name) or (driven[0] if driven else "none")


def _driver(name: str, kind: DriverKind, delays: _Delays) -> DriverCommands:
    return DriverCommands(
        name=name,
        kind=kind,
        median_ms=_rounded(delays.exact.percentile(0.5)),
        p95_ms=_rounded(delays.exact.percentile(0.95)),
        delays=dict(sorted(delays.counts.items())),
    )


def _rounded(delay: float | None) -> float | None:
    return None if delay is None else round(delay, 3)
