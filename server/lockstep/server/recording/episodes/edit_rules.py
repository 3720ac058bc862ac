"""The rules of changes to episodes (docs/episodes.md, "Change an episode"). No I/O.

A change has a number: its line in the file, from 1 on. Changes are applied in their order; one that is not allowed at
its place has no effect, so whatever somebody writes into the file, no discarded and no cut episode ever counts.
"""

from collections.abc import Sequence
from typing import NamedTuple

import msgspec

from lockstep.protocol.episodes import EpisodeOutcome, Task
from lockstep.protocol.serial import event_gap, is_event, is_newer
from lockstep.server.recording.format.episodes import MAX_MARKS, EpisodeEntry
from lockstep.server.recording.format.records import Whole

__all__ = ["EditedEpisode", "EditedEpisodes", "EpisodeEdit", "EditRefused", "apply_edits", "edited"]


class EditRefused(Exception):
    """A change is not allowed."""


class EpisodeEdit(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """One change: of one episode, or a split, a merge or an undo. None: as before."""

    episode: str = ""  # that is changed, split or, with the one behind it, merged
    at: float  # s since 1970
    by: str = ""
    task: Task | None = None
    outcome: EpisodeOutcome | None = None
    first_event: Whole | None = None  # a trim; within the bounds of the episode
    last_event: Whole | None = None
    dropped: bool | None = None  # True: it is in no dataset; False: it is again
    split: Whole | None = None  # the event at which the second part begins
    merge: str | None = None  # the episode behind it, which it is merged with
    undo: Whole | None = None  # number of the change that is taken back

    @property
    def kinds(self) -> int:
        """The number of different kinds of change in it; one, if it is to have an effect."""
        changes = (self.task, self.outcome, self.first_event, self.last_event, self.dropped)
        others = (self.split, self.merge, self.undo)
        return any(each is not None for each in changes) + sum(each is not None for each in others)


class EditedEpisode(NamedTuple):
    """An episode with the changes to it.

    Attributes:
        first_bound, last_bound: a trim stays within these events
        recorded: ids of the recorded episodes that it was made of
        is_dropped: it was kept, and a change has taken it out; another one can put it back
    """

    entry: EpisodeEntry
    first_bound: int
    last_bound: int
    recorded: tuple[str, ...]
    is_dropped: bool = False

    @property
    def is_editable(self) -> bool:
        return self.is_dropped or self.entry.state == "kept"


class EditedEpisodes(NamedTuple):
    """All episodes of a recording with all changes.

    Attributes:
        without_effect: why, by the number of the change
        undone: numbers of the changes that were taken back
    """

    episodes: list[EditedEpisode]
    without_effect: dict[int, str]
    undone: set[int]


def edited(episodes: list[EpisodeEntry], edits: Sequence[EpisodeEdit | None]) -> list[EpisodeEntry]:
    """Return the episodes with the changes. `edits`: by their numbers; None for a line that cannot be read."""
    return [each.entry for each in apply_edits(episodes, edits).episodes]


def apply_edits(episodes: Sequence[EpisodeEntry], edits: Sequence[EpisodeEdit | None]) -> EditedEpisodes:
    """Apply the changes to the episodes as they were recorded, which are in the order of their begin."""
    undone, without_effect = _undone(edits)
    state = _State(episodes)
    for number, edit in enumerate(edits, 1):
        if edit is None:
            without_effect[number] = "the line cannot be read"
        elif edit.undo is None and number not in undone:
            try:
                state.apply(edit, number)
            except EditRefused as refused:
                without_effect[number] = str(refused)
    return EditedEpisodes(state.episodes(), without_effect, undone)


def _undone(edits: Sequence[EpisodeEdit | None]) -> tuple[set[int], dict[int, str]]:
    """Return the numbers of the changes that were taken back, and the changes that could take nothing back."""
    undone: set[int] = set()
    without_effect: dict[int, str] = {}
    for number, edit in enumerate(edits, 1):
        if edit is None or edit.undo is None:
            continue
        target = edits[edit.undo - 1] if 1 <= edit.undo < number else None
        if edit.kinds != 1 or target is None or target.undo is not None or edit.undo in undone:
            without_effect[number] = f"there is no change {edit.undo} to take back"
        else:
            undone.add(edit.undo)
    return undone, without_effect


class _State:
    def __init__(self, recorded: Sequence[EpisodeEntry]) -> None:
        self._known = {each.id: EditedEpisode(each, each.first_event, each.last_event, (each.id,)) for each in recorded}
        self._order = list(self._known)

    def episodes(self) -> list[EditedEpisode]:
        return [self._known[each] for each in self._order]

    def apply(self, edit: EpisodeEdit, number: int) -> None:
        """Raises EditRefused."""
        if edit.kinds != 1:
            raise EditRefused("a change is of one kind" if edit.kinds else "nothing is changed")
        events = (edit.first_event, edit.last_event, edit.split)
        if not all(each is None or is_event(each) for each in events):
            raise EditRefused("an event is a number from 1 to 2147483647")
        target = self._editable(edit.episode)
        if edit.split is not None:
            self._split(target, edit.split, number)
        elif edit.merge is not None:
            self._merge(target, self._editable(edit.merge), number)
        else:
            self._change(target, edit)

    def _editable(self, id: str) -> EditedEpisode:
        found = self._known.get(id)
        if found is None or not found.is_editable:
            raise EditRefused(f"there is no kept episode {id!r:.80}")
        return found

    def _change(self, target: EditedEpisode, edit: EpisodeEdit) -> None:
        now = target.entry
        first = now.first_event if edit.first_event is None else edit.first_event
        last = now.last_event if edit.last_event is None else edit.last_event
        if is_newer(target.first_bound, first) or is_newer(last, target.last_bound) or event_gap(last, first) <= 0:
            raise EditRefused(f"a trim stays within the events {target.first_bound} to {target.last_bound}")
        if edit.task is not None and not edit.task.strip():
            raise EditRefused("a task is said in words")
        is_dropped = target.is_dropped if edit.dropped is None else edit.dropped
        entry = msgspec.structs.replace(
            now,
            task=now.task if edit.task is None else edit.task,
            outcome=now.outcome if edit.outcome is None else edit.outcome,
            first_event=first,
            last_event=last,
            state="discarded" if is_dropped else "kept",
        )
        self._known[now.id] = target._replace(entry=entry, is_dropped=is_dropped)

    def _split(self, target: EditedEpisode, event: int, number: int) -> None:
        entry = target.entry
        if event_gap(event, entry.first_event) <= 0 or event_gap(entry.last_event, event) <= 0:
            raise EditRefused(f"a split is between the events {entry.first_event} and {entry.last_event}")
        before = msgspec.structs.replace(
            entry,
            id=f"edit-{number}a",
            last_event=event,
            marks=[mark for mark in entry.marks if is_newer(event, mark[0])],
        )
        behind = msgspec.structs.replace(
            entry,
            id=f"edit-{number}b",
            first_event=event,
            marks=[mark for mark in entry.marks if not is_newer(event, mark[0])],
        )
        self._replace(
            [target],
            [target._replace(entry=before, last_bound=event), target._replace(entry=behind, first_bound=event)],
        )

    def _merge(self, first: EditedEpisode, second: EditedEpisode, number: int) -> None:
        one, other = first.entry, second.entry
        at = self._order.index(one.id)
        follows = self._order[at + 1 : at + 2] == [other.id] and event_gap(other.first_event, one.last_event) >= 0
        if not follows:
            raise EditRefused("only an episode and the one right behind it can be merged")
        if first.is_dropped or second.is_dropped:
            raise EditRefused("a discarded episode cannot be merged; restore it first")
        entry = msgspec.structs.replace(
            one,
            id=f"edit-{number}",
            outcome=one.outcome if one.outcome == other.outcome else "",
            last_event=other.last_event,
            ended=other.ended,
            drivers=list(dict.fromkeys([*one.drivers, *other.drivers])),
            problems=list(dict.fromkeys([*one.problems, *other.problems])),
            marks=[*one.marks, *other.marks][:MAX_MARKS],
        )
        recorded = tuple(dict.fromkeys([*first.recorded, *second.recorded]))
        self._replace([first, second], [EditedEpisode(entry, first.first_bound, second.last_bound, recorded)])

    def _replace(self, old: list[EditedEpisode], new: list[EditedEpisode]) -> None:
        gone = {each.entry.id for each in old}
        if any(each.entry.id in self._known and each.entry.id not in gone for each in new):
            raise EditRefused("an episode has the id that the new one would get")
        at = self._order.index(old[0].entry.id)
        self._order[at : at + len(old)] = [each.entry.id for each in new]
        for id in gone:
            del self._known[id]
        self._known |= {each.entry.id: each for each in new}
