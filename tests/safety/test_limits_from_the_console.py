"""What limits the robot, seen from the console: the speed cap and the geofence, through the whole stack."""

import asyncio

from lockstep.protocol.console import Report, Seat, SeatRequest, SpeedCapState, Welcome
from lockstep.protocol.messages import Feedback
from lockstep.robot_bridge.bridge import Bridge
from lockstep.robot_bridge.robots.planar.robot import PlanarRobot, PlanarState
from lockstep.robot_bridge.settings import BridgeSettings
from tests.server.rig import PATIENCE, TestPeer, running_console, running_rig

FULL = 0.8  # m/s, of the planar robot's forward axis
FULL_TURN = 1.5  # rad/s


async def take_seat(peer: TestPeer) -> str:
    welcome = await peer.until(lambda each: isinstance(each, Welcome))
    assert isinstance(welcome, Welcome)
    peer.send("session", SeatRequest())
    await peer.until(lambda each: isinstance(each, Seat) and each.holder == welcome.peer)
    await peer.feedback()
    await drive(peer, [0.0, 0.0, 0.0])
    return welcome.peer


async def drive(peer: TestPeer, values: list[float], count: int = 1) -> Feedback:
    """Events one after the other, as fast as they are answered."""
    for _ in range(count):
        await peer.drive(values)
    return peer.newest_feedback()


async def turns_at(peer: TestPeer, least: float, most: float, report: Report) -> None:
    """Commands full speed, and reports, until the robot turns that fast."""
    async with asyncio.timeout(PATIENCE):
        while True:
            peer.send("control", report)
            speed = (await drive(peer, [0.0, 0.0, FULL_TURN], 10)).axes[2]
            if least <= speed <= most + 1e-6:
                return


async def test_an_operator_whose_delay_is_unknown_drives_slowly_however_fast_the_commands_are() -> None:
    async with running_rig(speed_cap="on") as rig, rig.peer("operator") as peer, rig.peer("observer") as other:
        await take_seat(peer)
        for _ in range(10):
            assert (await drive(peer, [0.0, 0.0, FULL_TURN], 10)).axes[2] <= 0.2 * FULL_TURN + 1e-6
        await turns_at(peer, 0.15 * FULL_TURN, 0.2 * FULL_TURN, Report(armed=True))
        await other.until(lambda each: isinstance(each, SpeedCapState) and each.why == "unknown" and each.share == 0.2)
        assert rig.count("lockstep_speed_share") == 0.2


async def test_a_known_short_delay_frees_the_speed_and_a_long_one_takes_it_away() -> None:
    async with running_rig(speed_cap="on") as rig, rig.peer("operator") as peer:
        await take_seat(peer)
        await turns_at(peer, 0.9 * FULL_TURN, FULL_TURN, Report(armed=True, picture_delay_ms=60.0))
        await turns_at(peer, 0.1 * FULL_TURN, 0.25 * FULL_TURN, Report(armed=True, picture_delay_ms=800.0))
        await peer.until(lambda each: isinstance(each, SpeedCapState) and each.share == 0.25)


async def test_in_mode_operator_the_operators_wish_counts_and_in_mode_off_it_does_not() -> None:
    free = Report(armed=True, picture_delay_ms=1000.0)
    slow = Report(armed=True, picture_delay_ms=1000.0, speed_cap=True)
    async with running_rig(speed_cap="operator") as rig, rig.peer("operator") as peer:
        await take_seat(peer)
        await turns_at(peer, 0.9 * FULL_TURN, FULL_TURN, free)
        await turns_at(peer, 0.1 * FULL_TURN, 0.2 * FULL_TURN, slow)
    async with running_rig(speed_cap="off") as rig, rig.peer("operator") as peer:
        await take_seat(peer)
        await turns_at(peer, 0.9 * FULL_TURN, FULL_TURN, slow)


async def test_a_geofence_that_acts_is_fed_back_to_everyone_and_counted() -> None:
    robot = PlanarRobot(PlanarState(x=2.3, y=-2.5))  # just before the charging corner
    async with (
        Bridge(robot, BridgeSettings(port=0)) as bridge,
        running_console(bridge.address[1]) as rig,
    ):
        async with asyncio.timeout(PATIENCE):
            await rig.dependencies.console.robot.reached.wait()
        async with rig.peer("operator") as peer, rig.peer("observer") as other:
            await take_seat(peer)
            while "charger" not in peer.newest_feedback().limits:
                await drive(peer, [FULL, 0.0, 0.0])
            await other.feedback(lambda each: "charger" in each.limits)
            assert rig.count("lockstep_limited_feedback_total", limit="charger") >= 1
            last = await drive(peer, [FULL, 0.0, 0.0], 20)
            assert last.joints[0] <= 2.5
