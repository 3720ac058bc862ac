"""Exports that are not finished. A folder of each is held by a lock: what a killed export leaves is known by that.

`.NAME.partial-XXXXXXXX/` beside the export's place has the file `lockstep-export.lock` and the export itself. The lock
of a process ends with it, however it ends, so a folder whose lock is free has no owner. A folder without that file is
somebody else's.
"""

import fcntl
import os
import re
import shutil
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

__all__ = ["LOCK", "remove_stale", "stale_folders", "unfinished", "unfinished_file", "unfinished_folder"]

LOCK = "lockstep-export.lock"
FOLDER = re.compile(r"\.(?P<name>.+)\.partial-\w+")


@contextmanager
def unfinished(target: Path) -> Iterator[Path]:
    """Give a path to write to, which is not there yet, and move what was written to `target` at the end.

    After an error nothing is left. What killed exports to the same place have left is removed first.

    Raises:
        OSError: the folder cannot be made, or the target cannot take its place.
    """
    with unfinished_folder(target) as folder:
        yield folder / target.name
        (folder / target.name).rename(target)


@contextmanager
def unfinished_folder(target: Path) -> Iterator[Path]:
    """Give the folder of what is unfinished, with a lock in it, and remove it at the end with what is left there.

    What killed exports to the same place have left is removed first.

    Raises:
        OSError: the folder cannot be made.
    """
    target.parent.mkdir(parents=True, exist_ok=True)
    remove_stale(target.parent, target.name)
    folder = Path(tempfile.mkdtemp(prefix=f".{target.name}.partial-", dir=target.parent))
    try:
        # It gets its name when it is locked: nobody finds it without an owner.
        with tempfile.NamedTemporaryFile(dir=folder, delete=False) as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            os.rename(lock.name, folder / LOCK)
            try:
                yield folder
            finally:
                _delete(folder)
    except BaseException:
        _delete(folder)
        raise


@contextmanager
def unfinished_file(target: Path) -> Iterator[Path]:
    """As `unfinished`, for one file: it takes the place of a file of its name, and of none before it is whole.

    A link stays, and the file that it leads to is replaced. What is no file, such as `/dev/stdout`, is written itself.
    """
    place = target.resolve() if target.is_symlink() else target
    if place.exists() and not (place.is_file() or place.is_dir()):
        yield place
        return
    with unfinished(place) as partial:
        yield partial


def stale_folders(directory: Path, name: str | None = None) -> list[Path]:
    """Return the unfinished folders in a directory that no process owns. `name`: of the export; None: of any.

    Raises:
        OSError: the directory cannot be read.
    """
    found = []
    for path in directory.iterdir():
        known = FOLDER.fullmatch(path.name)
        if known is not None and name in (None, known["name"]) and not path.is_symlink() and _is_free(path / LOCK):
            found.append(path)
    return sorted(found)


def remove_stale(directory: Path, name: str | None = None) -> list[Path]:
    """Remove the unfinished folders that no process owns, and return those that were removed. Raises OSError."""
    removed = []
    for path in stale_folders(directory, name):
        _delete(path)
        if not path.exists():
            removed.append(path)
    return removed


def _delete(folder: Path) -> None:
    """Delete the folder, its lock last: whatever ends this before, what is left is known by the lock."""
    with suppress(FileNotFoundError):
        for path in folder.iterdir():
            if path.name == LOCK:
                continue
            if path.is_dir() and not path.is_symlink():
                shutil.rmtree(path, ignore_errors=True)
            else:
                with suppress(OSError):
                    path.unlink()
    with suppress(OSError):
        if [path.name for path in folder.iterdir()] == [LOCK]:
            (folder / LOCK).unlink()
        folder.rmdir()


def _is_free(lock: Path) -> bool:
    """Return whether the lock is there, a file, and no process holds it."""
    with suppress(OSError):
        number = os.open(lock, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
        try:
            if not stat.S_ISREG(os.fstat(number).st_mode):
                return False
            fcntl.flock(number, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        else:
            return True
        finally:
            os.close(number)
    return False
