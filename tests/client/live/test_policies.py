"""A policy and two people at a real console: offered, taken over in mid-drive, given back, recorded."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager
from pathlib import Path

import httpx
import pytest

from lockstep.bench.harness.driving import drive_on
from lockstep.client import CommandError, CommandRefused, Console, SeatRefused
from lockstep.client.console_url import parse_link
from lockstep.server.recording.reading.event_rows import EventRow, event_rows
from lockstep.server.recording.reading.reader import RecordingReader
from lockstep.server.recording.verify.verify_file import verify_file
from tests.support.stack import Stack, running_stack
from tests.waiting import PATIENCE

SETTINGS = {"LOCKSTEP_EPISODES__COUNTDOWN_SECONDS": "0"}
PERSON, POLICY = [0.0, 0.1, 0.0], [0.2, 0.0, 0.0]  # what each sends tells who drove


async def policy_link(stack: Stack, name: str = "net") -> str:
    """A link for a policy, as an operator makes it on the page."""
    headers = {"Authorization": f"Bearer {parse_link(stack.operator).token}"}
    async with httpx.AsyncClient(base_url=stack.console, headers=headers, trust_env=False) as http:
        made = await http.post("/api/invitations", json={"role": "policy", "name": name, "seconds": 3600})
    link: str = made.raise_for_status().json()["link"]
    return link


def _console(link: str, name: str) -> Console:
    return Console(link, video=False, audio=False, name=name)


@asynccontextmanager
async def _three(stack: Stack) -> AsyncIterator[tuple[Console, Console, Console]]:
    """Ada, who lets the policy drive; Grace, who takes over; the policy."""
    async with AsyncExitStack() as consoles:
        ada = await consoles.enter_async_context(_console(stack.operator, "Ada"))
        grace = await consoles.enter_async_context(_console(stack.operator, "Grace"))
        yield ada, grace, await consoles.enter_async_context(_console(await policy_link(stack), "net"))


async def _policy(console: Console) -> None:
    """Drive in every turn that a person gives."""
    while True:
        await console.policies.seat()
        try:
            await console.arm()
            while True:
                await console.drive(POLICY)
        except CommandRefused as refused:
            if refused.reason not in ("no_seat", "not_neutral", "stopped"):
                raise


async def _until_driven_by(console: Console, name: str, events: int) -> None:
    """Until so many events have passed while `name` holds the seat."""
    first = None
    async with asyncio.timeout(PATIENCE):
        async for feedback in console.feedbacks():
            if console.seat.name != name:
                first = None
            elif first is None:
                first = feedback.event
            elif feedback.event - first >= events:
                return


def _rows(path: Path) -> list[EventRow]:
    with RecordingReader(path) as reader:
        return list(event_rows(reader))


@pytest.mark.asyncio
async def test_a_policy_drives_an_episode_and_a_person_corrects_it_twice(tmp_path: Path) -> None:
    recordings = tmp_path / "recordings"
    async with running_stack(tmp_path, extra=("--record", str(recordings)), settings=SETTINGS) as stack:  # noqa: SIM117
        async with _three(stack) as (ada, grace, net), asyncio.TaskGroup() as tasks:
            policy = tasks.create_task(_policy(net))
            await ada.take_seat()
            await ada.episodes.start("push the box")
            for _ in range(3):
                await drive_on(ada, PERSON)
            await ada.policies.offer(net.peer)
            for _ in range(2):
                await _until_driven_by(grace, "net", 5)
                assert (grace.seat.kind, grace.seat.offered) == ("policy", True)
                await grace.take_over()
                assert (grace.seat.kind, grace.seat.why, grace.seat.offered) == ("human", "taken", False)
                for _ in range(5):
                    await drive_on(grace, PERSON)
                await grace.policies.offer()
            await _until_driven_by(grace, "net", 5)
            with pytest.raises(SeatRefused, match="not_allowed"):
                await net.policies.offer()
            await grace.episodes.success()  # who lets it drive says how it went
            grace.policies.withdraw()
            async with asyncio.timeout(PATIENCE):
                async for feedback in grace.feedbacks():
                    if not grace.seat.holder and feedback.at_rest:
                        break
            policy.cancel()
    (path,) = recordings.glob("*.mcap")
    assert verify_file(path).ok
    drivers = [row.driven_by for row in _rows(path) if row.command is not None]
    assert {(each.name, each.kind) for each in drivers} == {("Ada", "human"), ("Grace", "human"), ("net", "policy")}
    assert all(each.intervention == (each.name == "Grace") for each in drivers)
    spells = [each for each, before in zip(drivers, [drivers[0], *drivers], strict=False) if each != before]
    assert [each.name for each in spells] == ["net", "Grace", "net", "Grace", "net"]
    for row in _rows(path):
        if row.command is not None and any(row.command.values):
            assert row.command.values == (POLICY if row.driven_by.kind == "policy" else PERSON)


@pytest.mark.asyncio
async def test_in_a_take_over_in_mid_drive_the_robot_rests_and_waits_for_the_person_to_arm(tmp_path: Path) -> None:
    async with running_stack(tmp_path) as stack, _three(stack) as (ada, grace, net), asyncio.TaskGroup() as tasks:
        policy = tasks.create_task(_policy(net))
        await ada.policies.offer()
        await _until_driven_by(grace, "net", 10)
        await grace.take_over()
        for _ in range(5):
            await drive_on(grace, PERSON)
        records = [each for each in await stack.records() if each["kind"] in ("executed", "rest")]
        first = next(at for at, each in enumerate(records) if each["kind"] == "executed" and each["values"] == PERSON)
        last = max(at for at, each in enumerate(records) if each["kind"] == "executed" and each["values"] == POLICY)
        between = records[last + 1 : first]
        assert last < first, "the policy moves nothing after the person"
        assert any(each["kind"] == "rest" for each in between)
        assert any(each["kind"] == "executed" and not any(each["values"]) for each in between), "neutral first"
        with pytest.raises(SeatRefused, match="not_allowed"):
            await net.take_over()
        policy.cancel()


@pytest.mark.asyncio
async def test_a_shadow_is_judged_beside_the_person_who_drives(tmp_path: Path) -> None:
    recordings = tmp_path / "recordings"
    async with running_stack(tmp_path, extra=("--record", str(recordings))) as stack, _three(stack) as (ada, _, net):
        await ada.take_seat()
        with pytest.raises(CommandError):
            net.policies.shadow([0.0])

        async def shadows() -> None:
            async for feedback in net.feedbacks():
                net.policies.shadow(PERSON, feedback)

        async with asyncio.TaskGroup() as tasks, asyncio.timeout(PATIENCE):
            shadow = tasks.create_task(shadows())
            while not any(each.judgement == "in_time" and each.difference == 0 for each in ada.policies.verdicts):
                await drive_on(ada, PERSON)
            shadow.cancel()
        assert {each.name for each in ada.policies.verdicts} == {"net"}
        executed = await stack.events("executed")
        assert all(each["values"] in (PERSON, [0.0, 0.0, 0.0]) for each in executed)
