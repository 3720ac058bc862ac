"""The data channels, over real WebRTC, against a real bridge."""

from robot_bridge.protocol.console import Seat, SeatRequest, Welcome
from robot_bridge.protocol.messages import Command
from robot_bridge.protocol.serial import event_after
from tests.server.rig import running_rig


async def test_an_operator_takes_the_seat_and_drives_one_event() -> None:
    async with running_rig() as rig, rig.peer("operator") as peer:
        welcome = await peer.until(lambda each: isinstance(each, Welcome))
        assert isinstance(welcome, Welcome)
        peer.send("session", SeatRequest())
        await peer.until(lambda each: isinstance(each, Seat) and each.holder == welcome.peer)
        now = await peer.feedback()
        peer.send("control", Command(event=event_after(now.event), issue=now.issue, values=[0.0] * len(now.axes)))
        await peer.feedback(lambda each: each.event == event_after(now.event))
