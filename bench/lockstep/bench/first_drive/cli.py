"""`python -m lockstep.bench.first_drive`: how long the ways of two tutorials take, from the first command to driving.

A person who reads takes longer; what is installed already is not installed again.
"""

import asyncio
import json
import os
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

import typer

from lockstep.bench.figures.kept_run import kept_run
from lockstep.bench.figures.machine import busy_percent
from lockstep.bench.first_drive.run import drive_discovered, drive_template

__all__ = ["app"]

LOOK_SECONDS = 1.5
NODE = Path("docs", "examples", "ros2", "turtlebot.py")

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)


@app.command()
def first_drive(
    ros_python: Annotated[
        str, typer.Option(help="The Python of a ROS 2 installation; unset: the way with ROS is left out.")
    ] = "",
    node: Annotated[Path, typer.Option(help="A program for that Python that plays a ROS 2 robot.")] = NODE,
) -> None:
    """Drive a robot of one's own from the template, and one behind ROS 2 whose file is written from its topics."""
    busy = asyncio.run(busy_percent(LOOK_SECONDS))
    found: list[dict[str, object]] = []
    with TemporaryDirectory(prefix="lockstep-first-drive-") as folder:
        found.append({"way": "template", "seconds": asyncio.run(drive_template(Path(folder), _say))})
    if ros_python:
        if os.sep in ros_python:  # the terminal works in a folder of its own
            ros_python = os.path.abspath(ros_python)
        with TemporaryDirectory(prefix="lockstep-first-drive-") as folder:
            seconds = asyncio.run(drive_discovered(Path(folder), ros_python, node.resolve(), _say))
            found.append({"way": "ros2 discover", "seconds": seconds})
    print(json.dumps(kept_run(busy, found), indent=1))


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)
