"""What limits the robot, seen from the console: the speed cap and the geofence, through the whole stack."""

from robot_bridge.protocol.console import Report, Seat, SeatRequest, SpeedCapState, Welcome
from robot_bridge.protocol.messages import Command, Feedback
from robot_bridge.protocol.serial import event_after
from tests.server.rig import TestPeer, running_rig

FULL = 0.8  # m/s, of the planar robot's forward axis


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
        known = peer.newest_feedback()
        following = event_after(known.event)
        peer.send("control", Command(event=following, issue=known.issue, values=values))
        await peer.feedback(lambda each, wanted=following: each.event == wanted)  # type: ignore[misc]
    return peer.newest_feedback()


async def test_an_operator_whose_delay_is_unknown_drives_slowly_however_fast_the_commands_are() -> None:
    async with running_rig(speed_cap="on") as rig, rig.peer("operator") as peer, rig.peer("observer") as other:
        await take_seat(peer)
        feedback = await drive(peer, [FULL, 0.0, 0.0], 100)
        assert 0.1 < feedback.axes[0] <= 0.2 * FULL + 1e-6
        peer.send("control", Report(armed=True))
        await other.until(lambda each: isinstance(each, SpeedCapState) and each.why == "unknown" and each.share == 0.2)
        assert rig.count("lockstep_speed_share") == 0.2


async def test_a_known_short_delay_frees_the_speed_and_a_long_one_takes_it_away() -> None:
    async with running_rig(speed_cap="on") as rig, rig.peer("operator") as peer:
        await take_seat(peer)
        peer.send("control", Report(armed=True, picture_delay_ms=60.0))
        await peer.until(lambda each: isinstance(each, SpeedCapState) and each.delay_ms is not None)
        assert (await drive(peer, [FULL, 0.0, 0.0], 100)).axes[0] > 0.9 * FULL
        peer.send("control", Report(armed=True, picture_delay_ms=800.0))
        await peer.until(lambda each: isinstance(each, SpeedCapState) and each.share == 0.25)
        assert (await drive(peer, [-FULL, 0.0, 0.0], 150)).axes[0] >= -0.25 * FULL - 1e-6


async def test_in_mode_operator_the_operators_wish_counts_and_in_mode_off_it_does_not() -> None:
    slow = Report(armed=True, picture_delay_ms=1000.0, speed_cap=True)
    async with running_rig(speed_cap="operator") as rig, rig.peer("operator") as peer:
        await take_seat(peer)
        assert (await drive(peer, [FULL, 0.0, 0.0], 100)).axes[0] > 0.9 * FULL
        peer.send("control", slow)
        await peer.until(lambda each: isinstance(each, SpeedCapState) and each.holds)
        assert (await drive(peer, [-FULL, 0.0, 0.0], 150)).axes[0] >= -0.2 * FULL - 1e-6
    async with running_rig(speed_cap="off") as rig, rig.peer("operator") as peer:
        await take_seat(peer)
        peer.send("control", slow)
        assert (await drive(peer, [FULL, 0.0, 0.0], 100)).axes[0] > 0.9 * FULL


async def test_a_geofence_that_acts_is_fed_back_to_everyone_and_counted() -> None:
    async with running_rig() as rig, rig.peer("operator") as peer, rig.peer("observer") as other:
        await take_seat(peer)
        while "charger" not in peer.newest_feedback().limits:
            await drive(peer, [FULL, -0.6 * FULL, 0.0])
        await other.feedback(lambda each: "charger" in each.limits)
        assert rig.count("lockstep_limited_feedback_total", limit="charger") >= 1
        last = await drive(peer, [FULL, 0.0, 0.0], 100)
        assert last.joints[0] < 4.0
