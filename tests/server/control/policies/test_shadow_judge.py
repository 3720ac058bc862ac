"""What shadow policies want: judged once for each event, bounded, and compared with what was done."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.protocol.console import Shadow
from lockstep.protocol.description import Axis, RobotDescription
from lockstep.protocol.messages import Command, Feedback
from lockstep.server.control.policies.shadow_judge import MAX_SHADOWS, JudgedShadow, ShadowJudge

RATE = Axis(name="x", label="x", unit="m/s", minimum=-1, maximum=1, slew=1, brake=1)
GOAL = Axis(name="j", label="j", unit="rad", minimum=-2, maximum=2, slew=1, brake=1, kind="goal", reach=1)
ROBOT = RobotDescription(name="r", label="R", axes=(RATE, GOAL))


def _feedback(event: int, issue: int = 1) -> Feedback:
    return Feedback(event=event, issue=issue, time=0.0, axes=[0.0, 0.0], goals=[None, 0.5], nonce=100 * event + issue)


def _shadow(event: int, values: list[float | None], issue: int = 1, nonce: int | None = None) -> Shadow:
    answered = 100 * (event - 1) + issue
    return Shadow(event=event, issue=issue, nonce=answered if nonce is None else nonce, values=values)


def _judge() -> ShadowJudge:
    judge = ShadowJudge()
    judge.robot_link_up(ROBOT)
    judge.feedback(_feedback(1), None)
    return judge


def _judged(values: list[float | None], done: list[float | None], **shadow: int) -> JudgedShadow:
    judge = _judge()
    assert judge.take("p", _shadow(2, values, **shadow)) is None
    [judged] = judge.feedback(_feedback(2), Command(event=2, issue=1, values=done))
    return judged


@pytest.mark.parametrize(
    ("values", "shadow", "judgement"),
    [
        ([0.5, 1.0], {}, "in_time"),
        ([0.0, None], {}, "in_time"),
        ([0.5, 1.0], {"issue": 2}, "late"),
        ([0.5, 1.0], {"nonce": 7}, "unseen"),
        ([0.5], {}, "wrong_size"),
        ([0.5, 1.0, 0.0], {}, "wrong_size"),
        ([None, 1.0], {}, "not_a_number"),
        ([math.inf, 1.0], {}, "not_a_number"),
        ([math.nan, 1.0], {}, "not_a_number"),
        ([1.5, 1.0], {}, "out_of_limits"),
        ([0.5, -2.1], {}, "out_of_limits"),
    ],
)
def test_every_judgement(values: list[float | None], shadow: dict[str, int], judgement: str) -> None:
    judged = _judged(values, [0.5, 1.0], **shadow)
    assert judged.judgement == judgement
    assert (judged.difference is None) == (judgement not in ("in_time", "out_of_limits"))


def test_the_difference_is_that_of_the_axis_furthest_apart_as_a_share_of_its_range() -> None:
    assert _judged([0.5, 1.0], [0.5, 1.0]).difference == 0.0
    assert _judged([0.5, 1.0], [0.1, 0.2]).difference == 0.2  # 0.4 of 2 m/s, 0.8 of 4 rad
    assert _judged([0.0, None], [0.0, 0.9]).difference == 0.1  # stays at its applied goal, 0.5
    assert _judged([0.0, None], [0.0, None]).difference == 0.0


def test_a_goal_axis_that_turns_on_and_on_is_compared_the_shorter_way() -> None:
    judge = ShadowJudge()
    turning = Axis(
        name="y", label="y", unit="rad", minimum=-4, maximum=4, slew=1, brake=1, kind="goal", reach=1, wrap=2 * math.pi
    )
    judge.robot_link_up(RobotDescription(name="r", label="R", axes=(turning,)))
    judge.feedback(_feedback(1), None)
    judge.take("p", _shadow(2, [math.pi - 0.1]))
    [judged] = judge.feedback(_feedback(2), Command(event=2, issue=1, values=[-math.pi + 0.1]))
    assert judged.difference == pytest.approx(0.2 / (2 * math.pi), abs=1e-4)


def test_the_newest_shadow_of_an_event_counts_and_is_judged_once() -> None:
    judge = _judge()
    for value in (0.1, 0.2, 0.3):
        assert judge.take("p", _shadow(2, [value, None])) is None
    done = Command(event=2, issue=1, values=[0.3, None])
    assert [each.difference for each in judge.feedback(_feedback(2), done)] == [0.0]
    assert judge.take("p", _shadow(2, [0.9, None])) is None, "it has come, and was judged"
    assert judge.feedback(_feedback(2, issue=2), None) == []


def test_a_shadow_that_comes_after_its_event_is_late_once_for_each_event() -> None:
    judge = _judge()
    judge.feedback(_feedback(2), Command(event=2, issue=1, values=[0.0, None]))
    late = judge.take("p", _shadow(2, [0.1, None]))
    assert isinstance(late, JudgedShadow)
    assert (late.judgement, late.difference) == ("late", None)
    for event in (1, 2):
        assert judge.take("p", _shadow(event, [0.1, None])) is None
    judge.feedback(_feedback(3), Command(event=3, issue=1, values=[0.0, None]))
    assert isinstance(judge.take("p", _shadow(3, [0.1, None])), JudgedShadow)


def test_an_event_that_nobody_executed_as_a_command_is_not_compared() -> None:
    judge = _judge()
    judge.take("p", _shadow(2, [0.1, None]))
    [judged] = judge.feedback(_feedback(2), None)
    assert judged.difference is None


def test_a_shadow_of_the_future_and_one_without_a_robot_are_refused() -> None:
    assert _judge().take("p", _shadow(3, [0.1, None])) == "out_of_order"
    assert ShadowJudge().take("p", _shadow(2, [0.1, None])) == "link_down"


def test_so_many_peers_at_once_are_judged_and_a_peer_that_is_gone_makes_room() -> None:
    judge = _judge()
    for number in range(MAX_SHADOWS):
        assert judge.take(f"p{number}", _shadow(2, [0.1, None])) is None
    assert judge.take("one more", _shadow(2, [0.1, None])) == "too_often"
    judge.gone("p0")
    assert judge.take("one more", _shadow(2, [0.1, None])) is None
    assert len(judge.feedback(_feedback(2), None)) == MAX_SHADOWS


def test_a_new_epoch_forgets_all() -> None:
    judge = _judge()
    judge.take("p", _shadow(2, [0.1, None]))
    judge.epoch_ends()
    assert judge.take("p", _shadow(2, [0.1, None])) == "link_down"
    assert judge.feedback(_feedback(2), Command(event=2, issue=1, values=[0.0, None])) == []


numbers = st.none() | st.floats(allow_nan=True, allow_infinity=True)


@given(
    st.lists(
        st.tuples(
            st.sampled_from("pqr"),
            st.integers(1, 6),
            st.integers(1, 3),
            st.lists(numbers, max_size=3),
            st.booleans(),
        ),
        max_size=40,
    )
)
def test_whatever_policies_send_there_is_one_judgement_for_a_peer_and_event(
    steps: list[tuple[str, int, int, list[float | None], bool]],
) -> None:
    judge, event, seen = _judge(), 1, []
    for peer, of, issue, values, executes in steps:
        outcome = judge.take(peer, _shadow(of, values, issue=issue))
        if isinstance(outcome, JudgedShadow):
            seen.append((outcome.peer, outcome.shadow.event))
        if executes:
            event += 1
            done = Command(event=event, issue=1, values=[0.0, None])
            for each in judge.feedback(_feedback(event), done):
                assert each.difference is None or math.isfinite(each.difference)
                seen.append((each.peer, each.shadow.event))
    assert len(seen) == len(set(seen))
