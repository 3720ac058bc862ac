from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.client.control.command_gate import CommandGate
from lockstep.protocol.serial import MAX_EVENT, event_after, event_gap
from tests.client.control.vectors import load_vectors

CASES: list[dict[str, Any]] = load_vectors("pacing.json")["cases"]


def do(gate: CommandGate, action: dict[str, Any], now: float) -> None:
    match action:
        case {"feedback": [event, issue]}:
            gate.feedback(event, issue)
        case {"sent": True}:
            gate.sent(now)
        case {"refused": event}:
            gate.refused(event)
        case {"shown": stamp}:
            gate.shown(stamp)
        case {"heard": None}:
            pass  # the gate itself knows for how long nothing was heard
        case {"heard": stamp}:
            gate.heard("microphone", stamp, now)
        case _:
            assert action == {}, f"the table has an action that this test does not know: {action}"


@pytest.mark.parametrize("case", CASES, ids=[case["name"] for case in CASES])
def test_the_gate_goes_through_the_shared_table(case: dict[str, Any]) -> None:
    shortest = case["min_interval_ms"]
    calm = case.get("calm_interval_ms", shortest)
    gate = CommandGate(
        case["pacing"],
        case["tolerance"],
        shortest / 1000,
        calm_interval=calm / 1000,
        sound_tolerance=case.get("sound_tolerance", 0),
    )
    for number, step in enumerate(case["steps"]):
        now = step["at"] / 1000
        do(gate, step["do"], now)
        assert gate.state(now) == step["then"], f"step {number}"
        if "next" in step:
            assert gate.next()._asdict() == step["next"], f"step {number}"


def test_there_is_no_next_command_before_the_first_feedback() -> None:
    with pytest.raises(RuntimeError):
        CommandGate("feedback", 4, 0).next()


def test_the_first_command_does_not_wait_for_the_event_rate() -> None:
    gate = CommandGate("feedback", 4, 10.0)
    gate.feedback(1, 1)
    assert gate.opens_at(0.0) < 0
    assert gate.state(0.0) == "open"


def test_of_several_microphones_the_gate_goes_by_the_one_that_is_farthest_behind() -> None:
    gate = CommandGate("media", 4, 0.0, sound_tolerance=4)
    gate.feedback(20, 1)
    gate.shown(20)
    gate.heard("left", 20, 0.0)
    gate.heard("right", 16, 0.0)
    assert gate.state(0.1) == "sound"
    gate.heard("left", 20, 0.15)
    assert gate.state(0.21) == "open", "the other has fallen silent"


def test_a_command_that_only_lets_go_does_not_wait_for_sound() -> None:
    gate = CommandGate("feedback", 4, 0.016, calm_interval=0.04, sound_tolerance=4)
    gate.feedback(20, 1)
    gate.sent(0.0)
    gate.feedback(21, 1)
    gate.heard("microphone", 16, 0.0)
    assert (gate.opens_at(0.01), gate.opens_at(0.01, lets_go=True)) == (0.2, 0.04)
    assert (gate.state(0.04), gate.state(0.04, lets_go=True)) == ("rate", "open")


def test_nothing_waits_for_sound_that_was_too_old_for_three_seconds_until_it_is_not() -> None:
    gate = CommandGate("media", 4, 0.0, sound_tolerance=4)
    gate.feedback(20, 1)
    gate.shown(20)
    for tenth in range(31):
        gate.heard("microphone", 10, tenth / 10)
    assert gate.state(3.0) == "sound"
    gate.heard("microphone", 11, 3.1)
    assert gate.state(3.1) == "open"
    gate.heard("microphone", 17, 3.5)
    gate.heard("microphone", 12, 6.55)
    assert gate.state(6.6) == "sound"


def test_a_command_that_only_lets_go_does_not_wait_for_sound_when_media_set_the_pace() -> None:
    gate = CommandGate("media", 4, 0.0, sound_tolerance=4)
    gate.feedback(20, 1)
    gate.shown(20)
    gate.heard("microphone", 10, 0.0)
    assert (gate.state(0.0), gate.state(0.0, lets_go=True)) == ("sound", "open")


def test_an_event_waits_for_sound_no_longer_than_half_the_time_for_which_the_robot_holds_a_command() -> None:
    gate = CommandGate("feedback", 4, 0.016, calm_interval=0.04, sound_tolerance=4, hold=0.25)
    gate.feedback(20, 1)
    gate.sent(0.0)
    gate.feedback(21, 1)
    gate.heard("microphone", 16, 0.0)
    assert gate.opens_at(0.01) == 0.125


actions = st.lists(
    st.one_of(
        st.tuples(st.just("feedback"), st.integers(-3, 3)),
        st.tuples(st.just("send"), st.just(0)),
        st.tuples(st.just("refuse"), st.integers(-1, 1)),
    ),
    max_size=80,
)


@given(actions, st.sampled_from([1, 100, MAX_EVENT - 1, MAX_EVENT]))
def test_the_gate_never_sends_twice_without_an_answer_and_never_goes_back(
    history: list[tuple[str, int]], first: int
) -> None:
    gate = CommandGate("feedback", 4, 0)
    gate.feedback(first, 1)
    newest, pending, last_sent = first, None, None
    for kind, offset in history:
        if kind == "feedback":
            event = (newest + offset - 1) % MAX_EVENT + 1
            gate.feedback(event, 1)
            if event_gap(event, newest) > 0:
                newest = event
            if pending is not None and event_gap(newest, pending) >= 0:
                pending = None
        elif kind == "refuse":
            event = (event_after(newest) + offset - 1) % MAX_EVENT + 1
            gate.refused(event)
            if event == pending:
                pending = None
        elif gate.state(0) == "open":
            assert pending is None
            pending = gate.next().event
            assert pending == event_after(newest)
            assert last_sent is None or event_gap(pending, last_sent) >= 0
            last_sent = pending
            gate.sent(0)
        assert (gate.state(0) == "in_flight") == (pending is not None)
