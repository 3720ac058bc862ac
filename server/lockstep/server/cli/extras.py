"""Loads a module that needs an optional extra of the distribution, or says in words how to install it."""

from importlib import import_module
from typing import Any

import typer

__all__ = ["load_extra"]

OWN = "lockstep"
EXIT_USAGE = 2


def load_extra(module: str, extra: str) -> Any:
    """Import the module of this name.

    Raises:
        typer.Exit: a library of the extra is not installed; the exit code is 2.
    """
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        missing = error.name or ""
        if missing.partition(".")[0] == OWN:
            raise
        typer.echo(
            f"lockstep: this needs {missing}, which is not installed. In a checkout: "
            f".venv/bin/python -m pip install -e '.[{extra}]'",
            err=True,
        )
        raise typer.Exit(EXIT_USAGE) from error
