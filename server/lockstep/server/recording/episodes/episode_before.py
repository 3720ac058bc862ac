"""What became of the last episode that an earlier process of the console has recorded. Blocks.

Whoever recorded it lost the console, and asks the next process: it alone can say whether the episode is kept.
"""

from contextlib import suppress
from pathlib import Path
from typing import NamedTuple, get_args

from lockstep.protocol.episodes import EpisodeCut
from lockstep.server.recording.episodes.edits import edited, read_edits
from lockstep.server.recording.errors import RecordingError
from lockstep.server.recording.format.episodes import EpisodeEntry
from lockstep.server.recording.reading.reader import RecordingReader
from lockstep.server.recording.recording_store import RecordingStore, is_written

__all__ = ["EpisodeBefore", "episode_before"]

NEWS_SECONDS = 600.0  # then those who recorded it are taken to be gone
CUTS: tuple[EpisodeCut, ...] = get_args(EpisodeCut)


class EpisodeBefore(NamedTuple):
    """The last episode.

    Attributes:
        end: what became of it
        why: it was cut
        task: in words, as the file has it
    """

    number: int
    end: str
    why: EpisodeCut
    task: str


def episode_before(store: RecordingStore, completed: set[Path], now: float) -> EpisodeBefore | None:
    """Return the last episode of the newest recording; None: there is none, or it is older than `NEWS_SECONDS`.

    Args:
        completed: files that have just been completed: the process that wrote them was killed
        now: s since 1970
    """
    with suppress(RecordingError, OSError):
        dated = [(path.stat().st_mtime, path) for path in store.files() if not is_written(path)]
        if dated:
            _, path = max(dated)
            return _last(path, now - NEWS_SECONDS, was_killed=path in completed)
    return None


def _last(path: Path, since: float, *, was_killed: bool) -> EpisodeBefore | None:
    """Raises RecordingError, OSError."""
    with RecordingReader(path) as reader:
        if reader.index.ended < since * 1e6 or not reader.index.episodes:
            return None
        entry = edited(reader.index.episodes, read_edits(path))[-1]
    # One without an end was open when the file ended.
    why: EpisodeCut = "console_ended" if was_killed else "recording_failed"
    return EpisodeBefore(entry.number, entry.state, _why(entry) or why, entry.task)


def _why(entry: EpisodeEntry) -> EpisodeCut | None:
    return next((each for each in CUTS if each == entry.why), None)
