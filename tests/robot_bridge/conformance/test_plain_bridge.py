"""The robot written from the page has nothing of Lockstep's in it, and does its actions."""

import asyncio
import subprocess
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import msgspec

from lockstep.protocol.actions import Act, ActionCancel, ActionUpdate
from lockstep.robot_bridge.link.link_client import RobotLink
from tests.robot_bridge.bridge_helpers import Operator
from tests.robot_bridge.conformance.plain_bridge import NEUTRAL, TICK, PlainBridge, running_plain_bridge

ROOT = Path(__file__).parents[3]
LOADED = """
import sys
import tests.robot_bridge.conformance.plain_bridge
print(*sorted({name.partition(".")[0] for name in sys.modules} & {"lockstep", "msgspec"}))
"""
NEAR_HOME = 0.05  # m


def test_it_loads_nothing_of_lockstep_and_no_codec_of_its() -> None:
    loaded = subprocess.run([sys.executable, "-c", LOADED], cwd=ROOT, capture_output=True, text=True, check=True)
    assert loaded.stdout.strip() == ""


@asynccontextmanager
async def driven() -> AsyncIterator[tuple[PlainBridge, Operator]]:
    async with running_plain_bridge() as bridge, RobotLink(*bridge.address, "operator", name="test") as link:
        driver = Operator(link)
        await driver.heard(lambda feedback: bool(feedback.axes))
        await driver.arm()
        yield bridge, driver


def act(driver: Operator, name: str, **parameters: bool | float | str) -> None:
    """Ask for an action; the name is the request's id too."""
    driver.link.send(Act(id=name, name=name, parameters=parameters, nonce=driver.feedback.nonce, by="ann"))


async def told(driver: Operator, state: str) -> ActionUpdate:
    while (update := await driver.next(ActionUpdate)).state != state:
        pass
    return update


async def renew(driver: Operator) -> None:
    """Let `home` go on by an armed event."""
    command = msgspec.structs.replace(driver.command(NEUTRAL), action="home")
    driver.link.send(command)
    await driver.heard(lambda feedback: feedback.event == command.event)


async def test_home_goes_on_while_it_is_renewed_until_it_is_there() -> None:
    async with driven() as (bridge, driver):
        bridge.place = [NEAR_HOME, 0.0]
        act(driver, "home")
        begun = await told(driver, "running")
        assert (begun.moves, begun.by, begun.began) == (True, "ann", begun.event)
        while bridge.actions.moving:
            await renew(driver)
        assert abs(bridge.place[0]) < NEAR_HOME / 2
        await driver.heard(lambda feedback: feedback.at_rest)
        driver.link.send(Act(id="home", name="home"))
        assert (await told(driver, "done")).text == "at home"


async def test_home_ends_when_it_is_cancelled_and_stays_where_it_is() -> None:
    async with driven() as (bridge, driver):
        act(driver, "home")
        await told(driver, "running")
        driver.link.send(ActionCancel())
        assert (await told(driver, "cancelled")).reason == "cancelled"
        await driver.heard(lambda feedback: feedback.at_rest)
        assert bridge.place[0] > NEAR_HOME


async def test_light_moves_nothing_and_needs_no_neutral_command() -> None:
    async with running_plain_bridge() as bridge, RobotLink(*bridge.address, "operator") as link:
        driver = Operator(link)
        await driver.heard(lambda feedback: feedback.neutral_needed and bool(feedback.axes))
        act(driver, "light", on=True)
        done = await told(driver, "done")
        assert (done.text, done.moves, done.progress, bridge.light) == ("on", False, 1.0, True)


async def test_parameters_that_are_not_declared_are_refused() -> None:
    async with driven() as (bridge, driver):
        act(driver, "light", on=1.0)
        assert (await told(driver, "refused")).reason == "bad_parameter"
        assert not bridge.light


async def next_tick() -> None:
    await asyncio.sleep(TICK)


async def test_a_new_operator_link_is_told_what_became_of_the_last_requests() -> None:
    async with driven() as (bridge, driver):
        act(driver, "home")
        await told(driver, "running")
        await driver.link.close()
        while bridge.links:  # until it has read the goodbye
            await next_tick()
        async with RobotLink(*bridge.address, "operator", name="test") as link:
            told_again = await told(Operator(link), "cancelled")
    assert (told_again.id, told_again.reason) == ("home", "link_down")
