"""What motion is bounded by goes on while the machine is suspended."""

import inspect
import sys
import time

import pytest

from lockstep.robot_bridge.bridge import Bridge
from lockstep.robot_bridge.control import clock
from lockstep.robot_bridge.watchdog.watchdog_process import watch
from lockstep.robot_bridge.watchdog.watchdog_thread import WatchdogThread


@pytest.mark.skipif(sys.platform != "linux", reason="no other platform has this clock")
def test_it_is_the_one_that_counts_suspended_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """The two clocks of a machine that was never suspended show the same: which one is read has to be seen."""
    monkeypatch.setattr(time, "clock_gettime", lambda which: 7.5 if which == time.CLOCK_BOOTTIME else 1.5)
    assert clock.now() == 7.5


@pytest.mark.parametrize("part", [Bridge, WatchdogThread, watch], ids=lambda part: part.__name__)
def test_bridge_and_watchdogs_go_by_it(part: object) -> None:
    assert callable(part)
    assert inspect.signature(part).parameters["now"].default is clock.now
