import os
from pathlib import Path

import pytest

from lockstep.robot_bridge.stop.mounts import is_in_memory


@pytest.mark.parametrize(("kind", "found"), [("tmpfs", True), ("ramfs", True), ("ext4", False), ("overlay", False)])
def test_what_is_gone_when_the_machine_is_switched_off(tmp_path: Path, kind: str, found: bool) -> None:
    device = tmp_path.stat().st_dev
    mounts = tmp_path / "mounts"
    other = "9 1 0:999 / /x rw - tmpfs none rw"
    own = f"36 35 {os.major(device)}:{os.minor(device)} / / rw,noatime shared:1 - {kind} none rw"
    mounts.write_text(f"{other}\n{own}\n")
    assert is_in_memory(tmp_path, mounts) is found


@pytest.mark.parametrize("text", ["", "\n", "no mount at all", "1 2 - tmpfs", "\0 - "])
def test_where_the_system_does_not_tell_it_is_no_memory(tmp_path: Path, text: str) -> None:
    mounts = tmp_path / "mounts"
    mounts.write_text(text)
    assert not is_in_memory(tmp_path, mounts)
    assert not is_in_memory(tmp_path, tmp_path / "none")
    assert not is_in_memory(tmp_path / "gone", mounts)
