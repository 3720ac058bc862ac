"""What a LeRobot dataset has already of a recording: no event of one comes into it twice. No I/O."""

from collections.abc import Sequence
from typing import NamedTuple

from lockstep.protocol.serial import event_gap
from lockstep.server.recording.export.lerobot_meta import DatasetEpisode
from lockstep.server.recording.export.lerobot_rows import Stretch

__all__ = ["Present", "present"]


class Present(NamedTuple):
    """What a dataset has of a stretch.

    Attributes:
        episodes: of the dataset: those with its id, or with one of its events
        events: how many of its events they have, each counted once
        of: how many events it has; the last one is not counted: that makes no row
        is_same: it is in the dataset as it is
        other_task: of a whole recording that is in the dataset with another task than the chosen one; "": it is not
    """

    episodes: list[DatasetEpisode]
    events: int
    of: int
    is_same: bool
    other_task: str

    def in_words(self) -> str:
        """Return why the stretch is left out."""
        if self.is_same:
            return "the dataset has it already" + (f", with the task {self.other_task!r}" if self.other_task else "")
        names = ", ".join(dict.fromkeys(each.episode or "a whole recording" for each in self.episodes))
        return f"the dataset has {self.events} of its {self.of} events already, as {names}"


def present(episodes: Sequence[DatasetEpisode], stretch: Stretch) -> Present | None:
    """Return what the episodes of a dataset have of the stretch, under whatever id, and in whatever file it is.

    None: nothing, so that it may come into the dataset.
    """
    info, first, last = stretch.info, stretch.first_event, stretch.last_event
    own = info.recording, info.part, stretch.episode
    found: list[DatasetEpisode] = []
    shares: list[range] = []
    for each in episodes:
        shared = each.shared(info.recording, info.epoch, first, last)
        if shared or (each.recording, each.part, each.episode) == own:
            found.append(each)
            shares.append(shared)
    if not found:
        return None
    same = [each for each in found if _is_same(each, stretch)]  # several: an earlier version could write an event twice
    tasks = [each.task for each in same]
    other_task = tasks[0] if tasks and stretch.task not in tasks else ""
    return Present(found, _count(shares), event_gap(last, first), bool(same), other_task)


def _is_same(noted: DatasetEpisode, stretch: Stretch) -> bool:
    said = stretch.episode, stretch.first_event, stretch.last_event
    if (noted.episode, noted.first_event, noted.last_event) != said:
        return False
    # The task of a whole recording is chosen for the dataset; that of an episode is changed in the recording.
    return not stretch.episode or (noted.task, noted.outcome) == (stretch.task, stretch.outcome)


def _count(ranges: Sequence[range]) -> int:
    """Return how many numbers are in at least one of the ranges."""
    count = end = 0
    for each in sorted(ranges, key=lambda each: each.start):
        count += max(0, each.stop - max(each.start, end))
        end = max(end, each.stop)
    return count
