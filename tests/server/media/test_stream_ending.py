from lockstep.server.media.stream_ending import StreamEnding


def test_the_first_failure_is_told_once_and_to_who_listens_late_at_once() -> None:
    ending, told = StreamEnding(), list[str]()
    ending.on_failed(lambda stage, error: told.append(stage))
    ending.fail("media", RuntimeError())
    ending.fail("forget", RuntimeError())
    assert told == ["media"]
    ending.on_failed(lambda stage, error: told.append(f"late: {stage}"))
    assert told == ["media", "late: media"]


def test_the_end_is_told_and_to_who_listens_late_at_once() -> None:
    ending, told = StreamEnding(), list[str]()
    ending.on_ended(lambda: told.append("in time"))
    assert told == []
    ending.end()
    ending.on_ended(lambda: told.append("late"))
    assert told == ["in time", "late"]
