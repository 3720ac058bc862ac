"""Compares the episodes of a dataset with those of the recordings that they come from, as they are by now. Blocks."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from lockstep.server.recording.errors import RecordingError
from lockstep.server.recording.export.lerobot_meta import DatasetEpisode
from lockstep.server.recording.export.lerobot_rows import episodes_now
from lockstep.server.recording.format.episodes import EpisodeEntry
from lockstep.server.recording.format.event_index import EventIndex
from lockstep.server.recording.reading.reader import RecordingReader

__all__ = ["RecordedNow", "outdated", "recorded_now"]

Part = tuple[str, int, str]  # recording, part, epoch
# The episodes with all changes, of each file that says it is that part: a copy may lack the changes, or be stale. None:
# such a file cannot be read to its end.
RecordedNow = Mapping[Part, Sequence[Sequence[EpisodeEntry] | None]]


def outdated(episode: DatasetEpisode, recorded: RecordedNow) -> str:
    """Return how an episode of a dataset differs from the recordings by now; "" if it does not. No I/O."""
    files = recorded.get((episode.recording, episode.part, episode.epoch), (None,))
    return next(filter(None, (_outdated(episode, entries) for entries in files)), "")


def _outdated(episode: DatasetEpisode, entries: Sequence[EpisodeEntry] | None) -> str:
    name = f"episode {episode.episode} of {episode.recording}" if episode.episode else f"all of {episode.recording}"
    if entries is None:
        return f"{name}: the recording is not there, or cannot be read"
    if not episode.episode:
        return f"{name}: the recording has episodes" if entries else ""
    now = next((each for each in entries if each.id == episode.episode), None)
    if now is None:
        return f"{name} was split, merged, or put together again"
    if now.state != "kept":
        return f"{name} is {now.state}"
    pairs = {
        "first event": (episode.first_event, now.first_event),
        "last event": (episode.last_event, now.last_event),
        "task": (episode.task, now.task),
        "outcome": (episode.outcome or "not said", now.outcome or "not said"),
    }
    changes = [f"{what} {old} is {new}" for what, (old, new) in pairs.items() if old != new]
    return f"{name} was changed: {', '.join(changes)}" if changes else ""


def recorded_now(folder: Path, episodes: Sequence[DatasetEpisode]) -> RecordedNow:
    """Read the episodes of those recordings in the folder that the dataset's come from. Raises OSError: no folder."""
    wanted = {each.recording for each in episodes}
    paths = sorted(path for path in folder.iterdir() if path.suffix == ".mcap")
    found: dict[Part, list[Sequence[EpisodeEntry] | None]] = {}
    for path in paths:
        for part, entries in _read(path, wanted):
            found.setdefault(part, []).append(entries)
    return found


def _read(path: Path, wanted: set[str]) -> Iterator[tuple[Part, Sequence[EpisodeEntry] | None]]:
    try:
        with RecordingReader(path, EventIndex()) as head:
            info = head.info
    except (RecordingError, OSError):
        return  # whoever asks for its episodes says that it cannot be read
    if info.recording not in wanted:
        return
    try:
        with RecordingReader(path) as reader:
            entries: Sequence[EpisodeEntry] | None = [each.entry for each in episodes_now(reader)]
    except (RecordingError, OSError):
        entries = None
    yield (info.recording, info.part, info.epoch), entries
