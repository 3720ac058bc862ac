"""Turns flags into settings, for every command."""

import typer
from pydantic import ValidationError

from lockstep.server.settings import Settings
from lockstep.server.settings_file import SettingsFileUnusable

__all__ = ["make_settings"]

EXIT_USAGE = 2


def make_settings(**flags: object) -> Settings:
    """Return the settings of the file and of the environment, overridden by the flags that were given.

    Raises:
        typer.Exit: a setting is invalid; the exit code is 2.
    """
    given = {name: value for name, value in flags.items() if value is not None and value != []}
    given = {name: ",".join(value) if isinstance(value, list) else value for name, value in given.items()}
    try:
        return Settings(**given)  # type: ignore[arg-type]
    except SettingsFileUnusable as error:
        typer.echo(f"lockstep: {error}", err=True)
        raise typer.Exit(EXIT_USAGE) from error
    except ValidationError as error:
        for each in error.errors():
            typer.echo(f"lockstep: {'.'.join(map(str, each['loc'])) or 'robot'}: {each['msg']}", err=True)
        raise typer.Exit(EXIT_USAGE) from error
