"""The values of a command, one per axis, made of what a caller says."""

import math
from collections.abc import Mapping, Sequence

from lockstep.client.errors import CommandError
from lockstep.protocol.description import Axis
from lockstep.protocol.neutral import neutral_value

__all__ = ["Values", "command_values"]

Values = Mapping[str, float | None] | Sequence[float | None]  # by name of the axis, or in the description's order


def command_values(axes: Sequence[Axis], values: Values) -> list[float | None]:
    """Return one value per axis; axes without one are at rest, or stay.

    Raises:
        CommandError: an unknown axis, a wrong number of values, None for a rate axis, or a value that is not finite.
    """
    if isinstance(values, Mapping):
        unknown = values.keys() - {axis.name for axis in axes}
        if unknown:
            known = ", ".join(axis.name for axis in axes)
            raise CommandError(f"no axis {', '.join(sorted(unknown))}; there are {known}")
        values = [values.get(axis.name, neutral_value(axis)) for axis in axes]
    command = [None if value is None else float(value) for value in values]
    if len(command) != len(axes):
        raise CommandError(f"{len(command)} values for {len(axes)} axes")
    for axis, value in zip(axes, command, strict=True):
        if value is None and axis.kind == "rate":
            raise CommandError(f"{axis.name} has no value, and only a goal axis stays without one")
        if value is not None and not math.isfinite(value):
            raise CommandError("a value is NaN or infinite")
    return command
