import gc

import pytest

import server.cli
from server.entry import main


def test_garbage_is_collected_while_the_command_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    collected: list[bool] = []
    monkeypatch.setattr(server.cli, "main", lambda: collected.append(gc.isenabled()))
    main()
    assert collected == [True]
