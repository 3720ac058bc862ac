"""Every profile in every mode: the runs of `lockstep experiment all`. No I/O."""

from collections.abc import Iterator
from dataclasses import replace

from bench.experiment.choices import MODES, PROFILES, Choices

__all__ = ["GROWTH_SECONDS", "OUTAGE_SECONDS", "matrix_of"]

GROWTH_SECONDS = 6.0  # at each of its event rates
OUTAGE_SECONDS = 10.0


def matrix_of(choices: Choices) -> Iterator[Choices]:
    """`choices` says what all runs share.

    Watchers stand beside the operator without a gate: they look on in the two other gate modes, in the same session. In
    the other runs they would tell nothing new, and load the machine.
    """
    for profile in PROFILES:
        for mode in MODES:
            yield replace(choices, profile=profile, mode=mode, watchers=choices.watchers and mode == "off")
