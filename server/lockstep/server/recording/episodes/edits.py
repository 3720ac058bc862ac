"""Changes to the episodes of a recording, in a file beside it: the recording itself never changes. Blocks.

`NAME.episodes.jsonl` belongs to `NAME.mcap`. Each line is one change; later lines win. Only a kept episode can be
changed: nothing makes a discarded or a cut one count.
"""

import os
from pathlib import Path

import msgspec

from lockstep.protocol.episodes import EpisodeOutcome, Task
from lockstep.protocol.serial import event_gap
from lockstep.server.recording.errors import RecordingError
from lockstep.server.recording.format.episodes import EpisodeEntry
from lockstep.server.recording.format.records import Whole

__all__ = ["EpisodeEdit", "EpisodeEditRefused", "add_edit", "edited", "edits_path", "read_edits"]

MAX_BYTES = 16 * 1024 * 1024


class EpisodeEditRefused(RecordingError):
    """This change of an episode is not allowed."""


class EpisodeEdit(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """One change. None: as before."""

    episode: str
    at: float  # s since 1970
    by: str = ""
    task: Task | None = None
    outcome: EpisodeOutcome | None = None
    first_event: Whole | None = None  # a trim; within the episode as it was recorded
    last_event: Whole | None = None
    dropped: bool | None = None  # True: it is in no dataset; False: it is again


_decoder = msgspec.json.Decoder(EpisodeEdit)


def edits_path(recording: Path) -> Path:
    return recording.with_suffix(".episodes.jsonl")


def read_edits(recording: Path) -> list[EpisodeEdit]:
    """Return the changes, oldest first. A line that cannot be read changes nothing. Raises OSError."""
    try:
        with edits_path(recording).open("rb") as file:
            lines = file.read(MAX_BYTES).splitlines()
    except FileNotFoundError:
        return []
    found = []
    for line in lines:
        try:
            found.append(_decoder.decode(line))
        except (msgspec.DecodeError, UnicodeError, RecursionError):
            continue
    return found


def add_edit(recording: Path, episodes: list[EpisodeEntry], edit: EpisodeEdit) -> list[EpisodeEntry]:
    """Add a change; return all episodes as they are then. `episodes`: as they were recorded.

    Raises:
        EpisodeEditRefused: there is no such kept episode, or the trim is not within it.
        OSError: the change cannot be written.
    """
    original = next((each for each in episodes if each.id == edit.episode), None)
    if original is None or original.state != "kept":
        raise EpisodeEditRefused(f"{recording.name} has no kept episode {edit.episode!r}")
    edits = [*read_edits(recording), edit]
    if _changed(original, edits) is None:
        raise EpisodeEditRefused(f"a trim stays within the events {original.first_event} to {original.last_event}")
    path = edits_path(recording)
    is_new = not path.exists()
    with path.open("ab") as file:
        # A line that a crash has cut short ends here.
        file.write((b"" if is_new else b"\n") + msgspec.json.encode(edit) + b"\n")
        file.flush()
        os.fsync(file.fileno())
    return edited(episodes, edits)


def edited(episodes: list[EpisodeEntry], edits: list[EpisodeEdit]) -> list[EpisodeEntry]:
    """Return the episodes with the changes. A trim that is not within the episode changes nothing."""
    return [
        each if each.state != "kept" else _changed(each, [edit for edit in edits if edit.episode == each.id]) or each
        for each in episodes
    ]


def _changed(original: EpisodeEntry, edits: list[EpisodeEdit]) -> EpisodeEntry | None:
    """Return the kept episode with the changes that are of it; None if they trim it to something else."""
    now = original
    for edit in edits:
        if edit.episode != original.id:
            continue
        now = msgspec.structs.replace(
            now,
            task=now.task if edit.task is None else edit.task,
            outcome=now.outcome if edit.outcome is None else edit.outcome,
            first_event=now.first_event if edit.first_event is None else edit.first_event,
            last_event=now.last_event if edit.last_event is None else edit.last_event,
            state=now.state if edit.dropped is None else "discarded" if edit.dropped else "kept",
        )
    within = (
        event_gap(now.first_event, original.first_event) >= 0
        and event_gap(original.last_event, now.last_event) >= 0
        and event_gap(now.last_event, now.first_event) > 0
    )
    return now if within else None
