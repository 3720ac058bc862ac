"""`lockstep export --to lerobot --follow` and `--append`: episodes go into a dataset that is there. Needs pyarrow."""

import os
import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from types import FrameType

from lockstep.server.recording.dataset.appending import alone_with
from lockstep.server.recording.dataset.follower import DatasetFollower
from lockstep.server.recording.episodes.edits import edits_path
from lockstep.server.recording.export.export_lerobot import DatasetOptions, Say

__all__ = ["append_once", "follow"]

LOOK_SECONDS = 0.5  # between two looks at the files
EARLIER = 1.0  # s that the time of a file's change may be wrong


def append_once(paths: Sequence[Path], root: Path, options: DatasetOptions, say: Say) -> int:
    """Append all kept episodes that the dataset has not; return their number. Raises RecordingError, OSError.

    A recording that was not made by episodes is one as a whole, as in an export of all; `say` is told what was left out
    by name, and at the end how many that were.
    """
    root = root.resolve()  # a link stays one, whatever becomes of where it leads
    with alone_with(root):
        follower = DatasetFollower(root, options, say)
        follower.take_wholes(paths)
        count = follower.look(paths)
        say(f"{count} appended, {follower.left_out} left out")
        return count


def follow(
    files: Callable[[], Sequence[Path]],
    root: Path,
    options: DatasetOptions,
    say: Say,
    *,
    all_of: bool,
    begun: str = "",
) -> None:
    """Append each kept episode when it is on the disk, until the process is told to end.

    Args:
        files: returns the recordings to follow, at each look
        all_of: also the episodes that were kept before the dataset was followed for the first time
        begun: is said once the process may be told to end

    Raises:
        RecordingError: the dataset cannot be appended to, or another process does.
        OSError: it cannot be written.
    """
    _give_way()
    root = root.resolve()  # a link stays one, whatever becomes of where it leads
    with alone_with(root) as memory, _told_to_end() as ended:
        if begun:
            say(begun)
        since = 0 if all_of else _since(memory)
        follower = DatasetFollower(root, options, say)
        while True:
            with suppress(FileNotFoundError):  # the directory comes with the first recording
                follower.look([path for path in files() if _may_concern(path, since)], since)
            if ended.wait(LOOK_SECONDS):
                return


def _since(memory: Path) -> int:
    """Return when the dataset was followed first, in µs since 1970: episodes that were kept meanwhile are not lost."""
    with suppress(ValueError):
        return int(memory.read_text())
    now = time.time_ns() // 1000
    memory.write_text(str(now))
    return now


def _may_concern(path: Path, since: int) -> bool:
    """Return whether a recording may have new episodes, or changes, which may concern what the dataset has."""
    try:
        return path.stat().st_mtime >= since / 1e6 - EARLIER or edits_path(path).exists()
    except OSError:
        return False


def _give_way() -> None:
    """Run only when nobody else wants to: on this machine somebody may be driving a robot."""
    os.nice(19)
    with suppress(OSError, AttributeError):  # Linux alone
        os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))


@contextmanager
def _told_to_end() -> Iterator[threading.Event]:
    ended = threading.Event()

    def end(number: int, frame: FrameType | None) -> None:
        ended.set()

    before = {number: signal.signal(number, end) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield ended
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
