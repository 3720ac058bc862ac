"""What spoils an episode is said while it is recorded."""

import pytest

from lockstep.server.recording.episodes.live_checks import LiveChecks, RecorderFigures

WELL = RecorderFigures(lost=0, waiting=0.0, free_bytes=10_000_000_000, keeps_free=500_000_000)


def checks(rate: float = 10.0) -> LiveChecks:
    found = LiveChecks()
    found.begin({"front": rate}, 100, 0, 0.0)
    return found


def kinds(found: LiveChecks, event: int, now: float, recorder: RecorderFigures = WELL) -> list[str]:
    return [each.kind for each in found.problems(event, recorder, now)]


def run(found: LiveChecks, seconds: float, rate: float, lag: int = 0) -> int:
    """Pictures at that rate, one event with each; return the newest event."""
    number = 0
    for number in range(1, int(seconds * rate) + 1):
        found.picture("front", 100 + number - lag, number / rate)
        found.problems(100 + number, WELL, number / rate)
    return 100 + number


def test_an_episode_in_which_all_is_well_has_no_problem() -> None:
    found = checks()
    event = run(found, 5.0, 10.0)
    assert kinds(found, event, 5.0) == []


def test_a_camera_that_hangs_is_missing_within_a_second() -> None:
    found = checks()
    event = run(found, 5.0, 10.0)
    assert kinds(found, event, 5.9) == []
    (problem,) = found.problems(event, WELL, 6.0)
    assert (problem.kind, problem.stream, problem.text) == ("camera_missing", "front", "front: no picture for 1 s")


def test_a_camera_that_never_gave_a_picture_is_missing() -> None:
    assert kinds(checks(), 100, 1.0) == ["camera_missing"]


def test_a_camera_may_be_as_slow_as_it_is_described() -> None:
    found = checks(rate=0.5)
    found.picture("front", 101, 0.5)
    assert kinds(found, 101, 4.0) == []
    assert kinds(found, 101, 6.6) == ["camera_missing"]


def test_fewer_than_half_of_the_pictures_are_said() -> None:
    found = checks(rate=25.0)
    event = run(found, 6.0, 8.0)
    assert kinds(found, event, 6.0) == ["camera_slow"]


@pytest.mark.parametrize(("lag", "expected"), [(4, []), (5, ["camera_behind"])])
def test_pictures_beyond_the_tolerance_are_said_when_they_last(lag: int, expected: list[str]) -> None:
    found = checks()
    event = run(found, 5.0, 10.0, lag)
    assert kinds(found, event, 5.0) == expected


def test_one_late_picture_is_no_problem() -> None:
    found = checks()
    event = run(found, 5.0, 10.0)
    assert kinds(found, event + 20, 5.1) == []
    found.picture("front", event + 20, 5.2)
    assert kinds(found, event + 20, 5.7) == []


def test_lost_records_count_from_the_begin_of_the_episode() -> None:
    found = LiveChecks()
    found.begin({}, 100, 7, 0.0)
    assert kinds(found, 100, 1.0, WELL._replace(lost=7)) == []
    assert kinds(found, 100, 1.0, WELL._replace(lost=8)) == ["records_lost"]


def test_a_recorder_that_falls_behind_a_full_disk_and_an_idle_robot_are_said() -> None:
    found = LiveChecks()
    found.begin({}, 100, 0, 0.0)
    assert kinds(found, 100, 1.0, WELL._replace(waiting=0.3)) == ["recorder_behind"]
    assert kinds(found, 100, 1.0, WELL._replace(free_bytes=600_000_000)) == ["disk_low"]
    assert kinds(found, 100, 10.0) == ["no_events"]
