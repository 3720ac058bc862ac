"""The rules of episodes, without a console."""

from collections.abc import Callable
from itertools import count

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.protocol.serial import MAX_EVENT
from lockstep.server.recording.episodes.episode_core import (
    Effect,
    Ended,
    EpisodeCore,
    EpisodeRefused,
    RunReset,
    Write,
)
from lockstep.server.recording.episodes.open_episode import Place
from lockstep.server.recording.format.episodes import EpisodeBook
from lockstep.server.recording.format.records import EpisodeRecord

HERE = Place(epoch="e1", event=100, recording="r1", link=True, driver="Ada")
LATER = HERE._replace(event=150)


def core(*, countdown: float = 0.0, resets: bool = False) -> EpisodeCore:
    numbers = count(1)
    return EpisodeCore(lambda: f"id{next(numbers)}", countdown=countdown, resets=resets)


def records(effects: list[Effect]) -> list[EpisodeRecord]:
    return [each.record for each in effects if isinstance(each, Write)]


def refused(ask: Callable[[], object]) -> str:
    with pytest.raises(EpisodeRefused) as error:
        ask()
    return error.value.reason


def test_an_episode_is_kept_only_when_its_record_is_on_the_disk() -> None:
    it = core()
    (begun,) = records(it.start("stack two cubes", "Ada", HERE, 0.0))
    assert (begun.kind, begun.first_event, begun.task) == ("start", 100, "stack two cubes")
    (kept,) = records(it.keep("", "success", "Ada", LATER))
    assert (kept.kind, kept.first_event, kept.last_event, kept.outcome) == ("kept", 100, 150, "success")
    assert (it.phase, it.history.kept) == ("keeping", 0)
    assert it.on_disk("id1", 1.0) == [Ended("kept")]
    assert (it.phase, it.history.kept, it.history.last) == ("idle", 1, "episode 1 is kept")


def test_a_redone_episode_is_discarded_and_the_next_one_has_its_task() -> None:
    it = core()
    it.start("stack two cubes", "Ada", HERE, 0.0)
    first, second = records(it.redo("id1", "Ada", LATER, 1.0))
    assert (first.kind, first.episode) == ("discarded", "id1")
    assert (second.kind, second.episode, second.task, second.first_event) == ("start", "id2", "stack two cubes", 150)
    assert (it.history.discarded, it.history.number, it.phase) == (1, 2, "open")


def test_an_episode_begins_when_the_count_down_has_ended_and_not_before() -> None:
    it = core(countdown=3.0)
    assert it.start("wipe", "Ada", HERE, 10.0) == []
    assert (it.phase, it.next.seconds_left(11.0)) == ("countdown", 2.0)
    assert it.tick(HERE, 12.9) == []
    (begun,) = records(it.tick(LATER, 13.0))
    assert begun.first_event == 150


def test_discarding_in_the_count_down_cancels_it_and_leaves_no_record() -> None:
    it = core(countdown=3.0)
    it.start("wipe", "Ada", HERE, 10.0)
    assert it.discard("", "Ada", HERE, 11.0) == []
    assert it.tick(HERE, 20.0) == []
    assert (it.phase, it.history.discarded) == ("idle", 0)


@pytest.mark.parametrize("resets", [False, True])
def test_an_episode_that_was_cancelled_before_its_begin_never_begins(resets: bool) -> None:
    it = core(countdown=3.0, resets=resets)
    it.start("wipe", "Ada", HERE, 0.0)
    it.tick(HERE, 3.0)
    it.redo("", "Ada", LATER, 4.0)
    it.next.cancel("her link has ended")
    assert it.history.last == "cancelled before it began: her link has ended"
    assert it.phase == ("resetting" if resets else "idle")
    it.reset_ended("", LATER, 5.0)
    assert it.tick(LATER, 100.0) == []
    assert (it.phase, it.history.number) == ("idle", 1)


def test_the_reset_runs_after_each_episode_and_the_next_one_waits_for_it() -> None:
    it = core(resets=True)
    it.start("wipe", "Ada", HERE, 0.0)
    assert isinstance(it.discard("", "Ada", LATER, 1.0)[-1], RunReset)
    assert it.start("", "Ada", LATER, 2.0) == []
    assert it.phase == "resetting"
    (begun,) = records(it.reset_ended("", LATER, 3.0))
    assert (begun.kind, begun.task) == ("start", "wipe")


@pytest.mark.parametrize("failure", ["the arm is blocked", ""])
def test_after_a_reset_that_failed_or_took_too_long_nothing_begins(failure: str) -> None:
    it = core(resets=True)
    it.start("wipe", "Ada", HERE, 0.0)
    it.redo("", "Ada", LATER, 1.0)
    assert (it.reset_ended(failure, LATER, 2.0) if failure else it.tick(LATER, 40.0)) == []
    assert it.phase == "idle"
    assert "the reset failed" in it.history.last


