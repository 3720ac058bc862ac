"""A bridge with a fault is found out, by the case that is about it; the same bridge without one passes all."""

import asyncio
import re

import pytest

from lockstep.protocol.messages import Media
from lockstep.robot_bridge.conformance import CASES, Outcome, Result, Subject, play, play_all
from lockstep.robot_bridge.conformance.place import Place
from tests.robot_bridge.bridge_helpers import raw_link
from tests.robot_bridge.conformance.plain_bridge import Fault, PlainBridge, running_plain_bridge

FOUND_BY = {
    Fault.REPEATS_HOLD: "repeats_hold_nothing",
    Fault.REPEATS_COUNT: "repeat",
    Fault.LATE_EXECUTES: "late",
    Fault.UNSEEN_EXECUTES: "unseen",
    Fault.NO_HOLD: "hold",
    Fault.NO_REST: "rest",
    Fault.NO_NEUTRAL: "new_link",
    Fault.FORGETS_STOP: "stop_latches",
    Fault.NUMBERS_REPEATS: "stop_numbers",
    Fault.RESETS_ANY_STOP: "reset_names_one",
    Fault.NAN_EXECUTES: "not_a_number",
    Fault.DIES_OF_MALFORMED: "malformed",
    Fault.STAMPS_AHEAD: "stamps",
    Fault.TWO_OPERATORS: "second_operator",
    Fault.NO_HEARTBEATS: "heartbeats",
    Fault.SILENCE_LASTS: "silent_link",
    Fault.NO_BOUND: "lengths",
    Fault.ANY_VERSION: "version",
    Fault.ANY_ROLE: "permissions",
    Fault.REFUSES_SILENTLY: "out_of_order",
    Fault.NO_REFRESH: "refresh",
    Fault.ACTS_UNRENEWED: "action_hold",
    Fault.ACTS_AGAIN: "action_hold",
    Fault.ACTS_UNARMED: "action_neutral",
    Fault.ACTS_DRIVEN: "action_stick",
    Fault.ACTS_DRIVEN_ON: "action_stick",
}
SAID = {  # of those that another fault could bring to the same end
    Fault.REPEATS_HOLD: "the robot goes on while one command is repeated",
    Fault.NO_HOLD: r"not at rest 1\.\d s after the last command",
    Fault.FORGETS_STOP: "a new operator link released the stop",
    Fault.DIES_OF_MALFORMED: "an array: the connection ended",
    Fault.STAMPS_AHEAD: "a medium is stamped",
    Fault.TWO_OPERATORS: "a second operator was admitted beside the first",
    Fault.REFUSES_SILENTLY: "neither executed nor refused",
    Fault.ANY_VERSION: "the bridge admitted the link",
    Fault.ACTS_UNRENEWED: "the action goes on",
    Fault.ACTS_AGAIN: "it began again",
    Fault.ACTS_UNARMED: "refused 'not_neutral' is running",
    Fault.ACTS_DRIVEN: "cancelled 'not_renewed', not 'driving'",
    Fault.ACTS_DRIVEN_ON: "cancelled 'not_renewed' 5 times, not 'driving'",
}


GOALS = [case.name for case in CASES if case.name.startswith("goal")]
# Ten different faults, and the cases besides the named one that meet the same fault. No other case fails.
MET_BY_OTHERS: dict[Fault, set[str]] = {
    Fault.LATE_EXECUTES: set(),
    Fault.REPEATS_COUNT: {"repeats_hold_nothing"},  # each repeat begins a new hold
    Fault.NO_HOLD: {"repeats_hold_nothing"},
    Fault.NO_REST: {"rest_ahead", "action_rest"},
    Fault.NO_NEUTRAL: {"reset_then_neutral"},
    Fault.FORGETS_STOP: set(),
    Fault.RESETS_ANY_STOP: set(),
    Fault.UNSEEN_EXECUTES: set(),  # the nonce is ignored
    Fault.DIES_OF_MALFORMED: {"silent_link"},
    Fault.STAMPS_AHEAD: set(),
}


def subject(bridge: PlainBridge) -> Subject:
    return Subject(Place(*bridge.address))


async def result_of(fault: Fault) -> Result:
    case = next(case for case in CASES if case.name == FOUND_BY[fault])
    async with running_plain_bridge(fault) as bridge:
        return await play(subject(bridge), case)


async def test_every_planted_fault_is_found_by_the_case_that_is_about_it() -> None:
    """All at once: most of the time is spent waiting for what a faulty bridge does not do."""
    assert set(FOUND_BY) == set(Fault)
    results = await asyncio.gather(*map(result_of, Fault))
    assert [result for result in results if result.outcome is not Outcome.FAILED] == []
    details = {fault: result.detail for fault, result in zip(Fault, results, strict=True)}
    for fault, words in SAID.items():
        assert re.search(words, details[fault]), (fault, details[fault])


async def test_pictures_that_take_long_to_draw_are_judged_by_their_capture() -> None:
    """Some come that were captured before the operator link opened, in an event that began before it."""
    case = next(case for case in CASES if case.name == "stamps")
    async with running_plain_bridge(drawing=0.3) as bridge:
        async with raw_link(bridge, "media") as watcher:
            await watcher.find(Media)
        result = await play(subject(bridge), case)
    assert result.outcome is Outcome.OK, result


async def all_results(fault: Fault | None) -> list[Result]:
    async with running_plain_bridge(fault) as bridge:
        return await play_all(subject(bridge), CASES, lambda result: None)


@pytest.mark.timeout(180)  # each plays all cases, at the pace of the robot's hold
async def test_a_bridge_written_from_the_page_passes_and_with_a_fault_fails_in_the_cases_about_it_alone() -> None:
    """All at once: each waits most of the time."""
    passing, *found = await asyncio.gather(all_results(None), *map(all_results, MET_BY_OTHERS))
    assert {result.case.name: result.detail for result in passing if result.outcome is not Outcome.OK} == {
        "secret": "no link secret was given",
        "warning": "the description has no start_warning",
        "action_waits": "no action of the robot waits to be renewed",
        **dict.fromkeys(GOALS, "the description has no goal axes"),
    }
    for (fault, others), results in zip(MET_BY_OTHERS.items(), found, strict=True):
        failed = {result.case.name for result in results if result.outcome is Outcome.FAILED}
        named = FOUND_BY[fault]
        assert named in failed, fault
        assert failed <= {named, *others}, fault
