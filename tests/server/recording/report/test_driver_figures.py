from typing import Literal

import pytest

from lockstep.protocol.console import DriverKind, ShadowJudgement
from lockstep.protocol.episodes import EpisodeOutcome
from lockstep.server.recording.format.episodes import EpisodeEntry
from lockstep.server.recording.format.records import FeedbackRecord, ShadowRecord
from lockstep.server.recording.report.driver_figures import MOST, DriverTally, Outcomes


def _event(tally: DriverTally, event: int, name: str, kind: DriverKind, *, intervention: bool = False) -> None:
    tally.take(
        FeedbackRecord(
            epoch="e", event=event, issue=1, time=0.5 * event, axes=[0.0], driver=name, driver_kind=kind,
            intervention=intervention,
        )
    )  # fmt: skip


def _episode(
    first: int, last: int, outcome: EpisodeOutcome = "", state: Literal["kept", "discarded", "cut"] = "kept"
) -> EpisodeEntry:
    return EpisodeEntry(
        id=f"{first}", number=1, state=state, task="t", outcome=outcome, first_event=first, last_event=last,
        started=first, ended=last,
    )  # fmt: skip


def _shadow(tally: DriverTally, judgement: ShadowJudgement, difference: float | None, kind: DriverKind) -> None:
    tally.take(
        ShadowRecord(
            epoch="e", event=1, peer="p", name="net", values=[0.0], judgement=judgement, difference=difference,
            driver_kind=kind,
        )
    )  # fmt: skip


def test_interventions_are_spells_for_each_minute_of_episodes_with_a_policy() -> None:
    tally = DriverTally()
    _event(tally, 1, "", "none")
    for event in range(2, 62):  # 30 s
        corrects = event in (10, 11, 12, 40)
        _event(tally, event, *(("Ada", "human") if corrects else ("net", "policy")), intervention=corrects)
    tally.take_episodes([_episode(1, 61, "success")])
    assert tally.interventions == 2
    assert tally.policy_seconds == pytest.approx(30)
    assert tally.interventions_per_minute == pytest.approx(4)
    assert tally.outcomes == {"policy net corrected": Outcomes(success=1)}
    assert (tally.drivers["Ada", "human"].events, tally.drivers["Ada", "human"].intervention_events) == (4, 4)
    assert tally.drivers["net", "policy"].seconds == pytest.approx(28)


def test_success_is_told_by_driver_and_what_nobody_said_counts_for_neither() -> None:
    tally = DriverTally()
    net: tuple[str, DriverKind] = ("net", "policy")
    driven: list[tuple[str, DriverKind]] = [("Ada", "human"), net, net, net, net, net]
    for number, (name, kind) in enumerate(driven):
        _event(tally, 10 * number + 2, name, kind)
    tally.take_episodes(
        [
            _episode(1, 9, "success"),
            _episode(11, 19, "success"),
            _episode(21, 29, "failure"),
            _episode(31, 39),
            _episode(41, 49, "success", "discarded"),
            _episode(51, 59, "success", "cut"),
        ]
    )
    assert tally.outcomes == {"Ada": Outcomes(success=1), "policy net alone": Outcomes(1, 1, 1)}
    assert tally.outcomes["policy net alone"].share == 0.5
    assert tally.interventions == 0


def test_the_event_in_which_an_episode_begins_was_driven_before_it() -> None:
    tally = DriverTally()
    for event, name in ((2**31 - 2, "Grace"), (2**31 - 1, "Grace"), (1, "Ada"), (2, "Ada"), (3, "Grace")):
        _event(tally, event, name, "human")
    tally.take_episodes([_episode(2**31 - 1, 2, "failure")])
    assert tally.outcomes == {"Ada": Outcomes(failure=1)}


def test_all_events_of_an_episode_of_a_dataset_count() -> None:
    tally = DriverTally()
    for name in ("net", "other"):
        _event(tally, 5, name, "policy")
        _event(tally, 6, name, "policy")
        tally.take_episode("success")
    assert tally.outcomes == {"policy net alone": Outcomes(success=1), "policy other alone": Outcomes(success=1)}


def test_a_shadow_is_compared_with_people_alone_and_never_agrees_out_of_limits() -> None:
    tally = DriverTally()
    for judgement, difference, kind in (
        ("in_time", 0.05, "human"),
        ("in_time", 0.06, "human"),
        ("out_of_limits", 0.01, "human"),
        ("in_time", 0.0, "policy"),
        ("late", None, "none"),
    ):
        _shadow(tally, judgement, difference, kind)  # type: ignore[arg-type]
    shadow = tally.shadows["net"]
    assert (shadow.compared, shadow.agreed) == (3, 1)
    assert shadow.judgements == {"in_time": 3, "out_of_limits": 1, "late": 1}


def test_names_are_bounded() -> None:
    tally = DriverTally()
    for event in range(2, 2 + 2 * MOST):
        _event(tally, event, f"{event}", "policy")
    assert len(tally.drivers) == MOST


def test_a_pause_is_no_time_of_driving() -> None:
    tally = DriverTally()
    _event(tally, 2, "Ada", "human")
    _event(tally, 1000, "Ada", "human")
    assert tally.drivers["Ada", "human"].seconds == 2.0
