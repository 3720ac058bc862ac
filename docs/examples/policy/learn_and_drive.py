"""A policy learns from ten episodes, drives the SO-101, and is corrected twice by a person.

    lockstep up --robot so101 --state-dir /tmp/policy
    python docs/examples/policy/learn_and_drive.py OPERATOR_LINK POLICY_LINK --recordings /tmp/policy

All three drivers are scripts here: Ada demonstrates, the policy learns, Grace corrects (docs/policies.md).
"""

import argparse
import asyncio
import sys
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager
from pathlib import Path
from typing import Final

import httpx
from nearest_neighbour import NearestNeighbour, read_demonstrations

from lockstep.bench.pick_place.hands import JOINTS, LEADER_SCALES, PolicyHand
from lockstep.bench.pick_place.script import PickAndPlace
from lockstep.client import CommandRefused, Console, ConsoleError
from lockstep.client.console_url import parse_link
from lockstep.protocol.messages import Feedback

BLOCK: Final = "red"
TASK: Final = "put the red block into the bowl"
PASSING: Final = ("late", "link_down", "not_neutral", "out_of_order", "rested")  # a busy machine held somebody up
LANDS_SECONDS: Final = 15.0
DRIVE_SECONDS: Final = 240.0
CORRECTED_AT: Final = (0.15, 0.85)  # of the demonstration: with empty fingers, since a robot that rests may let go
CORRECTION: Final = 0.08  # rad, by which Grace turns the arm and back


async def armed(console: Console) -> Feedback:
    """Arm, again while somebody is held up: a simulated robot endangers nobody."""
    while True:
        try:
            return await console.arm()
        except CommandRefused as refused:
            if refused.reason not in PASSING:
                raise
        await anext(aiter(console.feedbacks()))


async def blocks_in_bowl(console: Console, count: int) -> bool:
    """Wait until the robot says that so many blocks lie in the bowl."""
    try:
        async with asyncio.timeout(LANDS_SECONDS):
            async for _ in console.feedbacks():
                if any(item.name == "bowl" and item.value == count for item in console.status):
                    return True
    except TimeoutError:
        pass
    return False


async def reset(ada: Console) -> None:
    """Bring the arm and the blocks to where every episode begins: a policy may not, so a person does."""
    await armed(ada)
    await ada.act("home")
    await ada.act("reset_scene")
    await blocks_in_bowl(ada, 0)
    await ada.rest()


async def demonstrate(ada: Console) -> bool:
    """Drive one episode as a person; keep it, and return whether the block is in the bowl."""
    await reset(ada)
    await ada.episodes.start(TASK)
    task = PickAndPlace(ada.description, BLOCK, PolicyHand(ada.description))
    feedback = await armed(ada)
    while not task.done and not task.failed:
        try:
            values = await asyncio.to_thread(task.values, feedback)  # it solves a posture now and then
            feedback = await ada.drive(values)
        except CommandRefused as refused:
            if refused.reason not in PASSING:
                raise
            feedback = await armed(ada)
    placed = task.done and await blocks_in_bowl(ada, 1)
    await ada.episodes.keep("success" if placed else "failure")
    return placed


async def drive_when_let(net: Console, policy: NearestNeighbour) -> None:
    """Drive in each turn that a person gives, until cancelled; a policy arms as anybody does."""
    while True:
        await net.policies.seat()
        policy.begin()
        try:
            feedback = await net.arm()
            while True:
                action = policy.action(feedback)
                feedback = await net.drive(dict(zip(JOINTS, action, strict=True)))
        except CommandRefused as refused:
            if refused.reason not in ("no_seat", *PASSING):
                raise
        if net.seat.holder == net.peer:
            net.release_seat()  # the robot needs a person's eye: a new turn is theirs to give


async def shadow(net: Console, policy: NearestNeighbour) -> None:
    """Say what the policy would do while a person drives, until cancelled. Nothing of it is executed."""
    async for feedback in net.feedbacks():
        if net.seat.kind == "human":
            net.policies.shadow(dict(zip(JOINTS, policy.action(feedback), strict=True)), feedback)


