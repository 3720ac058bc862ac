import os
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from lockstep.server.settings import Settings
from lockstep.server.state.persistent_state import open_state, state_path
from lockstep.server.util.state_dir import StateDamaged, StateDir, StateDirUnusable, default_state_dir


def test_only_the_owner_can_read_it(tmp_path: Path) -> None:
    path = tmp_path / "deep" / "state"
    directory = StateDir(path)
    directory.signing_key()
    directory.write("some.json", b"{}")
    assert path.stat().st_mode & 0o777 == 0o700
    assert {each.stat().st_mode & 0o777 for each in path.iterdir()} == {0o600}


def test_a_directory_and_a_key_that_others_could_read_are_closed(tmp_path: Path) -> None:
    directory = StateDir(tmp_path)
    directory.signing_key()
    tmp_path.chmod(0o755)
    (tmp_path / "signing.key").chmod(0o644)
    StateDir(tmp_path).signing_key()
    assert tmp_path.stat().st_mode & 0o777 == 0o700
    assert (tmp_path / "signing.key").stat().st_mode & 0o777 == 0o600


def test_the_key_stays_the_same_and_consoles_that_start_at_once_agree_on_one(tmp_path: Path) -> None:
    with ThreadPoolExecutor(8) as threads:
        keys = set(threads.map(lambda _: StateDir(tmp_path).signing_key(), range(8)))
    assert keys == {StateDir(tmp_path).signing_key()}
    assert [each.name for each in tmp_path.iterdir()] == ["signing.key"], "nothing half made is left"


@pytest.mark.parametrize("key", ["", "short", "\xff" * 8])
def test_a_key_that_is_too_short_is_refused(tmp_path: Path, key: str) -> None:
    (tmp_path / "signing.key").write_bytes(key.encode("latin-1"))
    with pytest.raises(StateDamaged):
        StateDir(tmp_path).signing_key()


def test_a_place_that_cannot_be_used_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(StateDirUnusable, match="LOCKSTEP_STATE_DIR") as refused:
        StateDir(tmp_path / "file" / "state")
    assert refused.value.path == tmp_path / "file" / "state"


def test_a_file_is_replaced_in_one_step(tmp_path: Path) -> None:
    directory = StateDir(tmp_path)
    assert directory.read("some.json") is None
    assert directory.version("some.json") is None
    versions = set()
    for data in (b"one", b"two"):
        directory.write("some.json", data)
        versions.add(directory.version("some.json"))
        assert directory.read("some.json") == data
    assert len(versions) == 2


def test_each_console_of_a_shared_directory_has_a_log_of_its_own(tmp_path: Path) -> None:
    one, other = StateDir(tmp_path), StateDir(tmp_path)
    with one.own_log("audit") as first, other.own_log("audit") as second:
        assert (first.name, second.name) == ("audit.jsonl", "audit-2.jsonl")
    with other.own_log("audit") as again:
        assert again.name == "audit.jsonl"


def test_the_place_follows_the_xdg_specification(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    assert default_state_dir() == tmp_path / "lockstep"
    monkeypatch.setenv("XDG_STATE_HOME", "not/absolute")
    assert default_state_dir() == Path("~/.local/state/lockstep").expanduser()
    assert state_path(Settings(state_dir=tmp_path)) == tmp_path


def test_a_console_without_a_usable_directory_goes_on_with_a_temporary_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    (tmp_path / "file").touch()
    settings = Settings(state_dir=tmp_path / "file" / "state")
    with pytest.raises(StateDirUnusable):
        open_state(settings)
    state = open_state(settings, fall_back=True)
    assert state.directory.path.parent == tmp_path
    assert state.access.verify(state.access.issue("observer", "x")).role == "observer"


def test_a_damaged_directory_is_never_passed_over(tmp_path: Path) -> None:
    (tmp_path / "invitations.json").write_text("rubbish")
    with pytest.raises(StateDamaged):
        open_state(Settings(state_dir=tmp_path), fall_back=True)


def test_links_outlive_a_restart_and_a_set_secret_comes_first(tmp_path: Path) -> None:
    settings = Settings(state_dir=tmp_path)
    token = open_state(settings).access.issue("observer", "x")
    assert open_state(settings).access.verify(token).name == "x"
    secret = "another secret of thirty-two bytes or more"
    with_secret = Settings(state_dir=tmp_path / "other", secret=secret)  # type: ignore[arg-type]
    open_state(with_secret)
    assert "signing.key" not in os.listdir(tmp_path / "other")


def test_what_is_there_is_read_on_a_disk_that_cannot_be_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = StateDir(tmp_path / "state").secret("a.key", lambda: b"key")

    def refuse(path: Path, mode: int) -> None:
        raise OSError(30, "Read-only file system")

    monkeypatch.setattr(Path, "chmod", refuse)
    found = StateDir(tmp_path / "state")
    assert found.secret("a.key", lambda: b"another") == made == b"key"
    assert found.read("a.key") == b"key"