def test_requests_are_refused_by_name() -> None:
    it = core()
    assert refused(lambda: it.keep("", "", "Ada", HERE)) == "no_episode"
    assert refused(lambda: it.discard("", "Ada", HERE, 0.0)) == "no_episode"
    assert refused(lambda: it.mark("", "x", "Ada", HERE)) == "no_episode"
    assert refused(lambda: it.start("", "Ada", HERE, 0.0)) == "no_task"
    assert refused(lambda: it.start("x", "Ada", HERE._replace(recording=""), 0.0)) == "recording_off"
    assert refused(lambda: it.start("x", "Ada", HERE._replace(link=False), 0.0)) == "link_down"
    it.start("x", "Ada", HERE, 0.0)
    assert refused(lambda: it.start("x", "Ada", HERE, 0.0)) == "episode_open"
    assert refused(lambda: it.keep("", "", "Ada", HERE)) == "empty"
    assert refused(lambda: it.keep("id7", "", "Ada", LATER)) == "other_episode"
    assert refused(lambda: it.discard("id7", "Ada", LATER, 0.0)) == "other_episode"


def test_a_stop_and_a_change_of_the_seat_are_marked_and_end_nothing() -> None:
    it = core()
    it.start("x", "Ada", HERE, 0.0)
    (stop,) = records(it.noted("stop 1 by Bo", LATER))
    (seat,) = records(it.noted("Bo drives (taken)", LATER._replace(driver="Bo")))
    assert [stop.kind, seat.kind, it.phase] == ["mark", "mark", "open"]
    (kept,) = records(it.keep("", "", "Bo", LATER))
    assert kept.drivers == ["Ada", "Bo"]


@pytest.mark.parametrize("why", ["epoch", "link_down", "recording_ended", "console_ended"])
def test_what_cuts_an_episode_is_named_in_its_record_and_it_cannot_be_kept_any_more(why: str) -> None:
    it = core()
    it.start("x", "Ada", HERE, 0.0)
    (cut,) = records(it.cut(why, LATER))  # type: ignore[arg-type]
    assert (cut.kind, cut.why, cut.epoch) == ("cut", why, "e1")
    assert (it.phase, it.history.cuts, it.history.kept) == ("idle", 1, 0)
    assert it.history.lost == why
    assert refused(lambda: it.keep("", "", "Ada", LATER)) == "no_episode"
    it.start("x", "Ada", HERE, 0.0)
    it.discard("", "Ada", LATER, 1.0)
    assert it.history.lost == "", "of the last one only"


def test_an_episode_whose_record_is_on_its_way_survives_the_epoch_but_not_the_disk() -> None:
    it = core()
    it.start("x", "Ada", HERE, 0.0)
    it.keep("", "", "Ada", LATER)
    assert it.cut("epoch", LATER) == []
    assert it.phase == "keeping"
    assert it.cut("recording_failed", LATER) == [Ended("cut")]
    assert (it.phase, it.history.kept, it.history.cuts) == ("idle", 0, 1)
    it.on_disk("id1", 1.0)
    assert it.history.kept == 0


def test_counts_are_those_of_one_recording() -> None:
    it = core()
    it.start("x", "Ada", HERE, 0.0)
    it.discard("", "Ada", LATER, 1.0)
    it.start("x", "Ada", HERE._replace(recording="r2"), 2.0)
    assert (it.history.number, it.history.discarded) == (1, 0)


STEPS = st.sampled_from(
    ["start", "keep", "discard", "redo", "disk", "tick", "mark", "event", "epoch", "link", "reset", "fail", "off"]
)


@given(st.lists(STEPS, max_size=60), st.booleans(), st.sampled_from([0.0, 1.0]), st.integers(1, MAX_EVENT))
def test_whatever_happens_what_is_counted_as_kept_is_what_a_reader_finds_kept(
    steps: list[str], resets: bool, countdown: float, event: int
) -> None:
    """Discarded and cut episodes are never found kept, and each episode is closed before the next one begins."""
    it, book, place, now = core(countdown=countdown, resets=resets), EpisodeBook(), HERE._replace(event=event), 0.0
    on_disk = 0
    ends: list[str] = []
    for step in steps:
        now += 0.6
        effects: list[Effect] = []
        try:
            match step:
                case "start":
                    effects = it.start("x", "Ada", place, now)
                case "keep":
                    effects = it.keep("", "", "Ada", place)
                case "discard":
                    effects = it.discard("", "Ada", place, now)
                case "redo":
                    effects = it.redo("", "Ada", place, now)
                case "mark":
                    effects = it.mark("", "m", "Ada", place)
                case "disk":
                    on_disk += it.phase == "keeping"
                    effects = it.on_disk(it.episode, now)
                case "tick":
                    effects = it.tick(place, now)
                case "reset":
                    effects = it.reset_ended("", place, now)
                case "event":
                    place = place._replace(event=place.event % MAX_EVENT + 1)
                case "epoch":
                    effects = it.cut("epoch", place)
                case "link":
                    place = place._replace(link=not place.link)
                    effects = it.cut("link_down", place)
                case "fail":
                    if it.phase != "keeping":  # then the file is cut to what was on the disk
                        effects = it.cut("recording_failed", place)
                case "off":
                    effects = it.cut("recording_ended", place)
        except EpisodeRefused:
            pass
        for record in records(effects):
            book.take(record, 1)
        ends += [each.end for each in effects if isinstance(each, Ended)]
    states = [each.state for each in book.entries()]
    assert states.count("kept") == on_disk + (it.phase == "keeping")
    assert states.count("open") == (it.phase == "open")
    assert len(states) >= it.history.kept + it.history.discarded
    assert [ends.count(end) for end in ("kept", "discarded", "cut")] == [
        on_disk,
        states.count("discarded"),
        states.count("cut"),
    ]
