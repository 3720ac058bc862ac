"""A run of a measurement that stands beside `make bench`, as bench/history/robot_networks keeps it."""

import datetime
import shlex
import sys
from collections.abc import Sequence
from typing import Any

from lockstep.bench.figures.machine import machine_facts

__all__ = ["kept_run"]

PATHS = ("--json", "--keep")  # options with a path of this machine


def _without_paths(arguments: Sequence[str]) -> list[str]:
    kept: list[str] = []
    words = iter(arguments)
    for word in words:
        if word in PATHS:
            next(words, None)
        elif not word.startswith(tuple(f"{each}=" for each in PATHS)):
            kept.append(word)
    return kept


def kept_run(busy: float, runs: Sequence[Any]) -> dict[str, Any]:
    """Return the runs with the date, this process' command, and the machine.

    `busy`: how much of the machine other programs used before, in %.
    """
    spec = sys.modules["__main__"].__spec__
    module = "" if spec is None else spec.name.removesuffix(".__main__")
    return {
        "at": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "command": shlex.join(["python", "-m", module, *_without_paths(sys.argv[1:])]),
        "machine": machine_facts(),
        "busy_percent": round(busy),
        "runs": list(runs),
    }
