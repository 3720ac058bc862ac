"""`python -m lockstep.bench [OPTIONS] [SECTION ...]`: measures Lockstep on this machine."""

import asyncio
import json
import sys
import time
from dataclasses import dataclass, field
from datetime import UTC, datetime
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import typer

from lockstep.bench.context import Context
from lockstep.bench.figures.machine import busy_percent, machine_facts
from lockstep.bench.figures.results import Result
from lockstep.bench.figures.table import render_markdown, render_table
from lockstep.bench.harness.stack import available_robots

__all__ = ["SECTIONS", "Measured", "main", "measure"]

SECTIONS = {  # in this order; the folder of each
    "command_to_feedback": "driving",
    "goals": "driving",
    "lossy": "driving",
    "gates": "driving",
    "capture_to_shown": "media",
    "traces": "media",
    "sound": "media",
    "first_picture": "media",
    "start": "costs",
    "observers": "costs",
    "relay": "costs",
    "robot_cost": "costs",
    "scene": "costs",
    "memory": "costs",
    "recording": "costs",
    "episodes_cost": "costs",
    "datagrams": "costs",
    "live_tools": "costs",
}
BUSY_PERCENT = 8.0  # of the machine, used by other processes, above which the figures say more about them
LOOK_SECONDS = 1.5  # of looking at other processes before each section


def main() -> None:
    typer.run(run)


def run(
    sections: Annotated[list[str] | None, typer.Argument(help=f"Of {', '.join(SECTIONS)}; all unless given.")] = None,
    json_to: Annotated[str, typer.Option("--json", help="Write the results there as JSON; - is standard output.")] = "",
    markdown: Annotated[Path | None, typer.Option(help="Write the tables there as Markdown.")] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Fewer samples: to see that it works.")] = False,
) -> None:
    """Measure Lockstep on this machine, everything on loopback."""
    chosen = sections or list(SECTIONS)
    unknown = [name for name in chosen if name not in SECTIONS]
    if unknown:
        raise typer.BadParameter(f"no section {', '.join(unknown)}; there are {', '.join(SECTIONS)}")
    began = time.monotonic()
    measured = asyncio.run(measure(chosen, quick))
    results, failed = measured.results, measured.failed
    report = {
        "machine": machine_facts(),
        "at": datetime.now(UTC).isoformat(timespec="seconds"),
        "quick": quick,
        "seconds": round(time.monotonic() - began),
        "results": [result.fields() for result in results],
        "failed": failed,
        "busy_percent": measured.busy_percent,
    }
    _publish(report, render_table(results), json_to)
    if markdown is not None:
        markdown.write_text(render_markdown(results))
    if failed:
        raise typer.Exit(1)


def _publish(report: dict[str, Any], table: str, json_to: str) -> None:
    print(table, file=sys.stderr if json_to == "-" else sys.stdout)
    if json_to:
        text = json.dumps(report, indent=2, ensure_ascii=False) + "\n"
        if json_to == "-":
            sys.stdout.write(text)
        else:
            Path(json_to).write_text(text)


@dataclass
class Measured:
    results: list[Result] = field(default_factory=list)
    failed: dict[str, str] = field(default_factory=dict)  # reason by section
    busy_percent: dict[str, float] = field(default_factory=dict)  # by section: used by other processes before it


async def measure(sections: list[str], quick: bool) -> Measured:
    """Measure the sections; one that fails does not keep the others from being measured."""
    context = Context(quick, await available_robots(), _say)
    measured = Measured()
    for name in sections:
        measured.busy_percent[name] = busy = round(await busy_percent(LOOK_SECONDS), 1)
        neighbours = f" (others use {busy:.0f} % of this machine: too much)" if busy > BUSY_PERCENT else ""
        _say(f"{name} …{neighbours}")
        try:
            measured.results += await import_module(f"lockstep.bench.sections.{SECTIONS[name]}.{name}").run(context)
        except Exception as error:
            measured.failed[name] = _reason(error)
            _say(f"{name} failed: {measured.failed[name]}")
    return measured


def _reason(error: BaseException) -> str:
    """Describe the first cause of an error, since task groups wrap it."""
    while isinstance(error, BaseExceptionGroup):
        error = error.exceptions[0]
    return f"{type(error).__name__}: {error}"


def _say(text: str) -> None:
    print(f"bench: {text}", file=sys.stderr, flush=True)
