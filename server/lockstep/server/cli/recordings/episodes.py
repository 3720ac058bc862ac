"""The command `episodes`: lists the episodes of a recording, and changes them in a file beside it."""

import sys
import time
from pathlib import Path
from typing import Annotated

import msgspec
import typer

from lockstep.protocol.episodes import EpisodeOutcome
from lockstep.protocol.serial import event_gap
from lockstep.server.cli.access.access import MakeSettings
from lockstep.server.cli.options import RobotOption, StateDirOption
from lockstep.server.cli.recordings.recordings import DirectoryOption, File, recording_file
from lockstep.server.recording.episodes.edits import EpisodeEdit, add_edit, edited, read_edits
from lockstep.server.recording.errors import RecordingError
from lockstep.server.recording.export.lerobot_rows import episodes_of
from lockstep.server.recording.format.episodes import EpisodeEntry
from lockstep.server.recording.reading.reader import RecordingReader
from lockstep.server.util.display_names import escaped, printable

__all__ = ["add_episode_command"]

EXIT_USAGE = 2
OUTCOMES: dict[str, EpisodeOutcome] = {"success": "success", "failure": "failure", "none": ""}


def add_episode_command(app: typer.Typer, make_settings: MakeSettings) -> None:
    """Add the command. `make_settings` turns flags into settings, as for the other commands."""

    @app.command()
    def episodes(
        file: File,
        edit: Annotated[str, typer.Option(help="Change the episode with this id, or number.")] = "",
        task: Annotated[str | None, typer.Option(help="Its task, in words.")] = None,
        outcome: Annotated[str | None, typer.Option(help="success, failure or none.")] = None,
        first: Annotated[int | None, typer.Option(help="Trim: its first event.")] = None,
        last: Annotated[int | None, typer.Option(help="Trim: its last event.")] = None,
        drop: Annotated[bool | None, typer.Option("--drop/--undrop", help="Take it out of datasets; back in.")] = None,
        directory: DirectoryOption = None,
        robot: RobotOption = "",
        state_dir: StateDirOption = None,
        as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
    ) -> None:
        """List the episodes of a recording; change them in a file beside it. The recording never changes."""
        path = recording_file(file, make_settings(state_dir=state_dir), robot, directory)
        if outcome is not None and outcome not in OUTCOMES:
            raise _usage("--outcome is success, failure or none")
        try:
            found = _found(path, edit, task, outcome, first, last, drop)
        except (RecordingError, OSError, msgspec.ValidationError) as error:
            raise _usage(str(error)) from error
        if as_json:
            sys.stdout.write(msgspec.json.encode(found).decode() + "\n")
        else:
            sys.stdout.write("".join(_line(each) + "\n" for each in found))


def _found(
    path: Path,
    edit: str,
    task: str | None,
    outcome: str | None,
    first: int | None,
    last: int | None,
    drop: bool | None,
) -> list[EpisodeEntry]:
    """Return the episodes with all changes, after that of `edit`."""
    with RecordingReader(path) as reader:
        recorded = episodes_of(reader)
    if not edit:
        return edited(recorded, read_edits(path))
    named = next((each.id for each in recorded if edit in (each.id, str(each.number))), edit)
    change = EpisodeEdit(
        episode=named,
        at=round(time.time(), 3),
        by="command line",
        task=task,
        outcome=None if outcome is None else OUTCOMES[outcome],
        first_event=first,
        last_event=last,
        dropped=drop,
    )
    return add_edit(path, recorded, change)


def _line(each: EpisodeEntry) -> str:
    seconds = (each.ended - each.started) / 1e6
    events = f"s={each.first_event}–{each.last_event}"
    said = " ".join(filter(None, (each.state, each.outcome, each.why)))
    troubles = f"  ({'; '.join(each.problems)})" if each.problems else ""
    count = f"{event_gap(each.last_event, each.first_event)} events"
    head = f"{each.number:4}  {printable(each.id):16}  {printable(said):22}  {seconds:6.1f} s"
    return f"{head}  {events:16} {count:>12}  {printable(each.task + troubles)}"


def _usage(text: str) -> typer.Exit:
    typer.echo(f"lockstep: {escaped(text)}", err=True)
    return typer.Exit(EXIT_USAGE)
