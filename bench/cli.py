"""`python -m bench [--json FILE|-] [--markdown FILE] [--quick] [SECTION ...]`"""

import asyncio
import json
import sys
import time
from datetime import UTC, datetime
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import typer

from bench.context import Context
from bench.machine import machine_facts
from bench.results import Result
from bench.stack import available_robots
from bench.table import render_markdown, render_table

__all__ = ["SECTIONS", "main", "measure"]

SECTIONS = ("command_to_feedback", "lossy", "capture_to_shown", "first_picture", "observers")
BUSY = 1.0  # load average above which the figures say more about the neighbours


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
    facts = machine_facts()
    if facts["load_average"] > BUSY:
        _say(
            f"this machine is busy (load average {facts['load_average']:.1f}): the figures will be worse than they are"
        )
    began = time.monotonic()
    results, failed = asyncio.run(measure(chosen, quick))
    report = {
        "machine": facts,
        "at": datetime.now(UTC).isoformat(timespec="seconds"),
        "quick": quick,
        "seconds": round(time.monotonic() - began),
        "results": [result.fields() for result in results],
        "failed": failed,
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


async def measure(sections: list[str], quick: bool) -> tuple[list[Result], dict[str, str]]:
    """The results, and why sections failed. One that fails does not keep the others from being measured."""
    context = Context(quick, await available_robots(), _say)
    results: list[Result] = []
    failed: dict[str, str] = {}
    for name in sections:
        _say(f"{name} …")
        try:
            results += await import_module(f"bench.sections.{name}").run(context)
        except Exception as error:
            failed[name] = _reason(error)
            _say(f"{name} failed: {failed[name]}")
    return results, failed


def _reason(error: BaseException) -> str:
    """The first cause; task groups wrap what went wrong."""
    while isinstance(error, BaseExceptionGroup):
        error = error.exceptions[0]
    return f"{type(error).__name__}: {error}"


def _say(text: str) -> None:
    print(f"bench: {text}", file=sys.stderr, flush=True)
