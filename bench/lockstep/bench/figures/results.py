"""A measured figure, and whether it meets its target."""

from dataclasses import asdict, dataclass
from typing import Any, Literal

__all__ = ["Bound", "Result"]

Bound = Literal["at most", "at least"]


@dataclass(frozen=True, kw_only=True)
class Result:
    """A figure with its target and its baseline. `value` None: it could not be measured; `conditions` says why."""

    section: str  # "lossy"
    name: str  # "command → feedback, p99"
    value: float | None
    unit: str  # "ms"
    target: float | None = None  # None: reported only
    bound: Bound = "at most"  # the side of the target that is good
    baseline: float | None = None  # the same figure of `baseline_name`, from the same run
    baseline_name: str = ""  # "reliable data channel"
    samples: int = 0
    conditions: str = ""  # of the measurement
    stacked_on: float | None = None  # where its part of a stacked figure begins, in `unit`; None: it is no such part

    @property
    def met(self) -> bool | None:
        """True if the figure meets its target; None without a target."""
        if self.target is None:
            return None
        if self.value is None:
            return False
        return self.value <= self.target if self.bound == "at most" else self.value >= self.target

    @property
    def ratio(self) -> float | None:
        """The figure divided by the baseline's."""
        if self.value is None or not self.baseline:
            return None
        return self.value / self.baseline

    @property
    def command(self) -> str:
        """The command that measures it again."""
        return f"make bench ARGS={self.section}"

    def fields(self) -> dict[str, Any]:
        """Return the fields for JSON."""
        return asdict(self) | {"met": self.met, "ratio": self.ratio, "command": self.command}
