from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.client.media.media_gate import MediaGate, verdict
from lockstep.protocol.serial import MAX_EVENT, event_gap
from tests.client.control.vectors import load_vectors

CASES: list[dict[str, Any]] = load_vectors("gate.json")["cases"]
events = st.integers(1, 40) | st.integers(MAX_EVENT - 40, MAX_EVENT)
steps = st.lists(st.tuples(st.booleans(), events), max_size=60)


@pytest.mark.parametrize("case", CASES, ids=[case["name"] for case in CASES])
def test_the_verdict_is_that_of_the_shared_table(case: dict[str, Any]) -> None:
    decision, gap = verdict(case["feedback"], case["stamp"], case["tolerance"], case["mode"])
    assert (decision, gap) == (case["verdict"], case["gap"])


@pytest.mark.parametrize("case", CASES, ids=[case["name"] for case in CASES])
def test_a_stream_does_what_the_shared_table_says(case: dict[str, Any]) -> None:
    gate: MediaGate[str] = MediaGate(case["tolerance"], case["mode"])
    if case["feedback"] is not None:
        gate.feedback(case["feedback"])
    shown = gate.offer("medium", case["stamp"])
    counts = {"render": gate.rendered, "discard": gate.discarded, "hold": gate.held}
    assert counts == {name: int(name == case["verdict"]) for name in counts}
    assert (shown is not None) == (case["verdict"] == "render")


def test_a_held_picture_is_rendered_when_the_feedback_catches_up() -> None:
    gate: MediaGate[str] = MediaGate(2)
    gate.feedback(10)
    assert gate.offer("ahead", 15) is None
    assert gate.feedback(12) is None
    shown = gate.feedback(13)
    assert shown is not None
    assert (shown.medium, shown.gap) == ("ahead", -2)


def test_of_two_held_pictures_the_newest_waits() -> None:
    gate: MediaGate[str] = MediaGate(2)
    gate.feedback(10)
    gate.offer("first", 15)
    gate.offer("second", 16)
    shown = gate.feedback(15)
    assert shown is not None
    assert shown.medium == "second"
    assert (gate.held, gate.discarded, gate.rendered) == (2, 1, 1)


def test_a_held_picture_that_the_feedback_jumped_past_is_discarded() -> None:
    gate: MediaGate[str] = MediaGate(2)
    gate.feedback(10)
    gate.offer("ahead", 15)
    assert gate.feedback(30) is None
    assert (gate.rendered, gate.discarded) == (0, 1)


def test_a_held_picture_never_follows_a_newer_one() -> None:
    gate: MediaGate[str] = MediaGate(2)
    gate.offer("held", 3)
    gate.mode = "off"
    assert gate.offer("newer", 4) is not None
    gate.mode = "event"
    assert gate.feedback(3) is None
    assert gate.discarded == 1


def test_an_older_feedback_changes_nothing() -> None:
    gate: MediaGate[str] = MediaGate(0)
    gate.feedback(10)
    assert gate.feedback(9) is None
    shown = gate.offer("now", 10)
    assert shown is not None
    assert shown.gap == 0


def test_a_picture_that_waited_for_its_reader_is_judged_again() -> None:
    gate: MediaGate[str] = MediaGate(1)
    gate.feedback(10)
    gate.offer("now", 10)
    assert gate.check(10) == ("render", 0)
    gate.feedback(12)
    assert gate.check(10) == ("discard", 2)


@given(steps, st.integers(0, 5))
def test_nothing_outside_the_tolerance_is_ever_rendered(history: list[tuple[bool, int]], tolerance: int) -> None:
    gate: MediaGate[int] = MediaGate(tolerance)
    newest: int | None = None
    for is_feedback, event in history:
        if is_feedback:
            shown = gate.feedback(event)
            if newest is None or event_gap(event, newest) > 0:
                newest = event
        else:
            shown = gate.offer(event, event)
        if shown is not None:
            assert newest is not None
            assert abs(event_gap(newest, shown.medium)) <= tolerance
    assert gate.max_gap <= tolerance


@given(steps, st.integers(0, 5))
def test_every_medium_is_counted_once(history: list[tuple[bool, int]], tolerance: int) -> None:
    gate: MediaGate[int] = MediaGate(tolerance)
    offered = 0
    for is_feedback, event in history:
        if is_feedback:
            gate.feedback(event)
        else:
            gate.offer(event, event)
            offered += 1
    waiting = offered - gate.rendered - gate.discarded
    assert waiting in (0, 1)
    assert waiting <= gate.held


def test_without_the_gate_what_is_rendered_beyond_the_tolerance_is_counted() -> None:
    gate: MediaGate[str] = MediaGate(4, "off")
    gate.offer("before any feedback", 1)
    gate.feedback(100)
    gate.offer("within", 96)
    gate.offer("beyond", 90)
    assert (gate.rendered, gate.violations, gate.max_gap, gate.mean_gap) == (3, 1, 10, 7.0)


def test_the_rule_counts_no_violation_and_the_mean_of_what_it_renders() -> None:
    gate: MediaGate[str] = MediaGate(4)
    gate.feedback(10)
    for stamp in (10, 8, 2):
        gate.offer("medium", stamp)
    assert (gate.received, gate.violations, gate.mean_gap) == (3, 0, 1.0)


def test_the_lag_is_of_everything_that_came_since_the_last_report() -> None:
    gate: MediaGate[str] = MediaGate(4)
    gate.feedback(100)
    gate.offer("discarded", 20)
    gate.offer("rendered", 98)
    assert gate.lag == 80
    gate.reported()
    gate.offer("rendered", 99)
    assert gate.lag == 1


def test_without_a_gap_there_is_no_mean() -> None:
    gate: MediaGate[str] = MediaGate(4)
    assert gate.mean_gap is None
