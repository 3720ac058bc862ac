"""A dataset on a disk that is full: nothing half-written is in it, and it goes on when there is room again."""

import os
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from lockstep.bench.episodes.small_disk import small_disk
from lockstep.server.recording.export import export_lerobot
from lockstep.server.recording.verify.verify_dataset import verify_dataset
from tests.server.recording.dataset.growing_file import GrowingFile
from tests.server.recording.dataset.test_appending import events_of, follower
from tests.server.recording.test_episode_export import KEPT_AND_NOT, recording

pytestmark = pytest.mark.skipif(os.geteuid() != 0, reason="only root can mount a small disk")

SIZE = 4 << 20
BLOCK = 4096


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[Path]:
    folder = tmp_path / "disk"
    folder.mkdir()
    with small_disk(folder, SIZE):
        yield folder


def fill(disk: Path, free: int) -> Path:
    """Leave so many bytes free; return the file that takes the others."""
    ballast = disk / "ballast"
    ballast.write_bytes(bytes(shutil.disk_usage(disk).free - free))
    return ballast


@pytest.mark.parametrize("free", [0, 2 * BLOCK, 8 * BLOCK])
def test_an_export_to_a_full_disk_ends_with_an_error_and_leaves_no_dataset(
    tmp_path: Path, disk: Path, free: int
) -> None:
    path = recording(tmp_path / "a.mcap", *KEPT_AND_NOT)
    ballast = fill(disk, free)
    with pytest.raises(OSError, match="No space left|cannot be written"):
        export_lerobot.export(path, disk / "dataset", "")
    assert [each.name for each in disk.iterdir()] == [ballast.name]
    ballast.unlink()
    (root,) = export_lerobot.export(path, disk / "dataset", "")
    assert verify_dataset(root).ok


@pytest.mark.parametrize("free", [0, 2 * BLOCK, 8 * BLOCK])
def test_an_episode_that_finds_the_disk_full_is_appended_when_there_is_room_again(
    tmp_path: Path, disk: Path, free: int
) -> None:
    file, root, said = GrowingFile(tmp_path / "a.mcap", KEPT_AND_NOT), disk / "dataset", list[str]()
    following = follower(root, said)
    file.write_until(44)
    assert following.look([file.path]) == 1
    ballast = fill(disk, free)
    file.write_until(100)
    for _ in range(2):
        assert following.look([file.path]) == 0
        assert said[-1].startswith("dataset cannot be written, and is tried again: ")
        assert events_of(root) == [[*range(10, 20)]]
        assert verify_dataset(root).ok
    assert sum("tried again" in each for each in said) == 1
    ballast.unlink()
    assert following.look([file.path]) == 1
    assert events_of(root) == [[*range(10, 20)], [*range(45, 60)]]
    assert verify_dataset(root).ok
