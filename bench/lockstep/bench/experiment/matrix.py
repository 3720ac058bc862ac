"""The runs of `lockstep experiment all` and `lockstep experiment thesis`. No I/O."""

from collections.abc import Iterator
from dataclasses import replace

from lockstep.bench.experiment.choices import MODES, PROFILES, THESIS_ROBOTS, Choices, Mode

__all__ = ["GROWTH_SECONDS", "OUTAGE_SECONDS", "matrix_of", "thesis_matrix_of"]

GROWTH_SECONDS = 6.0  # at each of the event rates
OUTAGE_SECONDS = 10.0
THESIS_MODES: tuple[Mode, ...] = ("off", "feedback")  # the thesis' "without" and "with"


def matrix_of(choices: Choices) -> Iterator[Choices]:
    """Yield the runs of all profiles and modes; `choices` has the options that all runs share.

    Watchers accompany the operator without a gate: they look on in the two other gate modes, in the same session. In
    the other runs they would show nothing new, and load the machine.
    """
    for profile in PROFILES:
        for mode in MODES:
            yield replace(choices, profile=profile, mode=mode, watchers=choices.watchers and mode == "off")


def thesis_matrix_of(choices: Choices, robot: str | None = None) -> Iterator[Choices]:
    """Yield the thesis' three experiments, without and with, each with a robot of its kind unless `robot` names one."""
    for profile, own in THESIS_ROBOTS.items():
        for mode in THESIS_MODES:
            watchers = choices.watchers and mode == "off"
            yield replace(choices, profile=profile, mode=mode, robot=robot or own, watchers=watchers)
