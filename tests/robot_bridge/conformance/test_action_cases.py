"""The cases about actions pass on the bridge, and each finds the fault that it is about."""

from collections.abc import Callable

import pytest

from lockstep.protocol.actions import ActionReason, ActionUpdate
from lockstep.robot_bridge.actions.action_core import ActionCore
from lockstep.robot_bridge.actions.action_runner import ActionRunner
from lockstep.robot_bridge.conformance import CASES, Outcome, Result, Subject, play
from lockstep.robot_bridge.conformance.place import Place
from lockstep.robot_bridge.robots.planar.robot import PlanarState
from tests.robot_bridge.bridge_helpers import RecordingRobot, running_bridge

ABOUT_ACTIONS = [case for case in CASES if case.name.startswith("action_")]


class AwayRobot(RecordingRobot):
    """Begins so far from home that no case brings it there."""

    def __init__(self) -> None:
        super().__init__()
        self._state = PlanarState(x=1.0)


async def results_of(*names: str) -> dict[str, Result]:
    async with running_bridge(AwayRobot()) as bridge:
        subject = Subject(Place(*bridge.address))
        found = {}
        for case in ABOUT_ACTIONS:
            if case.name in names:
                found[case.name] = await play(subject, case)
                await subject.clean_up()
        return found


async def test_the_bridge_passes() -> None:
    results = await results_of(*(case.name for case in ABOUT_ACTIONS))
    assert len(results) == 10
    assert {name: result.detail for name, result in results.items() if result.outcome is not Outcome.OK} == {}


def nothing(*_: object, **__: object) -> list[ActionUpdate]:
    return []


def all_but(reason: ActionReason) -> Callable[[ActionRunner, ActionReason], None]:
    interrupt = ActionRunner.interrupt

    def deaf(runner: ActionRunner, why: ActionReason) -> None:
        if why != reason:
            interrupt(runner, why)

    return deaf


def deaf_while_it_waits(runner: ActionRunner, why: ActionReason) -> None:
    if not runner.waits:
        INTERRUPT(runner, why)


def wakes_by_itself(runner: ActionRunner) -> None:
    STEP(runner)
    if runner.waits and runner._now() - runner._core.renewal.at > 1.2:
        runner._core.renewal.at = runner._now()


INTERRUPT, STEP = ActionRunner.interrupt, ActionRunner.step
FAULTS: dict[str, tuple[type, str, object]] = {
    "action_hold": (ActionCore, "look", nothing),
    "action_stop": (ActionCore, "look", nothing),
    "action_waits": (ActionRunner, "interrupt", deaf_while_it_waits),
    "action_stick": (ActionRunner, "interrupt", all_but("driving")),
    "action_rest": (ActionRunner, "interrupt", all_but("rested")),
    "action_renewed": (ActionCore, "renewed", lambda *_: False),
    "action_stopped": (ActionCore, "_why_not", lambda *_: None),
    "action_neutral": (ActionCore, "_why_not", lambda *_: None),
    "action_late": (ActionCore, "_why_not", lambda *_: None),
}


@pytest.mark.parametrize("name", FAULTS)
async def test_a_planted_fault_is_found_by_the_case_that_is_about_it(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    kind, method, fault = FAULTS[name]
    monkeypatch.setattr(kind, method, fault)
    result = (await results_of(name))[name]
    assert result.outcome is Outcome.FAILED, result


async def test_an_action_that_goes_on_by_itself_after_it_has_waited_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ActionRunner, "step", wakes_by_itself)
    result = (await results_of("action_hold"))["action_hold"]
    assert result.outcome is Outcome.FAILED, result
    assert "moves again" in result.detail
