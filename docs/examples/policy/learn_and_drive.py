"""A policy learns from ten recorded episodes, drives the SO-101, is corrected twice by a person, and learns again.

    PYTHONPATH=docs/examples/policy lockstep up --robot varied_blocks:VariedBlocks --state-dir /tmp/policy
    export OPERATOR_LINK=… POLICY_LINK=…
    python docs/examples/policy/learn_and_drive.py --recordings /tmp/policy

The links are in the environment, because every user of a machine can see the arguments of its processes.
All three drivers are scripts here: Ada demonstrates, the policy learns, Grace corrects (docs/policies.md).
"""

import argparse
import asyncio
import os
import sys
from collections.abc import AsyncIterator, Callable
from contextlib import AsyncExitStack, asynccontextmanager
from pathlib import Path
from typing import Final

import httpx
from demonstrated_paths import Block, DemonstratedPaths, block_of, read_demonstrations

from lockstep.bench.pick_place.hands import LEADER_SCALES, LeaderHand, PolicyHand
from lockstep.bench.pick_place.motions import Place
from lockstep.bench.pick_place.script import Hand, PickAndPlace
from lockstep.client import (
    ActionCancelled,
    ActionFailed,
    ActionRefused,
    CommandRefused,
    Console,
    ConsoleError,
    EpisodeRefused,
)
from lockstep.client.console_url import parse_link
from lockstep.protocol.messages import Feedback

TASK: Final = "put the red block into the bowl"
PASSING: Final = ("late", "link_down", "not_neutral", "out_of_order", "rested")  # a busy machine held somebody up
LANDS_SECONDS: Final = 15.0
DRIVE_SECONDS: Final = 240.0
ALL_MOTIONS: Final = 9
TRIAL_SECONDS: Final = 60.0  # of the robot's clock, in which the policy has to get to the end
CORRECTED_AFTER: Final = 1.0  # s of the robot's clock: Grace sees where the policy goes
APPROACH: Final = 2  # motions that she does: opens the fingers, and goes above the block


async def armed(console: Console) -> Feedback:
    """Arm, again while somebody is held up: a simulated robot endangers nobody."""
    while True:
        try:
            return await console.arm()
        except CommandRefused as refused:
            if refused.reason not in PASSING:
                raise
        await anext(aiter(console.feedbacks()))


def said(console: Console, name: str) -> float | None:
    """Return what the robot says of itself under this name."""
    return next((float(item.value) for item in console.status if item.name == name), None)


def block_at(console: Console) -> Block:
    """Return where the robot says that the block lies."""
    if (block := block_of(console.status)) is None:
        raise ConsoleError("this robot does not say where the block is: start varied_blocks:VariedBlocks")
    return block


async def block_in_bowl(console: Console) -> bool:
    """Wait until the robot says that a block lies in the bowl."""
    try:
        async with asyncio.timeout(LANDS_SECONDS):
            async for _ in console.feedbacks():
                if said(console, "bowl") == 1:
                    return True
    except TimeoutError:
        pass
    return False


async def reset(ada: Console) -> None:
    """Bring the arm home and the block to another place: a policy may not, so a person does."""
    await ada.take_over()
    while True:
        try:
            await ada.rest()  # an action that moves is refused before
            await armed(ada)
            await ada.act("home")
            break
        except (ActionCancelled, ActionFailed, ActionRefused, CommandRefused) as held_up:
            print(f"once more to where the episode begins: {held_up}")
            await anext(aiter(ada.feedbacks()))
    before = said(ada, "scene")
    await ada.act("reset_scene")
    async for _ in ada.feedbacks():
        if said(ada, "scene") != before:
            break
    await ada.rest()


def task_of(person: Console, hand: Hand) -> PickAndPlace:
    """Return what a person does, who sees the block."""
    return PickAndPlace(person.description, "red", hand, Place(*block_at(person)))


async def operate(person: Console, task: PickAndPlace, motions: int) -> None:
    """Drive as a person until so many motions of the task are done."""
    feedback = await armed(person)
    while not task.done and not task.failed and task.motions_done < motions:
        try:
            values = await asyncio.to_thread(task.values, feedback)  # it solves a posture now and then
            feedback = await person.drive(values)
        except CommandRefused as refused:
            if refused.reason not in PASSING:
                raise
            feedback = await armed(person)


async def demonstrate(ada: Console) -> bool:
    """Drive one episode as a person; keep it, and return whether the block is in the bowl."""
    await reset(ada)
    await ada.episodes.start(TASK)
    task = task_of(ada, PolicyHand(ada.description))
    await operate(ada, task, ALL_MOTIONS)
    placed = task.done and await block_in_bowl(ada)
    return await kept(ada, placed)


async def kept(person: Console, placed: bool) -> bool:
    """Keep the episode; return whether it is a success that was kept."""
    try:
        await person.episodes.keep("success" if placed else "failure")
    except EpisodeRefused as refused:  # a busy machine has lost it, with the robot's link
        print(f"the episode was lost: {refused}; {person.episodes.state.last}")
        return False
    return placed


async def drive_when_let(net: Console, policy: DemonstratedPaths) -> None:
    """Drive in each turn that a person gives, until cancelled; a policy arms as anybody does."""
    while True:
        await net.policies.seat()
        policy.begin()
        try:
            feedback = await net.arm()
            while True:
                feedback = await net.drive(policy.action(feedback, block_at(net)))
        except CommandRefused as refused:
            if refused.reason not in ("no_seat", *PASSING):
                raise
        if net.seat.holder == net.peer:
            net.release_seat()  # the robot needs a person's eye: a new turn is theirs to give


