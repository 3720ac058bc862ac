"""Which pictures may stand beside a state."""

import pytest

from lockstep.client.media.stream import Picture
from lockstep.client.pipe.observation import REFRESH, Kept, unfit, unfit_state
from lockstep.protocol.messages import Feedback


def kept(stamp: int | None, arrived: float = 10.0) -> Kept:
    return Kept(Picture("front", stamp, None, None), arrived)  # type: ignore[arg-type]


def feedback(event: int) -> Feedback:
    return Feedback(event=event, issue=1, time=0.0, axes=[0.0])


@pytest.mark.parametrize("stamp", [96, 100, 104])
def test_a_picture_within_the_tolerance_belongs_to_the_state(stamp: int) -> None:
    assert unfit(feedback(100), kept(stamp), 4, 0.5, 10.4) == ""


@pytest.mark.parametrize("stamp", [95, 105])
def test_a_picture_that_the_gate_would_refuse_now_is_none(stamp: int) -> None:
    assert "events behind" in unfit(feedback(100), kept(stamp), 4, 0.5, 10.4)


def test_a_picture_that_froze_is_none_though_no_events_happen() -> None:
    assert "0.60 s old" in unfit(feedback(100), kept(100), 4, 0.5, 10.6)


def test_without_feedback_or_picture_there_is_no_pair() -> None:
    assert "feedback" in unfit(None, kept(1), 4, 0.5, 10.0)
    assert "picture" in unfit(feedback(1), None, 4, 0.5, 10.0)


def test_a_state_that_froze_is_none_though_no_picture_goes_with_it() -> None:
    assert unfit_state(feedback(1), 10.0, 0.5, 10.5 + REFRESH) == ""
    assert "1.10 s old" in unfit_state(feedback(1), 10.0, 0.5, 11.1)
    assert "no feedback" in unfit_state(None, float("-inf"), 0.5, 10.0)


def test_a_state_with_unknown_parts_is_none() -> None:
    unknown = Feedback(event=1, issue=1, time=0.0, axes=[0.0], unknown=["elbow"])
    assert "elbow" in unfit_state(unknown, 10.0, 0.5, 10.0)
