"""Finds environment variables that look like settings but are not. No I/O."""

from collections.abc import Iterable
from typing import get_args

from pydantic import BaseModel

from lockstep.protocol.files.setting_names import not_a_setting

__all__ = ["unknown_settings"]

PREFIX = "LOCKSTEP_"
# Read by other programs that a deployment runs with the same environment (deploy/), or by other commands.
OTHERS = frozenset(
    {
        "LOCKSTEP_ROBOT_PYTHON",
        "LOCKSTEP_ROBOT_NAME",
        "LOCKSTEP_ROBOT_OPTIONS",
        "LOCKSTEP_ROBOT_CONFIG",
        "LOCKSTEP_ROBOT_CONTAINERS",
        "LOCKSTEP_CONFIG_DIR",
        "LOCKSTEP_SITE",
        "LOCKSTEP_HTTP_PORT",
        "LOCKSTEP_HTTPS_PORT",
        "LOCKSTEP_ONE",
        "LOCKSTEP_TWO",
        "LOCKSTEP_EXTERNAL_IP",
    }
)


def unknown_settings(environment: Iterable[str], settings: type[BaseModel], more: Iterable[str] = ()) -> list[str]:
    """Return a sentence for each variable of `environment` that begins as a setting and that nothing reads.

    Args:
        environment: names of variables
        settings: the class that reads them
        more: further names that are read
    """
    known = {*_names(settings, PREFIX), *OTHERS, *more}
    found = [name for name in sorted(environment) if name.upper().startswith(PREFIX) and name.upper() not in known]
    return [not_a_setting(name, known, further=" and has no effect") for name in found]


def _names(settings: type[BaseModel], prefix: str) -> Iterable[str]:
    """Yield the variables of all fields, and of the fields of nested settings."""
    for name, field in settings.model_fields.items():
        yield f"{prefix}{name.upper()}"
        for kind in (field.annotation, *get_args(field.annotation)):
            if isinstance(kind, type) and issubclass(kind, BaseModel):
                yield from _names(kind, f"{prefix}{name.upper()}__")
