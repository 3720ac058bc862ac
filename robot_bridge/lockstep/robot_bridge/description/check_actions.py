"""Checks the actions of a description."""

import math
from collections.abc import Sequence

from lockstep.protocol.actions import MAX_PARAMETERS
from lockstep.protocol.description import Action, ActionParameter
from lockstep.robot_bridge.actions.parameters import checked_parameter
from lockstep.robot_bridge.errors import BadParameter, DescriptionError

__all__ = ["MAX_ACTIONS", "action_texts", "check_actions"]

MAX_ACTIONS = 32
MAX_CHOICES = 32
FARTHEST = 1e9  # of a bound of a number


def action_texts(actions: Sequence[Action]) -> list[str]:
    """Return every text of the actions that is shown to people or names something."""
    texts = []
    for action in actions:
        texts += [action.name, action.label, action.confirm]
        for parameter in action.parameters:
            texts += [parameter.name, parameter.label, parameter.unit, *parameter.choices]
    return texts


def check_actions(actions: Sequence[Action]) -> None:
    """Check that a console can offer these actions.

    Raises:
        DescriptionError: names the first contradiction found.
    """
    names = [action.name for action in actions]
    if len(names) > MAX_ACTIONS:
        raise DescriptionError(f"{len(names)} actions, the bound is {MAX_ACTIONS}")
    if len(set(names)) != len(names) or "" in names:
        raise DescriptionError("an action's name is empty or used twice")
    for action in actions:
        parameters = [parameter.name for parameter in action.parameters]
        if len(parameters) > MAX_PARAMETERS:
            raise DescriptionError(f"action {action.name}: at most {MAX_PARAMETERS} parameters")
        if len(set(parameters)) != len(parameters) or "" in parameters:
            raise DescriptionError(f"action {action.name}: a parameter's name is empty or used twice")
        for parameter in action.parameters:
            _check_parameter(action, parameter)


def _check_parameter(action: Action, parameter: ActionParameter) -> None:
    where = f"action {action.name}, parameter {parameter.name}"
    bounds = [bound for bound in (parameter.minimum, parameter.maximum) if bound is not None]
    if not all(math.isfinite(bound) and abs(bound) <= FARTHEST for bound in bounds) or bounds != sorted(bounds):
        raise DescriptionError(f"{where}: minimum must not be above maximum, and both finite")
    choices = parameter.choices
    if (parameter.kind == "choice") != bool(choices) or len(set(choices)) != len(choices) or "" in choices:
        raise DescriptionError(f"{where}: a choice, and nothing else, has choices, each once and not empty")
    if len(choices) > MAX_CHOICES:
        raise DescriptionError(f"{where}: {len(choices)} choices, the bound is {MAX_CHOICES}")
    if parameter.default is not None:
        try:
            checked_parameter(parameter, parameter.default)
        except BadParameter as error:
            raise DescriptionError(f"{where}: its default does not fit: {error.detail}") from error
