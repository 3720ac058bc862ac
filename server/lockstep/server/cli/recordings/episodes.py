"""The command `episodes`: lists the episodes of a recording, and changes them in a file beside it."""

import sys
import time
from datetime import datetime
from pathlib import Path
from typing import Annotated

import msgspec
import typer

from lockstep.protocol.episodes import EpisodeOutcome
from lockstep.server.cli.access.access import MakeSettings
from lockstep.server.cli.options import RobotOption, StateDirOption
from lockstep.server.cli.recordings.recordings import DirectoryOption, File, recording_file
from lockstep.server.recording.episodes.edits import EpisodeEdit, EpisodeEditRefused, add_edit, edited, read_edits
from lockstep.server.recording.episodes.episode_list import (
    EpisodeChange,
    ListedEpisode,
    RecordingEpisodes,
    listed_episodes,
)
from lockstep.server.recording.errors import RecordingError
from lockstep.server.recording.export.lerobot_rows import episodes_of
from lockstep.server.recording.format.episodes import EpisodeEntry
from lockstep.server.recording.reading.reader import RecordingReader
from lockstep.server.recording.recording_store import entry_of
from lockstep.server.util.display_names import escaped, printable

__all__ = ["add_episode_command"]

EXIT_USAGE = 2
MAX_TIME = 4e9  # s since 1970
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
        split: Annotated[int | None, typer.Option(help="Split it: the event at which the second part begins.")] = None,
        merge: Annotated[str | None, typer.Option(help="Merge it with the one behind it: its id, or number.")] = None,
        undo: Annotated[int | None, typer.Option(help="Take back the change with this number; without --edit.")] = None,
        after: Annotated[int | None, typer.Option(help="Only if the newest change has this number.")] = None,
        changes: Annotated[bool, typer.Option("--changes", help="List the changes.")] = False,
        directory: DirectoryOption = None,
        robot: RobotOption = "",
        state_dir: StateDirOption = None,
        as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
    ) -> None:
        """List the episodes of a recording; change them in a file beside it. The recording never changes."""
        path = recording_file(file, make_settings(state_dir=state_dir), robot, directory)
        if outcome is not None and outcome not in OUTCOMES:
            raise _usage("--outcome is success, failure or none")
        change = EpisodeEdit(
            at=round(time.time(), 3),
            by="command line",
            task=task,
            outcome=None if outcome is None else OUTCOMES[outcome],
            first_event=first,
            last_event=last,
            dropped=drop,
            split=split,
            merge=merge,
            undo=undo,
        )
        if change.kinds and not (edit or undo is not None):
            raise _usage("--edit names the episode to change")
        try:
            found = _found(path, edit, change, after)
        except (RecordingError, OSError, msgspec.ValidationError) as error:
            raise _usage(str(error)) from error
        if as_json:
            told = found.changes if changes else found.episodes
            sys.stdout.write(msgspec.json.encode(told).decode() + "\n")
        else:
            lines = map(_change_line, found.changes) if changes else map(_line, found.episodes)
            sys.stdout.write("".join(line + "\n" for line in lines))


def _found(path: Path, edit: str, change: EpisodeEdit, after: int | None) -> RecordingEpisodes:
    """Return the episodes with all changes, after the one that is asked for."""
    with RecordingReader(path) as reader:
        recorded = episodes_of(reader)
        if edit or change.undo is not None:
            now = edited(recorded, read_edits(path))
            merge = None if change.merge is None else _named(now, change.merge)
            episode = _named(now, edit) if edit else ""
            add_edit(path, recorded, msgspec.structs.replace(change, episode=episode, merge=merge), after)
        index = msgspec.structs.replace(reader.index, episodes=recorded)
        return listed_episodes(entry_of(path, reader.info, index), index, read_edits(path))


def _named(episodes: list[EpisodeEntry], name: str) -> str:
    """Return the id of the episode with that id or number. Raises EpisodeEditRefused."""
    found = [each.id for each in episodes if each.id == name] or [
        each.id for each in episodes if str(each.number) == name
    ]
    if len(found) > 1:
        raise EpisodeEditRefused(f"several episodes have the number {name}: name one by its id")
    return found[0] if found else name


def _change_line(each: EpisodeChange) -> str:
    at = datetime.fromtimestamp(min(max(each.at, 0.0), MAX_TIME)).astimezone().strftime("%Y-%m-%d %H:%M:%S")
    state = "undone" if each.undone else f"no effect: {each.problem}" if each.problem else ""
    words = "  ".join(printable(word) for word in (each.episode, each.text, state) if word)
    return f"{each.number:4}  {at}  {printable(each.by):16}  {words}"


def _line(each: ListedEpisode) -> str:
    seconds = (each.ended - each.started) / 1e6
    events = f"s={each.first_event}–{each.last_event}"
    said = " ".join(filter(None, (each.state, each.outcome, each.why)))
    troubles = f"  ({'; '.join(each.problems)})" if each.problems else ""
    count = f"{each.events} events"
    head = f"{each.number:4}  {printable(each.id):16}  {printable(said):22}  {seconds:6.1f} s"
    return f"{head}  {events:16} {count:>12}  {printable(each.task + troubles)}"


def _usage(text: str) -> typer.Exit:
    typer.echo(f"lockstep: {escaped(text)}", err=True)
    return typer.Exit(EXIT_USAGE)
