"""What is noted of revocations while the disk is full."""

from pathlib import Path

import pytest

from lockstep.server.auth.directory_lock import DirectoryLock
from lockstep.server.auth.unwritten_revocations import UnwrittenRevocations
from lockstep.server.util.state_dir import StateDir, StateDirUnusable


@pytest.fixture
def directory(tmp_path: Path) -> StateDir:
    return StateDir(tmp_path)


def _unwritten(directory: StateDir) -> UnwrittenRevocations:
    return UnwrittenRevocations(directory, DirectoryLock(directory))


def test_what_is_noted_another_process_hears_of_once_and_what_is_written_is_forgotten(directory: StateDir) -> None:
    here, there = _unwritten(directory), _unwritten(directory)
    here.reserve()
    assert not here
    for link in ("a", "b"):
        here.add(link)
    here.note()
    assert there.look() == {"a", "b"}
    assert there.look() == set()
    there.written(frozenset("a"))
    assert there.links == {"b"}
    assert _unwritten(directory).look() == {"b"}
    assert here.links == {"a", "b"}, "it writes them itself"


def test_more_than_was_set_aside_for_revocations_is_not_said_to_be_noted(directory: StateDir) -> None:
    unwritten = _unwritten(directory)
    with pytest.raises(StateDirUnusable):
        unwritten.note()  # nothing was set aside yet
    unwritten.reserve()
    for number in range(300):
        unwritten.add(f"{number:016x}")
    with pytest.raises(StateDirUnusable, match="too many"):
        unwritten.note()
