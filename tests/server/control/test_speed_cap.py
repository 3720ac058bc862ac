import math

import pytest

from lockstep.protocol.console import Report, SpeedCapMode, SpeedCapState
from lockstep.protocol.description import Axis
from lockstep.protocol.messages import Command, Feedback
from lockstep.server.control.speed_cap import REMEMBERED, STALE, WINDOW, SpeedCap, within_share
from tests.client.control.vectors import load_vectors

AXIS = Axis(name="grip", label="Grip", unit="m/s", minimum=-1.0, maximum=2.0, slew=1, brake=10, rest=0.5)


def report(delay_ms: float | None, *, wanted: bool = False, armed: bool = True) -> Report:
    return Report(event=1, armed=armed, picture_delay_ms=delay_ms, speed_cap=wanted)


def cap_with(delay_ms: float | None, mode: SpeedCapMode = "on") -> SpeedCap:
    cap = SpeedCap(mode)
    cap.reported("ada", report(delay_ms), 0.0)
    return cap


def answer(cap: SpeedCap, *, left_at: float, came_at: float, holder: str = "ada", event: int = 1) -> None:
    cap.fed_back(Feedback(event=event, issue=1, time=0.0, axes=[0.0]), left_at)
    cap.answered(holder, event, Command(event=event + 1, issue=1, values=[0.0]), came_at)


@pytest.mark.parametrize("case", load_vectors("speed_cap.json")["shares"], ids=lambda case: str(case["delay_ms"]))
def test_the_speed_falls_with_the_reported_delay_beyond_0_2_s(case: dict[str, float]) -> None:
    assert cap_with(case["delay_ms"]).share(0.1) == pytest.approx(case["share"])


@pytest.mark.parametrize("delay_ms", [None, -1.0, math.nan])
def test_an_unknown_delay_counts_as_one_second(delay_ms: float | None) -> None:
    assert cap_with(delay_ms).share(0.0) == 0.2
    assert SpeedCap("on").share(0.0) == 0.2


def test_a_report_that_is_too_old_counts_as_unknown() -> None:
    cap = cap_with(30.0)
    assert cap.share(STALE) == 1.0
    assert cap.share(STALE + 0.01) == 0.2
    assert cap.share(math.inf) == 0.2


def test_a_report_cannot_make_the_path_look_shorter_than_the_console_sees_it() -> None:
    cap = cap_with(30.0)
    answer(cap, left_at=0.0, came_at=0.4)
    assert cap.delay(0.4) == pytest.approx(0.4)
    assert cap.share(0.4) == pytest.approx(0.5)


def test_an_operator_who_waits_before_answering_is_not_taken_for_far_away() -> None:
    cap = cap_with(30.0)
    answer(cap, left_at=0.0, came_at=1.0)
    answer(cap, left_at=1.0, came_at=1.05, event=2)
    assert cap.delay(1.05) == pytest.approx(0.05)
    cap.reported("ada", report(30.0), 1.05 + WINDOW)
    assert cap.delay(1.06 + WINDOW) == pytest.approx(0.03)


def test_an_answer_to_a_feedback_that_is_not_remembered_says_nothing() -> None:
    cap = cap_with(30.0)
    for event in range(1, REMEMBERED + 2):
        cap.fed_back(Feedback(event=event, issue=1, time=0.0, axes=[]), 0.0)
    cap.answered("ada", 1, Command(event=2, issue=1, values=[]), 1.0)
    assert cap.delay(1.0) == pytest.approx(0.03)
    cap.answered("ada", REMEMBERED + 1, Command(event=2, issue=1, values=[], nonce=7), 1.0)
    assert cap.delay(1.0) == pytest.approx(0.03), "it names another feedback"
    cap.forget()
    cap.answered("ada", REMEMBERED, Command(event=2, issue=1, values=[]), 1.0)
    assert cap.delay(1.0) == pytest.approx(0.03)


def test_what_one_holder_reported_does_not_count_for_the_next() -> None:
    cap = cap_with(30.0)
    answer(cap, left_at=0.0, came_at=0.01, holder="bob")
    assert cap.share(0.01) == 0.2
    cap.reported("bob", report(30.0), 0.02)
    assert cap.share(0.02) == 1.0


def test_the_mode_says_whether_the_cap_holds() -> None:
    assert cap_with(1000.0, "off").share(0.0) == 1.0
    operator = cap_with(1000.0, "operator")
    assert operator.share(0.0) == 1.0
    operator.reported("ada", report(1000.0, wanted=True), 0.0)
    assert operator.share(0.0) == 0.2
    assert cap_with(1000.0, "on").share(0.0) == 0.2


def test_values_are_clamped_around_rest_and_never_past_it() -> None:
    assert [within_share(AXIS, value, 0.2) for value in (-9.0, 0.4, 0.5, 0.6, 9.0)] == pytest.approx(
        [0.2, 0.4, 0.5, 0.6, 0.8]
    )
    assert within_share(AXIS, 9.0, 1.0) == 2.0
    assert within_share(AXIS, -9.0, 1.0) == -1.0


def test_what_everyone_is_told() -> None:
    cap = SpeedCap("on")
    assert cap.state(0.0) == SpeedCapState(mode="on", holds=True)
    cap.reported("ada", report(None), 0.0)
    assert cap.state(0.0) == SpeedCapState(mode="on", holds=True, share=0.2, why="unknown")
    cap.reported("ada", report(400.0), 0.0)
    assert cap.state(0.0) == SpeedCapState(mode="on", holds=True, share=0.5, delay_ms=400, why="delay")
    cap.reported("ada", report(40.0), 0.0)
    assert cap.state(0.0) == SpeedCapState(mode="on", holds=True, share=1.0, delay_ms=40)
    assert cap_with(400.0, "operator").state(0.0) == SpeedCapState(mode="operator")


def test_only_changes_worth_telling_are_news() -> None:
    cap = cap_with(400.0)
    assert cap.news(0.0) is not None
    assert cap.news(0.0) is None
    cap.reported("ada", report(410.0), 0.0)
    assert cap.news(0.0) is None
    cap.reported("ada", report(500.0), 0.0)
    news = cap.news(0.0)
    assert news is not None
    assert news.share == 0.4
