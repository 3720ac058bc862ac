"""Puts a folder in the place of another one, so that who looks finds one of them at every moment. Linux alone."""

import ctypes
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from lockstep.server.recording.errors import DatasetRefused
from lockstep.server.recording.export.unfinished import unfinished_folder

__all__ = ["exchanged"]

AT_FDCWD, RENAME_EXCHANGE = -100, 2  # linux/fcntl.h, linux/fs.h


@contextmanager
def exchanged(place: Path) -> Iterator[Path]:
    """Give a new folder to fill, and exchange it with the one at `place` at the end, which is deleted then.

    After an error nothing has changed. What a killed process leaves, whichever of the two it is, `remove_stale` finds.

    Raises:
        DatasetRefused: the system or the file system exchanges no folders.
        OSError: the folder cannot be made.
    """
    with unfinished_folder(place) as folder:
        new = folder / place.name
        new.mkdir()
        shutil.copymode(place, new)
        yield new
        for path in [*new.rglob("*"), new]:
            if not path.is_symlink():
                _sync(path)
        _exchange(new, place)
        _sync(folder)
        _sync(place.parent)


def _exchange(one: Path, other: Path) -> None:
    try:
        rename = ctypes.CDLL(None, use_errno=True).renameat2
    except AttributeError:
        raise DatasetRefused("this system exchanges no folders") from None
    if rename(AT_FDCWD, os.fsencode(one), AT_FDCWD, os.fsencode(other), RENAME_EXCHANGE) != 0:
        why = os.strerror(ctypes.get_errno())
        raise DatasetRefused(f"{other} cannot be exchanged with a folder beside it: {why}")


def _sync(path: Path) -> None:
    number = os.open(path, os.O_RDONLY)
    try:
        os.fsync(number)
    finally:
        os.close(number)
