"""The episodes of one recording as a list shows them: with their changes, lengths and quality. No I/O.

A file may hold any text, so every text and every list is cut to a length that a page can show.
"""

from bisect import bisect_left
from collections.abc import Sequence
from typing import Literal

import msgspec

from lockstep.protocol.episodes import EpisodeOutcome
from lockstep.protocol.serial import event_gap
from lockstep.server.recording.episodes.edit_rules import EditedEpisode, EpisodeEdit, apply_edits
from lockstep.server.recording.format.event_index import EventIndex
from lockstep.server.recording.format.records import Whole
from lockstep.server.recording.format.topics import CAMERA
from lockstep.server.recording.recording_store import RecordingEntry

__all__ = ["EpisodeChange", "ListedEpisode", "RecordingEpisodes", "cameras_of", "listed_episodes"]

MAX_TEXT = 300  # characters
MAX_NAME = 80
MAX_ENTRIES = 20  # drivers or problems of an episode
MAX_CHANGES = 200  # the newest
MAX_CAMERAS = 16
PAUSE = 1_000_000  # µs without a new event that are worth saying

ChangeKind = Literal["relabel", "trim", "discard", "restore", "split", "merge", "undo", "several", "unreadable"]


class ListedEpisode(msgspec.Struct, frozen=True, kw_only=True):
    """One episode with the changes to it. Times in µs since 1970."""

    id: str
    number: Whole  # counts the takes of a recording; the parts of a split have that of the whole
    state: Literal["open", "kept", "discarded", "cut"]
    editable: bool
    restorable: bool  # a change has discarded it, so that another one can restore it
    task: str
    outcome: EpisodeOutcome
    first_event: Whole
    last_event: Whole
    events: Whole  # from the first to the last: the rows of a dataset, if none is left out
    first_bound: Whole  # a trim stays within
    last_bound: Whole
    started: Whole
    ended: Whole
    by: str  # who asked for it
    why: str  # it was cut
    drivers: list[str]
    problems: list[str]  # what the live checks have seen: "camera_missing front"
    marks: Whole  # number
    pause: Whole  # µs; longest time without a new event, 0 if that is below a second
    made_of: list[str]  # ids of the recorded episodes, if it is a part or a merge; else empty
    merges_with: str  # id of the one behind it, that it can be merged with; "" for none


class EpisodeChange(msgspec.Struct, frozen=True, kw_only=True):
    """One line of the file of changes."""

    number: Whole
    at: float  # s since 1970
    by: str
    kind: ChangeKind
    episode: str  # that it is about; of an undo ""
    text: str  # in words
    undone: bool
    problem: str  # why it has no effect; "" if it has one


class RecordingEpisodes(msgspec.Struct, frozen=True, kw_only=True):
    """One recording with its episodes."""

    info: RecordingEntry
    cameras: list[str]
    revision: Whole  # number of the newest change
    changes: list[EpisodeChange]  # the newest ones, oldest first
    episodes: list[ListedEpisode]
    trouble: str = ""  # why the changes cannot be read; then the episodes are as they were recorded


def cameras_of(index: EventIndex) -> list[str]:
    """Return the names of the cameras of which there are pictures."""
    names = (topic.removeprefix(CAMERA) for topic in index.keyframes if topic.startswith(CAMERA))
    return [name for name in names if len(name) <= MAX_NAME][:MAX_CAMERAS]


def listed_episodes(
    info: RecordingEntry, index: EventIndex, edits: Sequence[EpisodeEdit | None], trouble: str = ""
) -> RecordingEpisodes:
    """Return the recording's episodes, with the changes of `edits`."""
    found = apply_edits(index.episodes, edits)
    times = _Times(index)
    behind = [*found.episodes, None][1:]
    changes = [
        _change(number, edit, number in found.undone, found.without_effect.get(number, ""))
        for number, edit in enumerate(edits, 1)
        if number > len(edits) - MAX_CHANGES
    ]
    return RecordingEpisodes(
        info=msgspec.structs.replace(
            info, name=info.name[:MAX_NAME], robot=info.robot[:MAX_NAME], by=info.by[:MAX_NAME]
        ),
        cameras=cameras_of(index),
        revision=len(edits),
        changes=changes,
        episodes=[_listed(each, after, times) for each, after in zip(found.episodes, behind, strict=True)],
        trouble=trouble,
    )


