"""Puts a folder in the place of another one, so that who looks finds one of them at every moment. Linux alone."""

import ctypes
import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from lockstep.server.recording.dataset.commit import sync
from lockstep.server.recording.errors import DatasetRefused
from lockstep.server.recording.export.unfinished import unfinished_folder

__all__ = ["exchanged", "raised"]

AT_FDCWD, RENAME_EXCHANGE = -100, 2  # linux/fcntl.h, linux/fs.h


@contextmanager
def exchanged(place: Path, last: Callable[[Path], None]) -> Iterator[Path]:
    """Give a new folder to fill, and exchange it with the one at `place` at the end, which is deleted then.

    It has the folders of `place`, empty, with their owners and modes. After an error nothing has changed. What a killed
    process leaves, whichever of the two it is, `remove_stale` finds.

    Args:
        last: is called with the new folder right before the exchange, when what is in it is on the disk

    Raises:
        DatasetRefused: the system or the file system exchanges no folders, or `place` has mounts in it.
        OSError: the folder cannot be made.
    """
    if os.path.ismount(place):
        raise DatasetRefused(f"{place} is a mount, which no folder can be exchanged with")
    with unfinished_folder(place) as folder:
        _try(folder)
        new = folder / place.name
        _copy_folders(place, new)
        yield new
        _sync_written(new)
        last(new)
        _exchange(new, place)
        with suppress(OSError):  # it has happened: whoever called reads the new one
            sync(folder)
            sync(place.parent)


def _try(folder: Path) -> None:
    """Raise DatasetRefused where folders cannot be exchanged, before much is written for it."""
    one, other = folder / "one", folder / "other"
    one.mkdir()
    other.mkdir()
    _exchange(one, other)
    one.rmdir()
    other.rmdir()


def _exchange(one: Path, other: Path) -> None:
    try:
        rename = ctypes.CDLL(None, use_errno=True).renameat2
    except AttributeError:
        raise DatasetRefused("this system exchanges no folders") from None
    if rename(AT_FDCWD, os.fsencode(one), AT_FDCWD, os.fsencode(other), RENAME_EXCHANGE) != 0:
        why = os.strerror(ctypes.get_errno())
        raise DatasetRefused(f"{other} cannot be exchanged with a folder beside it: {why}")


def _copy_folders(place: Path, new: Path) -> None:
    device = place.stat().st_dev
    for folder, _, _ in os.walk(place, onerror=raised):
        copy = new / Path(folder).relative_to(place)
        copy.mkdir()
        found = os.stat(folder)
        if found.st_dev != device or (Path(folder) != place and os.path.ismount(folder)):
            raise DatasetRefused(f"{folder} is a mount, which cannot be moved")
        with suppress(PermissionError):  # only root gives a folder to somebody else
            os.chown(copy, found.st_uid, found.st_gid)
        shutil.copymode(folder, copy)


def _sync_written(new: Path) -> None:
    """Synchronise the folders and the files in them that are no links to old ones."""
    for folder, _, names in os.walk(new, onerror=raised):
        for name in names:
            path = Path(folder) / name
            if path.is_file() and not path.is_symlink() and path.stat().st_nlink == 1:
                sync(path)
        sync(Path(folder))


def raised(error: OSError) -> None:
    """Raise it: for `os.walk`, which leaves out what it cannot read."""
    raise error
