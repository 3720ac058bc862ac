"""`lockstep replay … --to LINK`: drives a robot along an episode. The client is another distribution, loaded here."""

import asyncio
import signal
import sys
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import msgspec
import typer

from lockstep.server.cli.extras import load_extra
from lockstep.server.recording.dataset.recorded_episode import (
    RecordedEpisode,
    episode_of_dataset,
    episode_of_recording,
)
from lockstep.server.recording.errors import RecordingError
from lockstep.server.util.display_names import escaped, printable

__all__ = ["replay_to"]

CLIENT = "lockstep.client"
EXIT_FAILED = 1
EXIT_USAGE = 2


def replay_to(
    path: Path,
    link: str,
    episode: int,
    pace: float,
    *,
    from_anywhere: bool,
    tls_ca: Path | None,
    as_json: bool,
    whole: bool = False,
) -> None:
    """Drive the robot behind `link` along an episode, and say how well it followed.

    Raises:
        typer.Exit: the episode cannot be read (2), or the robot did not do it (1).
    """
    if find_spec(CLIENT) is None:
        raise _failed("lockstep-client is not installed", EXIT_USAGE)
    if path.is_dir():
        load_extra("pyarrow.parquet", "export")
    try:
        is_dataset = path.is_dir()
        found = episode_of_dataset(path, episode) if is_dataset else episode_of_recording(path, episode, whole=whole)
    except (RecordingError, OSError, ImportError) as error:
        raise _failed(str(error), EXIT_USAGE) from error
    errors: Any = import_module(f"{CLIENT}.errors")
    try:
        report = asyncio.run(_replay(found, link, pace, from_anywhere=from_anywhere, tls_ca=tls_ca))
    except errors.ConsoleError as error:
        raise _failed(str(error), EXIT_FAILED) from error
    except asyncio.CancelledError as error:
        raise _failed("ended before the end of the episode; the robot rests", EXIT_FAILED) from error
    said = {"task": found.task, "rows": report.rows, "driven": report.driven, "deviation": report.deviation}
    if as_json:
        sys.stdout.write(msgspec.json.encode(said).decode() + "\n")
        return
    sys.stdout.write(f"{printable(found.task)}: {report.driven} of {report.rows} rows driven\n")
    for name, value in report.deviation.items():
        sys.stdout.write(f"  {printable(name):24} at most {value:.3g} off\n")


async def _replay(found: RecordedEpisode, link: str, pace: float, *, from_anywhere: bool, tls_ca: Path | None) -> Any:
    client, replaying = import_module(CLIENT), import_module(f"{CLIENT}.replay.replay")
    trajectory: Any = import_module(f"{CLIENT}.replay.trajectory").Trajectory(
        times=found.times,
        action_names=found.action_names,
        actions=found.actions,
        state_names=found.state_names,
        states=found.states,
        units=found.units,
    )
    task = asyncio.current_task()
    assert task is not None
    for number in (signal.SIGINT, signal.SIGTERM):
        asyncio.get_running_loop().add_signal_handler(number, task.cancel)
    async with client.Console(link, name="replay", video=False, audio=False, tls_ca=tls_ca) as console:
        return await replaying.replay(console, trajectory, pace=pace, from_anywhere=from_anywhere)


def _failed(text: str, code: int) -> typer.Exit:
    typer.echo(f"lockstep: {escaped(text)}", err=True)
    return typer.Exit(code)
