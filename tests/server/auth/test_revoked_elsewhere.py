"""What is kept of the links that other consoles revoked."""

from pathlib import Path

import pytest

from lockstep.server.auth.revoked_elsewhere import RevokedElsewhere
from lockstep.server.util.state_dir import StateDir


def test_links_revoked_elsewhere_are_forgotten_when_they_would_have_ended_and_never_too_many(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("lockstep.server.auth.revoked_elsewhere.MAX_ELSEWHERE", 2)
    elsewhere = RevokedElsewhere(StateDir(tmp_path))
    assert elsewhere.add({"past": 999.0, "soon": 1010.0, "later": 1020.0})
    assert elsewhere.links.keys() == {"soon", "later"}
    elsewhere.write(1015.0)
    assert RevokedElsewhere(StateDir(tmp_path)).links == {"later": 1020.0}


def test_what_another_process_has_written_is_kept(tmp_path: Path) -> None:
    one, other = (RevokedElsewhere(StateDir(tmp_path)) for _ in range(2))
    one.add({"a": 2.0})
    one.write(1.0)
    other.add({"b": 3.0})
    assert other.write(1.0) == {"a": 2.0, "b": 3.0}
    assert "b" in other
    assert "a" not in other, "it hears of that from the other consoles"
