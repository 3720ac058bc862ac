"""`lockstep ros2 discover`: looks at a live graph and writes a robot's file."""

import os
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated

import typer

from lockstep.robot_bridge.errors import BridgeError, RobotUnavailable, SettingsError
from lockstep.robot_bridge.robots.other_python import link_packages, with_packages
from lockstep.robot_bridge.robots.ros2 import read_settings
from lockstep.robot_bridge.robots.ros2.discovery.terminal_questions import Ask, AskAtTerminal, TakeGuesses

if TYPE_CHECKING:
    from lockstep.robot_bridge.robots.ros2.discovery.drafting.draft import Draft

__all__ = ["ros2_app", "write"]

EXIT_FAILED = 1
EXIT_USAGE = 2
NOT_FOUND = 127  # the shell's code for a program that cannot be run

ros2_app = typer.Typer(no_args_is_help=True, pretty_exceptions_enable=False)


@ros2_app.callback()
def ros2() -> None:
    """What helps with a robot behind ROS 2 topics."""


@ros2_app.command()
def discover(
    out: Annotated[Path, typer.Option(help="The file to write.")] = Path("robot.yaml"),
    namespace: Annotated[
        str | None, typer.Option(help="The robot's namespace, such as /robot1; / takes the whole graph.")
    ] = None,
    seconds: Annotated[float, typer.Option(min=1, max=60, help="How long to listen to the topics.")] = 4.0,
    domain: Annotated[int | None, typer.Option(min=0, max=232, help="ROS_DOMAIN_ID of the robot.")] = None,
    yes: Annotated[
        bool, typer.Option("--yes", help="Ask nothing: take careful guesses, and mark them in the file.")
    ] = False,
    force: Annotated[bool, typer.Option("--force", help="Replace the file if it is there.")] = False,
    robot_python: Annotated[
        str | None,
        typer.Option(
            envvar="LOCKSTEP_ROBOT_PYTHON",
            help="The Python that has ROS 2, if it is not the one that runs this command.",
        ),
    ] = None,
) -> None:
    """Look at the live ROS 2 graph and write the file that `--ros2` takes. Nothing is published; nothing moves."""
    if out.exists() and not force:
        raise _failed(f"{out} is there already: give another --out, or --force", EXIT_USAGE)
    if not out.absolute().parent.is_dir():
        raise _failed(f"there is no folder {out.parent}", EXIT_USAGE)
    if robot_python is not None:
        arguments = ["--out", str(out), "--seconds", str(seconds)]
        arguments += [] if namespace is None else ["--namespace", namespace]
        arguments += [] if domain is None else ["--domain", str(domain)]
        arguments += [flag for flag, given in (("--yes", yes), ("--force", force)) if given]
        raise typer.Exit(_run_in(robot_python, arguments))
    ask: Ask = TakeGuesses() if yes or not sys.stdin.isatty() else AskAtTerminal()
    typer.echo(f"Listening for {seconds:g} s. Nothing is published.")
    try:
        drafted = _look_and_draft(seconds, domain, namespace, ask)
        write(out, drafted)
    except RobotUnavailable as error:
        raise _failed(f"{error.detail}, or name a Python that has it with --robot-python", EXIT_FAILED) from error
    except BridgeError as error:
        raise _failed(error.detail, EXIT_USAGE if isinstance(error, SettingsError) else EXIT_FAILED) from error
    except OSError as error:
        raise _failed(str(error), EXIT_FAILED) from error
    for remark in drafted.remarks:
        typer.echo(f"  {remark}")
    checks = f"; {drafted.guesses} lines are guesses: look for CHECK" if drafted.guesses else ""
    typer.echo(f"{out} is written{checks}.")
    typer.echo(f"Now: lockstep up --ros2 {out} --robot-python {sys.executable}")


def _look_and_draft(seconds: float, domain: int | None, namespace: str | None, ask: Ask) -> "Draft":
    """Import what needs numpy last: a robot without ROS need not have it, and is told that ROS is missing."""
    from lockstep.robot_bridge.robots.ros2.discovery.graph_observer import look
    from lockstep.robot_bridge.robots.ros2.discovery.graph_side import GraphSide

    ros = GraphSide(domain)
    try:
        graph = look(ros, seconds)
    finally:
        ros.close()
    from lockstep.robot_bridge.robots.ros2.discovery.drafting.draft import draft
    from lockstep.robot_bridge.robots.ros2.discovery.meshes import MeshReader

    meshes = MeshReader()
    drafted = draft(graph, ask, namespace, domain, meshes)
    return drafted._replace(remarks=[*drafted.remarks, *(f"not drawn: {each}" for each in meshes.left_out)])


def write(out: Path, drafted: "Draft") -> None:
    """Write the file, once the bridge's own reader takes it; without the bodies if they make it too long.

    Raises:
        SettingsError: the reader does not take it; it stays beside `out` for a look.
    """
    trial = out.with_name(f"{out.name}.part")
    for text in filter(None, (drafted.text, drafted.without_bodies)):
        trial.write_text(text, encoding="utf-8")
        try:
            read_settings(trial)
        except SettingsError as error:
            failure = error
        else:
            trial.replace(out)
            return
    raise failure


def _run_in(python: str, arguments: list[str]) -> int:
    """Run the same command in another Python, which finds this package but nothing beside it."""
    with TemporaryDirectory(prefix="lockstep-bridge-") as directory:
        link_packages(Path(directory))
        environment = with_packages(os.environ, directory)
        environment.pop("LOCKSTEP_ROBOT_PYTHON", None)
        command = [python, "-m", "lockstep.robot_bridge.robots.ros2.discovery", "discover", *arguments]
        try:
            return subprocess.run(command, env=environment, check=False).returncode
        except OSError as error:
            typer.echo(f"lockstep ros2 discover: {python}: {error.strerror}", err=True)
            return NOT_FOUND


def _failed(text: str, code: int) -> typer.Exit:
    typer.echo(f"lockstep ros2 discover: {text}", err=True)
    return typer.Exit(code)
