"""The command `episodes`: lists the episodes of a recording, and changes them in a file beside it."""

import sys
import time
from collections.abc import Iterable
from datetime import datetime
from enum import StrEnum
from pathlib import Path
from typing import Annotated, NamedTuple

import msgspec
import typer

from lockstep.server.cli.access.access import MakeSettings
from lockstep.server.cli.option_group import with_options
from lockstep.server.cli.options import RobotOption, StateDirOption
from lockstep.server.cli.recordings.choosing import OUTCOMES, EpisodeChoice, OutcomeWord
from lockstep.server.cli.recordings.recordings import DirectoryOption, recording_file, recording_store
from lockstep.server.recording.episodes.edits import EpisodeEdit, EpisodeEditRefused, add_edit, edited, read_edits
from lockstep.server.recording.episodes.episode_filter import EpisodeFilter
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
from lockstep.server.recording.recording_store import RecordingStore, entry_of
from lockstep.server.util.display_names import escaped, printable

__all__ = ["add_episode_command"]

EXIT_USAGE = 2
MAX_TIME = 4e9  # s since 1970


class StateWord(StrEnum):
    OPEN = "open"
    KEPT = "kept"
    DISCARDED = "discarded"
    CUT = "cut"


def add_episode_command(app: typer.Typer, make_settings: MakeSettings) -> None:
    """Add the command. `make_settings` turns flags into settings, as for the other commands."""

    @app.command()
    @with_options(EpisodeChoice)
    def episodes(
        file: Annotated[
            Path | None, typer.Argument(help="A recording: its file, or its id. Unset: all in the directory.")
        ] = None,
        edit: Annotated[str, typer.Option(help="Change the episode with this id, or number.")] = "",
        task: Annotated[str | None, typer.Option(help="Its task, in words.")] = None,
        outcome: Annotated[OutcomeWord | None, typer.Option(help="Its outcome.")] = None,
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
        only_state: Annotated[list[StateWord] | None, typer.Option(help="List only episodes in this state.")] = None,
        as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
        *,
        options: EpisodeChoice,
    ) -> None:
        """List episodes, of a recording or of all; change them in a file beside it. The recording never changes."""
        settings = make_settings(state_dir=state_dir)
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
        chosen = _Choice(options.filter(), only_state or [])
        if file is None:
            if change.kinds or edit or changes or after is not None:
                raise _usage("name the recording whose episodes to change, or whose changes to list")
            try:
                _list_all(recording_store(settings, robot, directory), chosen, as_json=as_json)
            except OSError as error:
                raise _usage(str(error)) from error
            return
        path = recording_file(file, settings, robot, directory)
        if chosen and (change.kinds or edit or changes):
            raise _usage("--only-… chooses the episodes that are listed; --edit names the one to change")
        if after is not None and not change.kinds:
            raise _usage("--after goes with a change")
        try:
            found = _found(path, edit, change, after)
        except (RecordingError, OSError, msgspec.ValidationError) as error:
            raise _usage(str(error)) from error
        listed = chosen.of(found.episodes)
        if as_json:
            told = found.changes if changes else listed
            sys.stdout.write(msgspec.json.encode(told).decode() + "\n")
        else:
            _write(map(_change_line, found.changes) if changes else map(_line, listed))
        if not (changes or listed):
            typer.echo(f"lockstep: {_none(chosen)} in {escaped(path)}", err=True)


class _Choice(NamedTuple):
    """Which episodes are listed."""

    only: EpisodeFilter
    states: list[StateWord]

    def __bool__(self) -> bool:
        return bool(self.only or self.states)

    def of(self, episodes: list[ListedEpisode]) -> list[ListedEpisode]:
        states = self.states or list(StateWord)
        return [each for each in episodes if each.state in states and not self.only.why_not(each)]


def _list_all(store: RecordingStore, chosen: _Choice, *, as_json: bool) -> None:
    """List the episodes of all recordings, oldest first, also of one that is written; say which cannot be read."""
    found = []
    for path in sorted(store.files(), key=lambda each: each.name):
        try:
            of_one = _found(path, "", EpisodeEdit(at=0.0), None)
        except (RecordingError, OSError) as error:
            typer.echo(f"lockstep: {escaped(error)}", err=True)
            continue
        if listed := chosen.of(of_one.episodes):
            found.append(msgspec.structs.replace(of_one, episodes=listed))
    if as_json:
        sys.stdout.write(msgspec.json.encode(found).decode() + "\n")
    else:
        for recording in sorted(found, key=lambda each: each.info.started):
            sys.stdout.write(printable(recording.info.id) + "\n")
            _write(map(_line, recording.episodes))
    if not found:
        typer.echo(f"lockstep: {_none(chosen)} in {escaped(store.directory)}", err=True)


def _none(chosen: _Choice) -> str:
    return "no episode that was asked for" if chosen else "no episode"


def _write(lines: Iterable[str]) -> None:
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
