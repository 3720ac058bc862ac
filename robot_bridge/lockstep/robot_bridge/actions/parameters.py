"""Checks the parameters of a request against those that an action declares. No I/O."""

from collections.abc import Mapping

from lockstep.protocol.actions import ParameterValue
from lockstep.protocol.description import Action, ActionParameter
from lockstep.robot_bridge.errors import BadParameter

__all__ = ["checked_parameter", "parameters_of"]


def parameters_of(action: Action, given: Mapping[str, ParameterValue]) -> dict[str, ParameterValue]:
    """Return a value for each parameter of the action, defaults included.

    Raises:
        BadParameter: a value is missing, unknown, or not of the declared kind and range.
    """
    unknown = given.keys() - {each.name for each in action.parameters}
    if unknown:
        raise BadParameter(f"{action.name} has no parameter {min(unknown)[:60]!r}")
    values: dict[str, ParameterValue] = {}
    for parameter in action.parameters:
        value = given.get(parameter.name, parameter.default)
        if value is None:
            raise BadParameter(f"{parameter.name} is missing")
        values[parameter.name] = checked_parameter(parameter, value)
    return values


def checked_parameter(parameter: ActionParameter, value: ParameterValue) -> ParameterValue:
    """Return the value as the robot gets it.

    Raises:
        BadParameter: it is not of the declared kind and range.
    """
    match parameter.kind:
        case "switch":
            if isinstance(value, bool):
                return value
            raise BadParameter(f"{parameter.name} is true or false")
        case "choice":
            if isinstance(value, str) and value in parameter.choices:
                return value
            raise BadParameter(f"{parameter.name} is one of {', '.join(parameter.choices)}"[:500])
        case "number":
            least = float("-inf") if parameter.minimum is None else parameter.minimum
            most = float("inf") if parameter.maximum is None else parameter.maximum
            # A comparison with NaN is false.
            is_number = isinstance(value, float | int) and not isinstance(value, bool)
            if is_number and least <= value <= most and abs(value) < float("inf"):  # type: ignore[operator, arg-type]
                return float(value)
            raise BadParameter(f"{parameter.name} is a number from {least:g} to {most:g} {parameter.unit}".rstrip())
