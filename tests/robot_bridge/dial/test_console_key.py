import os
from pathlib import Path

import pytest

from lockstep.protocol.dial_in import TRUSTED
from lockstep.protocol.errors import SecretError
from lockstep.protocol.link_secret import LinkSecret
from lockstep.robot_bridge.dial.console_key import FILE, ConsoleKey, load_key, read_key_file, save_key
from lockstep.robot_bridge.errors import NotPaired

PIN = "sha256:" + "0" * 64


def test_a_key_is_kept_for_its_owner_alone_and_read_again(tmp_path: Path) -> None:
    key = ConsoleKey(LinkSecret.draw(), PIN, "wss://host", "c0de")
    save_key(tmp_path / "new", key)
    found = load_key(tmp_path / "new")
    assert found is not None
    assert found.key.reveal() == key.key.reveal()
    assert found[1:] == key[1:]
    assert (tmp_path / "new" / FILE).stat().st_mode & 0o777 == 0o600


def test_a_key_and_the_name_of_its_file_reach_the_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    synced: list[str] = []
    fsync = os.fsync

    def watched(descriptor: int) -> None:
        synced.append(os.readlink(f"/proc/self/fd/{descriptor}"))
        fsync(descriptor)

    monkeypatch.setattr(os, "fsync", watched)
    save_key(tmp_path, ConsoleKey(LinkSecret.draw(), PIN))
    assert synced == [str(tmp_path / f"{FILE}.new"), str(tmp_path)]


def test_a_robot_that_was_never_paired_has_no_key(tmp_path: Path) -> None:
    assert load_key(tmp_path) is None


@pytest.mark.parametrize("content", [b"", b"{}", b'{"console":"","key":"short","pin":"trusted"}', b"\xff" * 9000])
def test_a_damaged_file_says_to_pair_anew(tmp_path: Path, content: bytes) -> None:
    (tmp_path / FILE).write_bytes(content)
    with pytest.raises(NotPaired, match="--pair"):
        load_key(tmp_path)


def test_a_key_file_has_the_key_and_perhaps_a_pin(tmp_path: Path) -> None:
    path, key = tmp_path / "key", LinkSecret.draw()
    path.write_text(f"\n{key.reveal()}\n")
    assert (read_key_file(path).key.reveal(), read_key_file(path).pin) == (key.reveal(), TRUSTED)
    path.write_text(f"{key.reveal()}\n{PIN}\n")
    assert read_key_file(path).pin == PIN


@pytest.mark.parametrize("content", ["", "short", f"{'k' * 40}\nnot a pin", f"{'k' * 40}\n{PIN}\nmore"])
def test_a_key_file_that_is_none_is_refused_by_name(tmp_path: Path, content: str) -> None:
    path = tmp_path / "key"
    path.write_text(content)
    with pytest.raises(SecretError):
        read_key_file(path)