def _listed(each: EditedEpisode, after: EditedEpisode | None, times: "_Times") -> ListedEpisode:
    entry = each.entry
    started, ended, pause = times.of(entry.first_event, entry.last_event)
    merges = (
        after is not None
        and entry.state == after.entry.state == "kept"
        and event_gap(after.entry.first_event, entry.last_event) >= 0
    )
    return ListedEpisode(
        id=entry.id[:MAX_NAME],
        number=entry.number,
        state=entry.state,
        editable=each.is_editable,
        restorable=each.is_dropped,
        task=entry.task[:MAX_TEXT],
        outcome=entry.outcome,
        first_event=entry.first_event,
        last_event=entry.last_event,
        events=max(0, event_gap(entry.last_event, entry.first_event)),
        first_bound=each.first_bound,
        last_bound=each.last_bound,
        started=started or entry.started,
        ended=ended or entry.ended,
        by=entry.by[:MAX_NAME],
        why=entry.why[:MAX_NAME],
        drivers=[name[:MAX_NAME] for name in entry.drivers[:MAX_ENTRIES]],
        problems=[text[:MAX_TEXT] for text in entry.problems[:MAX_ENTRIES]],
        marks=len(entry.marks),
        pause=pause,
        made_of=[id[:MAX_NAME] for id in each.recorded] if each.recorded != (entry.id,) else [],
        merges_with=after.entry.id[:MAX_NAME] if after is not None and merges else "",
    )


class _Times:
    """When events came, to a tenth of a second."""

    def __init__(self, index: EventIndex) -> None:
        self._origin = index.first_event
        self._places = [event_gap(each.event, self._origin) for each in index.events]
        self._arrived = [each.arrived for each in index.events]

    def of(self, first: int, last: int) -> tuple[int, int, int]:
        """Return begin, end, and the longest time without a new event; zeros where that is not known."""
        begin = bisect_left(self._places, event_gap(first, self._origin))
        end = bisect_left(self._places, event_gap(last, self._origin) + 1)
        within = self._arrived[begin:end]
        if not within:
            return 0, 0, 0
        pause = max((later - earlier for earlier, later in zip(within, within[1:], strict=False)), default=0)
        return within[0], within[-1], pause if pause >= PAUSE else 0


def _change(number: int, edit: EpisodeEdit | None, undone: bool, problem: str) -> EpisodeChange:
    if edit is None:
        return EpisodeChange(
            number=number,
            at=0.0,
            by="",
            kind="unreadable",
            episode="",
            text="",
            undone=False,
            problem=problem[:MAX_TEXT],
        )
    kind, text = _in_words(edit)
    return EpisodeChange(
        number=number,
        at=edit.at,
        by=edit.by[:MAX_NAME],
        kind=kind,
        episode=edit.episode[:MAX_NAME],
        text=text[:MAX_TEXT],
        undone=undone,
        problem=problem[:MAX_TEXT],
    )


def _in_words(edit: EpisodeEdit) -> tuple[ChangeKind, str]:
    if edit.undo is not None:
        return "undo", f"change {edit.undo} taken back"
    if edit.split is not None:
        return "split", f"split at event {edit.split}"
    if edit.merge is not None:
        return "merge", f"merged with {edit.merge}"
    found: list[tuple[ChangeKind, str]] = []
    if edit.task is not None:
        found.append(("relabel", f"task: {edit.task}"))
    if edit.outcome is not None:
        found.append(("relabel", f"outcome: {edit.outcome or 'none'}"))
    if edit.first_event is not None or edit.last_event is not None:
        ends = [
            f"{word} {event}"
            for word, event in (("from", edit.first_event), ("to", edit.last_event))
            if event is not None
        ]
        found.append(("trim", f"trimmed {' '.join(ends)}"))
    if edit.dropped is not None:
        found.append(("discard", "discarded") if edit.dropped else ("restore", "restored"))
    kinds = {kind for kind, _ in found}
    return (kinds.pop() if len(kinds) == 1 else "several"), "; ".join(text for _, text in found)
