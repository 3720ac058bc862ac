"""Episodes are chosen by task, outcome, driver and problems, and each that is not says why."""

import pytest

from lockstep.server.recording.episodes.episode_filter import EpisodeFilter
from lockstep.server.recording.format.episodes import EpisodeEntry

PUSHED = EpisodeEntry(
    id="a",
    number=1,
    state="kept",
    task="push",
    outcome="success",
    first_event=1,
    last_event=9,
    started=0,
    ended=1,
    drivers=["ann", "policy-1"],
    problems=["camera_slow front"],
)


@pytest.mark.parametrize(
    ("only", "words"),
    [
        (EpisodeFilter(), ""),
        (EpisodeFilter(tasks=["pull", "push"], outcomes=["success"], drivers=["bob", "policy-1"]), ""),
        (EpisodeFilter(tasks=["pull"]), "its task is 'push'"),
        (EpisodeFilter(outcomes=["failure", ""]), "its outcome is success"),
        (EpisodeFilter(drivers=["an"]), "its drivers are ann, policy-1"),
        (EpisodeFilter(without_problems=True), "the live checks saw camera_slow front"),
    ],
)
def test_an_episode_is_chosen_by_all_that_is_named(only: EpisodeFilter, words: str) -> None:
    assert only.why_not(PUSHED) == words
    assert bool(only) == (only != EpisodeFilter())