async def shadow(net: Console, policy: DemonstratedPaths) -> None:
    """Say what the policy would do while a person drives, until cancelled. Nothing of it is executed."""
    async for feedback in net.feedbacks():
        if net.seat.kind == "human":
            net.policies.shadow(policy.action(feedback, block_at(net)), feedback)


async def correct(grace: Console) -> None:
    """Take the robot from the policy, bring it above the block with a leader arm's clutch, and give it back."""
    await grace.take_over()
    hand = LeaderHand(grace.description, grace.clutch(LEADER_SCALES))
    await operate(grace, task_of(grace, hand), APPROACH)
    hand.clutch.release()
    await grace.policies.offer()


async def until(giver: Console, net: Console, enough: Callable[[float], bool]) -> None:
    """Wait until it is enough; offer another turn when the policy has released the seat after a refusal.

    `enough`: of the s of the robot's clock since the policy drives.
    """
    began: float | None = None
    async with asyncio.timeout(DRIVE_SECONDS):
        async for feedback in net.feedbacks():
            if net.seat.kind == "policy":
                began = feedback.time if began is None else began
                if enough(feedback.time - began):
                    return
            if giver.seat.kind == "none" and not giver.seat.offered:
                if giver.seat.why == "released":
                    await giver.policies.offer(net.peer)
                    continue
                raise ConsoleError(f"the policy's turn has ended: {net.seat.why}")


async def let_drive(ada: Console, net: Console, policy: DemonstratedPaths, grace: Console | None = None) -> bool:
    """Let the policy drive one episode, corrected by Grace if she is there; return whether the block is in the bowl."""
    await reset(ada)
    await ada.episodes.start(TASK)
    policy.begin()
    thinking = DemonstratedPaths(policy.demonstrations)  # a shadow has a place of its own
    async with asyncio.TaskGroup() as tasks:
        running = [tasks.create_task(drive_when_let(net, policy)), tasks.create_task(shadow(net, thinking))]
        await ada.policies.offer(net.peer)
        giver = ada
        if grace is not None:
            await until(ada, net, lambda seconds: seconds > CORRECTED_AFTER)
            await correct(grace)
            giver = grace
        await until(giver, net, lambda seconds: policy.done or seconds > TRIAL_SECONDS)
        placed = await kept(giver, await block_in_bowl(giver))
        giver.policies.withdraw()
        for task in running:
            task.cancel()
    return placed


async def tried(ada: Console, net: Console, policy: DemonstratedPaths, trials: int) -> str:
    """Let the policy drive alone so often; return its successes in words."""
    placed = []
    for _ in range(trials):
        placed.append(await let_drive(ada, net, policy))
        print(f"alone: {'in the bowl' if placed[-1] else 'not in the bowl'}")
    return f"{sum(placed)} of {trials}"


@asynccontextmanager
async def recording(console: httpx.AsyncClient, folder: Path, name: str) -> AsyncIterator[list[Path]]:
    """Record while entered; the list has the file's path afterwards."""
    begun = (await console.post("/api/recordings", json={"name": name})).raise_for_status().json()["recording"]
    found: list[Path] = []
    try:
        yield found
    finally:
        (await console.post("/api/recordings/stop")).raise_for_status()
        found += await asyncio.to_thread(lambda: list(folder.rglob(f"*{begun}*.mcap")))


async def main(operator: str, policy_link: str, folder: Path, episodes: int, trials: int, corrections: int) -> None:
    link = parse_link(operator)
    async with AsyncExitStack() as stack:
        http = await stack.enter_async_context(
            httpx.AsyncClient(base_url=operator.partition("/#")[0], trust_env=False, timeout=60.0)
        )
        http.headers["Authorization"] = f"Bearer {link.token}"
        ada, grace, net = [
            await stack.enter_async_context(Console(each, video=False, audio=False, name=name, connect_seconds=60.0))
            for each, name in ((operator, "Ada"), (operator, "Grace"), (policy_link, "demonstrated paths"))
        ]
        await ada.take_seat()
        async with recording(http, folder, "demonstrations") as demonstrated:
            for number in range(episodes):
                print(f"episode {number + 1}: {'in the bowl' if await demonstrate(ada) else 'not in the bowl'}")
        policy = DemonstratedPaths(read_demonstrations(demonstrated[0]))
        if trials:
            async with recording(http, folder, "policy, alone"):
                print(f"alone, before any correction: {await tried(ada, net, policy, trials)}")
        async with recording(http, folder, "policy, corrected") as driven:
            placed = [await let_drive(ada, net, policy, grace) for _ in range(corrections)]
        print(f"corrected once in each of {len(placed)} episodes: {sum(placed)} in the bowl")
        policy = DemonstratedPaths([*policy.demonstrations, *read_demonstrations(driven[0])])
        print(f"it learns again, from {len(policy.demonstrations)} episodes")
        if trials:
            async with recording(http, folder, "policy, alone again"):
                print(f"alone, after the corrections: {await tried(ada, net, policy, trials)}")
        print(f"lockstep report {driven[0]}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--recordings", type=Path, required=True, help="the folder in which the console records")
    parser.add_argument("--episodes", type=int, default=10, help="demonstrations to learn from")
    parser.add_argument("--trials", type=int, default=10, help="before and after the corrections")
    parser.add_argument("--corrections", type=int, default=2, help="episodes in which Grace takes over")
    wanted = parser.parse_args()
    links = os.environ.get("OPERATOR_LINK", ""), os.environ.get("POLICY_LINK", "")
    if not all(links):
        parser.error("set OPERATOR_LINK to an operator's link, and POLICY_LINK to one of lockstep invite --role policy")
    given = (*links, wanted.recordings, wanted.episodes, wanted.trials, wanted.corrections)
    try:
        asyncio.run(main(*given))
    except ConsoleError as error:
        sys.exit(str(error))
