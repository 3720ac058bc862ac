"""A flood on one link, with a clock and a thread's work that the test decides."""

import asyncio

from lockstep.protocol.framing import frame
from lockstep.protocol.messages import Feedback, Hello, LinkMessage, encode_message
from lockstep.protocol.pacing.paced_reader import PIECE, READ_BURST, READ_TURN
from lockstep.robot_bridge.link.link_session import BadInput, ClientSession
from lockstep.robot_bridge.link.pacing.paced_transport import PacedTransport
from lockstep.robot_bridge.robots.planar.description import DESCRIPTION
from tests.protocol.pacing.tcp_socket import Socket

HELLO = frame(encode_message(Hello(role="robot", epoch="e1", description=DESCRIPTION)))
GARBAGE = b"\x00\x00\x00\x01\xc1"


class Link(PacedTransport):
    """Each message costs `cost` seconds of the thread's time; the clock stands still."""

    def __init__(self, cost: float) -> None:
        self.cost = cost
        self.busy = 0.0
        self.heard: list[LinkMessage | BadInput] = []
        super().__init__(ClientSession(0.0, "operator"), lambda: 0.0, lambda: self.busy)
        self.tcp = Socket()
        self.connection_made(self.tcp)
        self.data_received(HELLO)
        self.heard.clear()

    def received(self, event: LinkMessage | BadInput) -> None:
        self.heard.append(event)
        self.busy += self.cost


async def test_what_fits_is_read_at_once_and_in_order() -> None:
    link = Link(0.0)
    link.data_received(GARBAGE * PIECE)
    assert len(link.heard) == PIECE
    assert not link.tcp.was_paused()


async def test_a_flood_is_read_in_turns_and_waits_when_its_share_is_used_up() -> None:
    link = Link(READ_TURN)
    pieces = int(READ_BURST / READ_TURN) + 5
    link.data_received(GARBAGE)
    assert not link.tcp.was_paused()
    link.data_received(GARBAGE * (pieces * PIECE // len(GARBAGE)))
    assert len(link.heard) <= PIECE // len(GARBAGE) + 2, "one piece, and others have their turn"
    assert link.tcp.was_paused()
    await asyncio.sleep(0)
    link.connection_lost(None)
    read = len(link.heard)
    await asyncio.sleep(0)
    assert len(link.heard) == read, "nothing is read after the end"


async def test_a_message_in_pieces_is_whole() -> None:
    link = Link(0.0)
    feedback = Feedback(
        event=1,
        issue=1,
        time=0.0,
        axes=[0.0] * len(DESCRIPTION.axes),
        joints=[0.0] * len(DESCRIPTION.joints),
        faults=["f" * 500] * 60,
    )
    message = frame(encode_message(feedback))
    assert len(message) > PIECE
    link.data_received(message)
    assert link.heard == [feedback]
