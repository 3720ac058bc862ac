"""Who drove a recorded session: interventions, success by driver, and how far shadows agree with people. No I/O.

- Time is the robot's, from one event to the next, at most `LONGEST` for one event.
- An intervention is a spell of a person's events in an episode in which a policy has driven before; their number is
  related to the minutes of the episodes in which a policy drove.
- An episode is the policy's `alone`, the policy's `corrected` by a person, or a person's.
- A shadow agrees if each axis is within `AGREES` of its range of what a person did; out of limits never agrees.
"""

from bisect import bisect_right
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

from lockstep.protocol.console import DriverKind
from lockstep.protocol.episodes import EpisodeOutcome
from lockstep.protocol.serial import event_gap
from lockstep.server.recording.format.drivers import NOBODY, EventDriver
from lockstep.server.recording.format.episodes import EpisodeEntry
from lockstep.server.recording.format.records import FeedbackRecord, OwnRecord, ShadowRecord
from lockstep.server.recording.reading.drivers import RecordedDrivers

__all__ = ["AGREES", "LONGEST", "DriverTally", "Driven", "Outcomes", "Shadowed"]

LONGEST = 2.0  # s: after a pause nobody has driven all the time
AGREES = 0.05  # of an axis' range
MOST = 50  # names that are told; a client may take any number


@dataclass
class Driven:
    """What one driver did."""

    events: int = 0
    seconds: float = 0.0
    interventions: int = 0  # spells
    intervention_events: int = 0


@dataclass
class Outcomes:
    """Kept episodes."""

    success: int = 0
    failure: int = 0
    unsaid: int = 0

    @property
    def share(self) -> float | None:
        """The share of successes among those of which somebody said how they went; None without any."""
        said = self.success + self.failure
        return self.success / said if said else None


@dataclass
class Shadowed:
    """How the shadows of one policy were judged."""

    judgements: Counter[str] = field(default_factory=Counter)
    compared: int = 0  # with what a person did
    agreed: int = 0

    @property
    def agreement(self) -> float | None:
        return self.agreed / self.compared if self.compared else None


class DriverTally:
    """Call `take` with the records of a recording, in order, and then `take_episodes`; again for each further part.

    Of a dataset, call `take` with the feedback of an episode's rows, and then `take_episode`.

    Attributes:
        drivers: by name and kind
        outcomes: of kept episodes, by who drove them: "policy net alone", "policy net corrected", "Ada"
        shadows: by name of the policy
        policy_seconds: of the kept and discarded episodes in which a policy drove
        interventions: spells, in these episodes
    """

    def __init__(self) -> None:
        self.drivers: dict[tuple[str, DriverKind], Driven] = {}
        self.outcomes: dict[str, Outcomes] = {}
        self.shadows: dict[str, Shadowed] = {}
        self.policy_seconds = 0.0
        self.interventions = 0
        self._reader = RecordedDrivers()
        self._event: tuple[str, int] = ("", 0)
        self._time = 0.0  # s, of the bridge, of the newest event
        self._before = NOBODY  # the newest event's driver
        # Of this part: event, s, and its driver. A part has a bound, `LOCKSTEP_RECORDING__FILE_BYTES`.
        self._events: list[tuple[int, float, EventDriver]] = []

    @property
    def has_policy(self) -> bool:
        """Whether a policy drove or shadowed."""
        return bool(self.shadows) or any(kind == "policy" for _, kind in self.drivers)

    @property
    def interventions_per_minute(self) -> float | None:
        """None if no policy drove in an episode."""
        return self.interventions / self.policy_seconds * 60 if self.policy_seconds else None

    def take(self, record: OwnRecord | None) -> None:
        self._reader.take(record)
        match record:
            case FeedbackRecord() if (record.epoch, record.event) != self._event:
                self._feedback(record, self._reader.of(record))
            case ShadowRecord():
                self._shadow(record)

    def _feedback(self, feedback: FeedbackRecord, driver: EventDriver) -> None:
        goes_on = feedback.epoch == self._event[0]
        seconds = min(max(0.0, feedback.time - self._time), LONGEST) if goes_on else 0.0
        self._event, self._time = (feedback.epoch, feedback.event), feedback.time
        before, self._before = self._before, driver
        self._events.append((feedback.event, seconds, driver))
        if driver.kind == "none":
            return
        key = (driver.name, driver.kind)
        if key not in self.drivers and len(self.drivers) >= MOST:
            return
        driven = self.drivers.setdefault(key, Driven())
        driven.events += 1
        driven.seconds += seconds
        if driver.intervention:
            driven.intervention_events += 1
            driven.interventions += driver != before

    def take_episodes(self, episodes: Sequence[EpisodeEntry]) -> None:
        """Count the episodes of the part, with all changes that were made to them since."""
        begin = self._events[0][0] if self._events else 0
        places = [event_gap(event, begin) for event, _, _ in self._events]
        for each in episodes:
            if each.state in ("kept", "discarded"):
                # An episode begins when its first event was executed: that was driven before.
                first, last = (bisect_right(places, event_gap(at, begin)) for at in (each.first_event, each.last_event))
                self._count(self._events[first:last], each.outcome, is_kept=each.state == "kept")
        self._events = []

    def take_episode(self, outcome: EpisodeOutcome) -> None:
        """Count everything that was taken since the last call as one kept episode."""
        self._count(self._events, outcome, is_kept=True)
        self._events = []

    def _count(
        self, events: Sequence[tuple[int, float, EventDriver]], outcome: EpisodeOutcome, *, is_kept: bool
    ) -> None:
        drivers = list(dict.fromkeys(driver for _, _, driver in events if driver.kind != "none"))[:MOST]
        policies = sorted({each.name for each in drivers if each.kind == "policy"})
        if policies:
            self.policy_seconds += sum(seconds for _, seconds, _ in events)
            spells = pairwise([NOBODY, *(driver for _, _, driver in events)])
            self.interventions += sum(now.intervention and now != before for before, now in spells)
        if is_kept and drivers:
            who = _who(drivers, policies)
            if who in self.outcomes or len(self.outcomes) < MOST:
                outcomes = self.outcomes.setdefault(who, Outcomes())
                name = outcome or "unsaid"
                setattr(outcomes, name, getattr(outcomes, name) + 1)

    def _shadow(self, record: ShadowRecord) -> None:
        if record.name not in self.shadows and len(self.shadows) >= MOST:
            return
        shadow = self.shadows.setdefault(record.name, Shadowed())
        shadow.judgements[record.judgement] += 1
        if record.difference is not None and record.driver_kind == "human":
            shadow.compared += 1
            shadow.agreed += record.judgement == "in_time" and record.difference <= AGREES


def _who(drivers: list[EventDriver], policies: list[str]) -> str:
    if not policies:
        return ", ".join(sorted({each.name for each in drivers}))
    corrected = any(each.intervention for each in drivers)
    return f"policy {', '.join(policies)} {'corrected' if corrected else 'alone'}"
