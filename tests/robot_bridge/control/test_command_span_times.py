"""The spans of a command at the bridge, with times that the test hands in."""

import msgspec

from lockstep.protocol.traces.trace import CommandSpans
from lockstep.robot_bridge.control.command_span_times import CommandSpanTimes


def test_a_command_waits_for_the_tick_is_applied_waits_for_the_rate_and_is_measured() -> None:
    timing = CommandSpanTimes()
    timing.executed(10.0)
    assert timing.waits_for_tick
    timing.applied(10.002, 10.0025)
    timing.applied(10.006, 10.0065)  # a further tick before its feedback
    spans = timing.measured(10.0105, 10.0115)
    assert spans == CommandSpans(tick_wait_ms=2.0, apply_ms=0.5, rate_wait_ms=8.0, measure_ms=1.0)


def test_an_event_that_is_measured_again_has_no_spans() -> None:
    timing = CommandSpanTimes()
    timing.executed(10.0)
    timing.applied(10.002, 10.003)
    timing.measured(10.003, 10.004)
    assert timing.measured(10.5, 10.6) is msgspec.UNSET
    assert not timing.waits_for_tick


def test_a_feedback_that_comes_without_a_tick_has_only_its_measurement() -> None:
    timing = CommandSpanTimes()
    timing.executed(10.0)
    assert timing.measured(10.003, 10.004) == CommandSpans(measure_ms=1.0)
