"""Adds files to a dataset so that a process or machine that ends at any moment leaves it whole. Blocks.

The new files are written into `.append/` in the dataset, synchronised, and listed in `.append/journal.json`. Then each
takes its place by a rename, in the order of the list. An append without a journal never happened; one with a journal is
completed by `recover`. Without `recover` the dataset can be read all the same: what a file needs comes before it.
"""

import os
import shutil
from collections.abc import Callable, Sequence
from pathlib import Path

import msgspec

__all__ = ["STAGE", "commit", "is_interrupted", "recover", "stage_of", "sync"]

STAGE = ".append"
JOURNAL = "journal.json"


class Journal(msgspec.Struct, frozen=True):
    files: list[str]  # paths in the dataset


_decoder = msgspec.json.Decoder(Journal)


def stage_of(root: Path) -> Path:
    """Return a new, empty directory for the files of an append. Raises OSError."""
    stage = root / STAGE
    shutil.rmtree(stage, ignore_errors=True)
    stage.mkdir(parents=True)
    return stage


def commit(root: Path, files: Sequence[str], replace: Callable[[Path, Path], None] = os.replace) -> None:
    """Let the staged files take their places. Raises OSError: nothing or all of it happens at the next `recover`."""
    stage = root / STAGE
    for file in files:
        sync(stage / file)
    for folder in {(stage / file).parent for file in files}:
        sync(folder)
    partial = stage / f"{JOURNAL}.partial"
    partial.write_bytes(msgspec.json.encode(Journal(list(files))))
    sync(partial)
    partial.replace(stage / JOURNAL)
    sync(stage)
    _complete(root, files, replace)


def recover(root: Path) -> bool:
    """Complete an append that was interrupted, or forget it; True if there was one.

    Raises:
        OSError: its files cannot be moved.
    """
    if not (root / STAGE).is_dir():
        return False
    journal = _journal(root)
    if journal is None:
        shutil.rmtree(root / STAGE)
    else:
        _complete(root, journal.files, os.replace)
    return True


def is_interrupted(root: Path) -> bool:
    """Return whether an append has begun to take its place, and has not ended."""
    return _journal(root) is not None


def _complete(root: Path, files: Sequence[str], replace: Callable[[Path, Path], None]) -> None:
    for file in files:
        source, target = root / STAGE / file, root / file
        if source.exists():  # else it was moved before the interruption
            target.parent.mkdir(parents=True, exist_ok=True)
            replace(source, target)
            sync(target.parent)
    (root / STAGE / JOURNAL).unlink()
    shutil.rmtree(root / STAGE)


def _journal(root: Path) -> Journal | None:
    try:
        journal = _decoder.decode((root / STAGE / JOURNAL).read_bytes())
    except (FileNotFoundError, msgspec.DecodeError):
        return None
    paths = [Path(file) for file in journal.files]
    inside = all(not path.is_absolute() and ".." not in path.parts for path in paths)  # whoever has written it
    return journal if inside else None


def sync(path: Path) -> None:
    """Write a file or a folder to the disk. Raises OSError."""
    number = os.open(path, os.O_RDONLY)
    try:
        os.fsync(number)
    finally:
        os.close(number)