async def correct(grace: Console) -> None:
    """Take the robot from the policy, turn it a little and back through a clutch, and give it back."""
    await grace.take_over()
    feedback = await armed(grace)
    clutch = grace.clutch(LEADER_SCALES)
    device = [0.4] * len(LEADER_SCALES)  # rad, wherever the leader arm is: engaging moves nothing
    clutch.observe(feedback)
    clutch.engage(device)
    for step in [CORRECTION / 10] * 10 + [-CORRECTION / 10] * 5:
        device[0] += step
        await grace.drive(clutch.values(device))
    clutch.release()
    await grace.policies.offer()


async def until_progress(giver: Console, net: Console, policy: NearestNeighbour, share: float) -> None:
    """Wait until the policy drives, and is so far; the person gives it another turn when it has released the seat."""
    async with asyncio.timeout(DRIVE_SECONDS):
        async for _ in net.feedbacks():
            if net.seat.kind == "policy" and policy.progress >= share:
                return
            if giver.seat.kind == "none" and not giver.seat.offered:
                if giver.seat.why == "released":
                    await giver.policies.offer(net.peer)
                    continue
                raise ConsoleError(f"the policy's turn has ended: {net.seat.why}")


async def drive_corrected(ada: Console, grace: Console, net: Console, policy: NearestNeighbour) -> bool:
    """Let the policy drive one episode, corrected twice; keep it, and return whether the block is in the bowl."""
    await reset(ada)
    await ada.episodes.start(TASK)
    thinking = NearestNeighbour(policy.demonstrations)  # a shadow has a place of its own
    async with asyncio.TaskGroup() as tasks:
        running = [tasks.create_task(drive_when_let(net, policy)), tasks.create_task(shadow(net, thinking))]
        await ada.policies.offer(net.peer)
        giver = ada
        for share in CORRECTED_AT:
            await until_progress(giver, net, policy, share)
            await correct(grace)
            giver = grace
        await until_progress(giver, net, policy, 1.0)
        placed = await blocks_in_bowl(grace, 1)
        await grace.episodes.keep("success" if placed else "failure")
        grace.policies.withdraw()
        for task in running:
            task.cancel()
    return placed


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


async def main(operator: str, policy_link: str, folder: Path, episodes: int) -> bool:
    link = parse_link(operator)
    async with AsyncExitStack() as stack:
        http = await stack.enter_async_context(
            httpx.AsyncClient(base_url=operator.partition("/#")[0], trust_env=False, timeout=60.0)
        )
        http.headers["Authorization"] = f"Bearer {link.token}"
        ada, grace, net = [
            await stack.enter_async_context(Console(each, video=False, audio=False, name=name, connect_seconds=60.0))
            for each, name in ((operator, "Ada"), (operator, "Grace"), (policy_link, "nearest neighbour"))
        ]
        await ada.take_seat()
        async with recording(http, folder, "demonstrations") as demonstrated:
            for number in range(episodes):
                print(f"episode {number + 1}: {'in the bowl' if await demonstrate(ada) else 'not in the bowl'}")
        policy = NearestNeighbour(read_demonstrations(demonstrated[0], len(JOINTS)))
        async with recording(http, folder, "policy, corrected") as driven:
            placed = await drive_corrected(ada, grace, net, policy)
        print(f"the policy, corrected {len(CORRECTED_AT)} times: {'in the bowl' if placed else 'not in the bowl'}")
        print(f"lockstep report {driven[0]}")
    return placed


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("operator", help="an operator's link")
    parser.add_argument("policy", help="a link of the role policy: lockstep invite --role policy")
    parser.add_argument("--recordings", type=Path, required=True, help="the folder in which the console records")
    parser.add_argument("--episodes", type=int, default=10, help="demonstrations to learn from")
    wanted = parser.parse_args()
    try:
        sys.exit(0 if asyncio.run(main(wanted.operator, wanted.policy, wanted.recordings, wanted.episodes)) else 1)
    except ConsoleError as error:
        sys.exit(str(error))
