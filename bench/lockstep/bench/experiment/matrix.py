"""The runs of `lockstep experiment all` and `lockstep experiment thesis`. No I/O."""

from collections.abc import Iterator
from dataclasses import replace

from lockstep.bench.experiment.choices import MODES, PROFILES, THESIS_ROBOTS, Choices, Mode

__all__ = ["GROWTH_SECONDS", "OUTAGE_SECONDS", "matrix_of", "thesis_matrix_of"]

GROWTH_SECONDS = 6.0  # at each of its event rates
OUTAGE_SECONDS = 10.0
THESIS_MODES: tuple[Mode, ...] = ("off", "feedback")  # its "without" and its "with"


def matrix_of(choices: Choices) -> Iterator[Choices]:
    """`choices` says what all runs share.

    Watchers stand beside the operator without a gate: they look on in the two other gate modes, in the same session. In
    the other runs they would tell nothing new, and load the machine.
    """
    for profile in PROFILES:
        for mode in MODES:
            yield replace(choices, profile=profile, mode=mode, watchers=choices.watchers and mode == "off")


def thesis_matrix_of(choices: Choices, robot: str | None = None) -> Iterator[Choices]:
    """The thesis' three experiments, without and with, each with a robot of its kind unless `robot` names one."""
    for profile, own in THESIS_ROBOTS.items():
        for mode in THESIS_MODES:
            watchers = choices.watchers and mode == "off"
            yield replace(choices, profile=profile, mode=mode, robot=robot or own, watchers=watchers)
