"""The driver of the cases loses nothing that a case asks about."""

from lockstep.protocol.actions import ActionUpdate
from lockstep.protocol.framing import frame
from lockstep.protocol.messages import StopTaken, encode_message
from lockstep.robot_bridge.conformance.driver import Driver
from lockstep.robot_bridge.conformance.peer import Peer
from lockstep.robot_bridge.conformance.place import Place
from lockstep.robot_bridge.conformance.subject import Subject
from lockstep.robot_bridge.robots.planar.description import DESCRIPTION


async def test_an_action_that_is_done_while_a_stop_is_pressed_is_still_heard_of() -> None:
    """An arm that is at home already has come home before the answer to the stop is there."""
    done = ActionUpdate(id="one", name="home", state="done", event=2, began=2)
    peer = Peer()
    driver = Driver(peer, DESCRIPTION, Subject(Place("127.0.0.1", 1)))
    for message in (done, StopTaken(press="press", number=1)):
        peer.data_received(frame(encode_message(message)))
    assert await driver.stop("press") == 1
    assert list(driver.passed_over) == [done]
