from lockstep.bench.fleet_soak.progress import Progress
from lockstep.bench.harness.event_log import Record


def _executed(event: int, time: float) -> Record:
    return {"kind": "executed", "event": event, "time": time}


def test_numbers_that_follow_each_other_leave_nothing_out() -> None:
    progress = Progress()
    progress.read([_executed(2, 1.0), _executed(3, 1.5), _executed(4, 1.6)])
    assert (progress.skipped, progress.longest_pause, progress.pause_ended) == (0, 0.5, 1.5)


def test_a_number_left_out_or_repeated_is_counted() -> None:
    progress = Progress()
    progress.read([_executed(2, 1.0), _executed(4, 1.1), _executed(4, 1.2)])
    assert progress.skipped == 2


def test_between_two_lives_nothing_pauses_and_numbers_begin_anew() -> None:
    progress = Progress()
    progress.read([_executed(7, 1.0), {"kind": "start"}, _executed(2, 9.0), {"kind": "feedback"}, _executed(3, 9.1)])
    assert progress.skipped == 0
    assert round(progress.longest_pause, 6) == 0.1
