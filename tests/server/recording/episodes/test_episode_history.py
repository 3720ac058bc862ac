"""What became of episodes, in words and in numbers."""

from lockstep.server.recording.episodes.episode_history import EpisodeHistory


def test_the_next_process_says_what_became_of_the_last_episode_until_it_has_one_of_its_own() -> None:
    history = EpisodeHistory()
    history.begin_after("a", 3, "open", "console_ended")
    assert (history.last, history.lost) == ("episode 3 is lost: the console ended", "console_ended")
    assert (history.number, history.cuts, history.last_id) == (3, 0, "a")
    assert history.begin("r2") == 1
    history.begin_after("b", 7, "kept", "console_ended")
    assert history.number == 1, "it comes too late"
    history.keep("c", 1)
    assert (history.last, history.lost, history.kept) == ("episode 1 is kept", "", 1)
    assert history.last_id == "c"
    history.cancel("no link")
    assert history.last_id == ""


def test_an_episode_that_an_earlier_process_has_kept_or_discarded_is_not_lost_and_in_no_count() -> None:
    for end in ("kept", "discarded"):
        history = EpisodeHistory()
        history.begin_after("a", 2, end, "console_ended")
        assert (history.last, history.lost) == (f"episode 2 is {end}", "")
        assert (history.kept, history.discarded, history.cuts) == (0, 0, 0)
