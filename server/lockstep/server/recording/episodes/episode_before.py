"""What became of the last episode that an earlier process of the console has recorded. Blocks.

Whoever recorded it lost the console, and asks the next process: it alone can say whether the episode is kept.
"""

from contextlib import suppress
from pathlib import Path
from typing import Final, NamedTuple, get_args

from lockstep.protocol.episodes import EpisodeCut
from lockstep.server.recording.episodes.edits import edited, read_edits
from lockstep.server.recording.errors import RecordingError
from lockstep.server.recording.format.episodes import EpisodeEntry
from lockstep.server.recording.reading.reader import RecordingReader
from lockstep.server.recording.recording_store import RecordingStore, is_written

__all__ = ["EpisodeBefore", "episode_before"]

NEWS_SECONDS: Final = 600.0  # then those who recorded it are taken to be gone
MOST_FILES: Final = 8  # that are looked at: those that were changed last
CUTS: Final[tuple[EpisodeCut, ...]] = get_args(EpisodeCut)


class EpisodeBefore(NamedTuple):
    """The last episode.

    Attributes:
        state: what became of it, as in `EpisodeEntry`
        why: it is lost, if it is
        task: in words, as the file has it
    """

    id: str
    number: int
    state: str
    why: EpisodeCut
    task: str


def episode_before(store: RecordingStore, now: float) -> EpisodeBefore | None:
    """Return the last episode of all recordings; None: there is none, or they ended `NEWS_SECONDS` ago.

    Files that are written, or cannot be read, do not count.

    Args:
        now: s since 1970
    """
    found: list[tuple[int, EpisodeEntry]] = []
    with suppress(OSError):
        for path in sorted(store.files(), key=_changed)[-MOST_FILES:]:
            with suppress(RecordingError, OSError):
                if not is_written(path):
                    found += _last(path)
    ended, entry = max(found, key=lambda each: each[0], default=(0, None))
    if entry is None or ended < (now - NEWS_SECONDS) * 1e6:
        return None
    # One without an end was open when its process ended.
    why: EpisodeCut = next((each for each in CUTS if each == entry.why), "console_ended")
    return EpisodeBefore(entry.id, entry.number, entry.state, why, entry.task)


def _changed(path: Path) -> float:
    try:
        return path.stat().st_mtime
    except OSError:
        return 0.0


def _last(path: Path) -> list[tuple[int, EpisodeEntry]]:
    """Return when the recording has ended, in µs since 1970, and its last episode; nothing: it has none.

    Raises RecordingError, OSError.
    """
    with RecordingReader(path) as reader:
        episodes, ended = reader.index.episodes, reader.index.ended
    with suppress(OSError):
        episodes = edited(episodes, read_edits(path))
    return [(ended, episodes[-1])] if episodes else []
