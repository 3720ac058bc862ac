import math

import msgspec
import pytest

from lockstep.protocol.errors import MessageError
from lockstep.protocol.framing import frame
from lockstep.protocol.messages import MAX_FAULTS, Feedback, Goodbye, Hello, StopState, decode_message, encode_message
from lockstep.robot_bridge.control.feedback_fit import misfit
from lockstep.robot_bridge.link.link_session import BadInput, ClientSession
from lockstep.robot_bridge.robots.planar.description import DESCRIPTION
from tests.robot_bridge.control.goals.goal_helpers import HangingArm

FEEDBACK = Feedback(
    event=1, issue=1, time=0.0, axes=[0.0] * len(DESCRIPTION.axes), joints=[0.0] * len(DESCRIPTION.joints)
)


def changed(**changes: object) -> Feedback:
    return msgspec.structs.replace(FEEDBACK, **changes)


@pytest.mark.parametrize(
    ("feedback", "wrong"),
    [
        (FEEDBACK, ""),
        (changed(axes=[]), "a feedback with 0 axes"),
        (changed(axes=[math.nan] * len(FEEDBACK.axes)), "a feedback whose axes are not numbers"),
        (changed(joints=[0.0] * 99), "a feedback with 99 joints"),
        (changed(wrench=[1.0]), "a feedback with 1 wrench"),
        (changed(ranges=[1.0]), "a feedback with 1 ranges"),
        (changed(axes=[1e308] * len(FEEDBACK.axes)), "a feedback whose axes are not numbers"),
        (changed(axes=[9e11] * len(FEEDBACK.axes)), ""),
        (changed(axes=[-9e11] * len(FEEDBACK.axes)), ""),
        (changed(axes=[0.0, math.nan, 0.0]), "a feedback whose axes are not numbers"),
        (changed(axes=[0.0, 0.0, -math.inf]), "a feedback whose axes are not numbers"),
        (changed(axes=[math.inf, -math.inf, 0.0]), "a feedback whose axes are not numbers"),
        (changed(axes=[0.0, -1.1e12, 0.0]), "a feedback whose axes are not numbers"),
        (changed(time=math.nan), "a feedback without a time"),
        (changed(time=1e300), "a feedback without a time"),
        (changed(time=-1.0), "a feedback without a time"),
        (changed(warning=math.inf), "a feedback without a time"),
        (changed(limits=["l" * 500] * 512), "a feedback of more than 61440 bytes"),
    ],
)
def test_a_feedback_has_what_the_description_says_and_numbers_only(feedback: Feedback, wrong: str) -> None:
    assert misfit(feedback, DESCRIPTION) == wrong


@pytest.mark.parametrize(
    ("goals", "wrong"),
    [
        ([None, 0.2, 0.4, 0.0, 0.6, -0.2], ""),
        ([None, 0.2, None, 0.0, 0.6, -0.2], ""),
        ([], "a feedback with 0 goals"),
        ([0.0, 0.2, 0.4, 0.0, 0.6, -0.2], "a feedback with a goal of axis base that cannot be"),
        ([None, math.nan, 0.4, 0.0, 0.6, -0.2], "a feedback with a goal of axis shoulder that cannot be"),
        ([None, 0.2, 1e13, 0.0, 0.6, -0.2], "a feedback with a goal of axis elbow that cannot be"),
    ],
)
def test_a_feedback_has_a_goal_for_goal_axes_only(goals: list[float | None], wrong: str) -> None:
    feedback = Feedback(event=1, issue=1, time=0.0, axes=[0.0] * 6, goals=goals)
    assert misfit(feedback, HangingArm().describe()) == wrong


def test_a_robot_without_goal_axes_has_no_goals() -> None:
    assert misfit(changed(goals=[None] * len(FEEDBACK.axes)), DESCRIPTION) == "a feedback with 3 goals"


def test_a_console_takes_no_feedback_that_it_could_not_show_and_goes_on() -> None:
    session = ClientSession(0.0, "operator")
    session.receive(frame(encode_message(Hello(role="robot", epoch="e1", description=DESCRIPTION))), 0.0)
    bad = frame(encode_message(changed(axes=[math.inf] * len(FEEDBACK.axes))))
    good = frame(encode_message(FEEDBACK))
    found = session.receive(bad + good, 0.0)
    assert found == [BadInput("malformed", "a feedback whose axes are not numbers"), FEEDBACK]


@pytest.mark.parametrize(
    "feedback",
    [
        changed(faults=["f"] * (MAX_FAULTS + 1)),
        changed(faults=["f" * 501]),
        changed(limits=["l"] * 1000),
        changed(axes=[0.0] * 10_000),
        changed(stop=StopState(stopped=True, by="b" * 501)),
        changed(stop=StopState(stopped=True, reason="r" * 501)),
    ],
)
def test_a_feedback_is_bounded(feedback: Feedback) -> None:
    with pytest.raises(MessageError):
        decode_message(encode_message(feedback))


def test_a_console_does_not_go_on_with_a_robot_whose_description_makes_no_sense() -> None:
    session = ClientSession(0.0, "operator")
    description = msgspec.structs.replace(DESCRIPTION, hold=math.nan)
    (refused,) = session.receive(frame(encode_message(Hello(role="robot", epoch="e1", description=description))), 0.0)
    assert isinstance(refused, BadInput)
    assert isinstance(session.ended, Goodbye)
    assert session.ended.error == "description"
    assert "hold" in session.ended.detail
