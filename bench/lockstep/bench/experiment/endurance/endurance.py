"""Counts the events of an endurance run: connections that ended, seats, pictures. No I/O.

A connection outlives an outage of less than `SURVIVED_SECONDS` (docs/architecture.md), so the network is the cause of
its end only in a longer outage, or shortly after.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from lockstep.bench.harness.restarting_total import RestartingTotal
from lockstep.emulator.impairment.outages import PlannedOutage

__all__ = ["Endurance", "Lost", "cut_for_long"]

SURVIVED_SECONDS = 20.0  # of silence that a connection outlives
AFTERMATH_SECONDS = 30.0  # after an outage in which its consequence may still show


class Lost(NamedTuple):
    """A connection that ended before the run did."""

    at: float  # s after the run began
    why: str  # the console's reason
    excused: bool  # the network was cut for longer than a connection outlives


def cut_for_long(outages: Sequence[PlannedOutage], at: float) -> bool:
    """Return whether an outage that no connection outlives held at `at`, or ended shortly before."""
    for each in outages:
        since = at - each.at
        if each.lasts >= SURVIVED_SECONDS and since >= 0:
            passed = since if each.every is None else since % each.every
            if passed <= each.lasts + AFTERMATH_SECONDS:
                return True
    return False


@dataclass
class Endurance:
    """Counts of a run, from the client's statistics (`look`) and the console's counts (`ended`) as time goes on."""

    outages: Sequence[PlannedOutage] = ()
    losses: list[Lost] = field(default_factory=list)
    reconnections: int = 0  # times that the client was live again after it had not been
    seat_losses: int = 0
    longest_silence: float = 0.0  # s in which the client was not live
    refused: Mapping[str, float] = field(default_factory=dict)  # refused messages at the console, by reason
    driven_seconds: float = 0.0  # for which the client was armed and had the seat
    _ended: Counter[str] = field(default_factory=Counter)
    _at: float | None = None
    _live_at: float = 0.0
    _was_live: bool = False
    _was_mine: bool = False
    _totals: dict[tuple[str, str], RestartingTotal] = field(default_factory=dict)

    def look(
        self, at: float, *, live: bool, mine: bool, driving: bool, streams: Mapping[str, Mapping[str, Any]]
    ) -> None:
        """Count the client's statistics. `streams`: by name; each has its kind, renderings and violations so far."""
        passed = 0.0 if self._at is None else at - self._at
        self._at = at
        if live:
            self.reconnections += not self._was_live and self._live_at > 0
            self._live_at = at
        elif self._live_at > 0:
            self.longest_silence = max(self.longest_silence, at - self._live_at)
        self.seat_losses += self._was_mine and not mine
        self.driven_seconds += passed if driving else 0.0
        self._was_live, self._was_mine = live, mine
        for name, each in streams.items():
            for what in ("rendered", "violations"):
                self._totals.setdefault((f"{each['kind']} {what}", name), RestartingTotal()).see(each[what])

    def ended(self, at: float, counts: Mapping[str, float]) -> list[Lost]:
        """Count the console's ended connections, by reason, and return only the new ones."""
        new = [
            Lost(round(at, 1), why, cut_for_long(self.outages, at))
            for why, count in counts.items()
            for _ in range(round(count) - self._ended[why])
        ]
        self._ended = Counter({why: round(count) for why, count in counts.items()})
        self.losses += new
        return new

    def _total(self, what: str) -> int:
        return sum(total.value for (name, _), total in self._totals.items() if name == what)

    def fields(self) -> dict[str, Any]:
        lost = [each for each in self.losses if not each.excused]
        violations = self._total("video violations") + self._total("audio violations")
        pictures = self._total("video rendered")
        return {
            "connections": 1 + len(self.losses),
            "lost": [each._asdict() for each in self.losses],
            "reconnections": self.reconnections,
            "longest_silence_seconds": round(self.longest_silence, 1),
            "seat_losses": self.seat_losses,
            "refused": {why: round(count) for why, count in self.refused.items() if count},
            "driven_seconds": round(self.driven_seconds),
            "pictures": pictures,
            "sound_segments": self._total("audio rendered"),
            "violations": violations,
            "verdicts": {
                "no_connection_lost": not lost,
                "nothing_beyond_tolerance": violations == 0,
                "pictures_came": pictures > 0,
            },
        }
