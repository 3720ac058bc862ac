"""The findings of one command. No I/O."""

from dataclasses import dataclass, field
from typing import Any

from lockstep.bench.experiment.choices import Choices
from lockstep.bench.experiment.endurance.growth import Growth
from lockstep.bench.experiment.judge.record import Run
from lockstep.bench.experiment.judge.results import Result
from lockstep.emulator.impairment.profile import Profile

__all__ = ["Cell", "Findings"]


@dataclass(frozen=True)
class Cell:
    """One run and its result."""

    choices: Choices
    profile: Profile
    result: Result
    run: Run


@dataclass
class Findings:
    cells: list[Cell] = field(default_factory=list)
    growth: Growth | None = None
    outages: list[dict[str, Any]] = field(default_factory=list)
    endurances: list[dict[str, Any]] = field(default_factory=list)
    failed: list[str] = field(default_factory=list)  # runs that did not come to an end, and why
    machine: dict[str, Any] = field(default_factory=dict)

    def results(self) -> list[dict[str, Any]]:
        """Return the results for JSON."""
        growth = [] if self.growth is None else [self.growth.fields()]
        return [*(cell.result for cell in self.cells), *growth, *self.outages, *self.endurances]

    @property
    def broken(self) -> bool:
        """True if a verdict is false."""
        return any(False in result["verdicts"].values() for result in self.results())
