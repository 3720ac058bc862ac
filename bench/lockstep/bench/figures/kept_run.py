"""A run of a measurement that stands beside `make bench`, as bench/history/robot_networks keeps it."""

import datetime
import shlex
import sys
from collections.abc import Sequence
from typing import Any

from lockstep.bench.figures.machine import machine_facts

__all__ = ["kept_run"]


FILE = "--json"  # where the run is written: a path of this machine


def _without_file(arguments: Sequence[str]) -> list[str]:
    arguments = [each for each in arguments if not each.startswith(f"{FILE}=")]
    at = arguments.index(FILE) if FILE in arguments else len(arguments)
    return [*arguments[:at], *arguments[at + 2 :]]


def kept_run(busy: float, runs: Sequence[Any]) -> dict[str, Any]:
    """Return the runs with the date, this process' command, and the machine.

    `busy`: how much of the machine other programs used before, in %.
    """
    spec = sys.modules["__main__"].__spec__
    module = "" if spec is None else spec.name.removesuffix(".__main__")
    return {
        "at": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "command": shlex.join(["python", "-m", module, *_without_file(sys.argv[1:])]),
        "machine": machine_facts(),
        "busy_percent": round(busy),
        "runs": list(runs),
    }
