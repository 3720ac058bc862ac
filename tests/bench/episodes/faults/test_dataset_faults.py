"""A disk is filled while others write to it."""

import os
import shutil
from pathlib import Path

import pytest

from lockstep.bench.episodes.faults.dataset_faults import leave_free
from lockstep.bench.episodes.small_disk import small_disk

SIZE = 4 << 20
LEFT = 64 << 10


@pytest.fixture
def disk(tmp_path: Path) -> Path:
    folder = tmp_path / "disk"
    folder.mkdir()
    return folder


@pytest.mark.parametrize("writes", [1, 100])
def test_what_others_write_while_a_disk_is_filled_is_taken_into_account(
    disk: Path, monkeypatch: pytest.MonkeyPatch, writes: int
) -> None:
    fallocate, count = os.posix_fallocate, 0

    def others_write_first(file: int, offset: int, size: int) -> None:
        nonlocal count
        count += 1
        if count <= writes:
            (disk / f"other-{count}").write_bytes(bytes(2 * LEFT))
        fallocate(file, offset, size)

    with small_disk(disk, SIZE):
        monkeypatch.setattr(os, "posix_fallocate", others_write_first)
        if writes > 1:
            with pytest.raises(OSError, match="No space left"):
                leave_free(disk / "ballast", LEFT)
        else:
            leave_free(disk / "ballast", LEFT)
            assert shutil.disk_usage(disk).free == LEFT
