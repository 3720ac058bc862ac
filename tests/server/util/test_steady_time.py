import time

import pytest

from lockstep.server.util.steady_time import steady_time


def test_it_counts_while_the_machine_sleeps_where_the_system_can_tell(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(time, "clock_gettime", lambda which: 7.5 if which == time.CLOCK_BOOTTIME else 1.5)
    monkeypatch.setattr(time, "monotonic", lambda: 2.5)
    assert steady_time() == 7.5
    monkeypatch.delattr(time, "CLOCK_BOOTTIME")
    assert steady_time() == 2.5
