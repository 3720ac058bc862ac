"""Options that several commands share, declared once as the fields of a dataclass."""

import inspect
from collections.abc import Callable
from dataclasses import fields
from functools import wraps
from typing import Any, get_type_hints

__all__ = ["with_options"]


def with_options(group: type[Any]) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Give a command the fields of the dataclass `group` as options after its own; it gets them as `options`."""
    shared = get_type_hints(group, include_extras=True)
    defaults = {each.name: each.default for each in fields(group)}

    def decorate(command: Callable[..., None]) -> Callable[..., None]:
        hints = get_type_hints(command, include_extras=True)
        own = [each for each in inspect.signature(command).parameters.values() if each.name != "options"]
        parameters = [each.replace(annotation=hints[each.name], kind=each.KEYWORD_ONLY) for each in own]
        for name, annotation in shared.items():
            kind = inspect.Parameter.KEYWORD_ONLY
            parameters.append(inspect.Parameter(name, kind, default=defaults[name], annotation=annotation))

        @wraps(command)
        def run(**given: Any) -> None:
            command(options=group(**{name: given.pop(name) for name in shared}), **given)

        # typer reads both: the order and the defaults here, the types there.
        run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
        run.__annotations__ = {each.name: each.annotation for each in parameters}
        return run

    return decorate
