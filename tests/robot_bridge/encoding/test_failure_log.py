import logging

import pytest

from lockstep.robot_bridge.encoding.failure_log import FailureLog
from lockstep.robot_bridge.errors import EncodingFailed


def test_every_failure_is_counted_and_the_first_that_was_not_foreseen_is_logged(
    caplog: pytest.LogCaptureFixture,
) -> None:
    counted: list[str] = []
    failures = FailureLog("front", counted.append)
    first = RuntimeError("the library has no memory")
    with caplog.at_level(logging.ERROR):
        failures.add(EncodingFailed("it is no picture"))
        assert not caplog.records
        failures.add(first)
        failures.add(RuntimeError("again"))
    assert counted == ["encoding_failed"] * 3
    assert [each.getMessage() for each in caplog.records] == [
        "stream front: the encoder failed; further failures are only counted"
    ]
    assert caplog.records[0].exc_info is not None
    assert caplog.records[0].exc_info[1] is first
