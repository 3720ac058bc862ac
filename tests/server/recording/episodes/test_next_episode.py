"""What comes before an episode: the reset, then the count-down."""

from lockstep.server.recording.episodes.episode_history import EpisodeHistory
from lockstep.server.recording.episodes.next_episode import NextEpisode, Wanted


def made(history: EpisodeHistory, *, resets: bool = True) -> NextEpisode:
    return NextEpisode(history, countdown=3.0, resets=resets, reset_seconds=30.0)


def test_an_episode_that_is_wanted_waits_for_the_reset_and_then_for_the_count_down() -> None:
    it = made(EpisodeHistory())
    assert it.begin_reset(0.0)
    it.want("wipe", "Ada", 1.0)
    assert (it.phase, it.wanted, it.counting) == ("resetting", Wanted("wipe", "Ada"), None)
    it.end_reset("", 10.0)
    assert (it.phase, it.counting, it.seconds_left(11.0)) == ("countdown", Wanted("wipe", "Ada"), 2.0)
    it.begun()
    assert (it.phase, it.wanted) == ("idle", None)


def test_without_a_reset_the_count_down_begins_at_once() -> None:
    it = made(EpisodeHistory(), resets=False)
    assert not it.begin_reset(0.0)
    it.want("wipe", "Ada", 1.0)
    assert (it.phase, it.seconds_left(1.0), it.seconds_left(9.0)) == ("countdown", 3.0, 0.0)


def test_a_reset_is_late_after_its_time_and_what_failed_lets_nothing_begin() -> None:
    history = EpisodeHistory()
    it = made(history)
    it.begin_reset(0.0)
    it.want("wipe", "Ada", 1.0)
    assert [it.is_reset_late(now) for now in (29.9, 30.0)] == [False, True]
    it.end_reset("blocked", 30.0)
    assert (it.phase, it.wanted, history.last) == ("idle", None, "; the reset failed: blocked")


def test_cancelling_leaves_a_reset_alone_unless_it_is_asked_to() -> None:
    history = EpisodeHistory()
    it = made(history)
    it.begin_reset(0.0)
    it.cancel("x")
    assert (it.phase, history.last) == ("resetting", "")
    it.want("wipe", "Ada", 1.0)
    it.cancel()
    assert (it.phase, it.wanted, history.last) == ("resetting", None, "cancelled before it began")
    it.cancel("the robot link was lost", with_reset=True)
    assert it.phase == "idle"
