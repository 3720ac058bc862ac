"""What SCTP here does, in numbers: `python -m tests.rtc.sctp.figures`.

Times to the repeat of a lone lost message and packets per message come from a virtual clock and repeat exactly. The
processor time of a message, and all of aiortc's, is measured on this machine: the least of many stretches of 500.
"""

import asyncio
import time
from collections import deque
from collections.abc import Callable
from typing import Any

from aiortc import RTCDataChannel, RTCDataChannelParameters, RTCSctpCapabilities, RTCSctpTransport

from lockstep.rtc.channels import DataChannels
from lockstep.rtc.dcep import Reliability
from lockstep.rtc.sctp import SctpSettings
from tests.rtc.sctp.network import World, seeded
from tests.rtc.sctp.test_recovery_time import ROUND_TRIPS, repeated_after

STRETCH = 500
MESSAGES = 10_000
TEXT = "x" * 200
KINDS = {"newest-wins": Reliability(ordered=False, max_retransmits=0), "reliable": Reliability()}


def recovery() -> None:
    print("A lone reliable message is lost; it is repeated after (ms):")
    print("  round trip   first message   after 20   at most (1.5 RTT + 50)   aiortc: 1,000 or more")
    for round_trip in ROUND_TRIPS:
        first, later = (1000 * repeated_after(round_trip, warm_up=count) for count in (0, 20))
        print(f"  {1000 * round_trip:10.0f}{first:16.0f}{later:11.0f}{1500 * round_trip + 50:18.0f}")


def least(once: Callable[[], None], messages: int) -> float:
    """Microseconds of one, in the quickest stretch."""
    best = float("inf")
    for _ in range(messages // STRETCH):
        begun = time.process_time()
        for _ in range(STRETCH):
            once()
        best = min(best, time.process_time() - begun)
    return best / STRETCH * 1e6


def ours(reliability: Reliability, delay: float, *, interleaving: bool = False) -> tuple[float, float, float]:
    """Microseconds of a message from one end to the other, and packets there and back."""
    settings = SctpSettings(acknowledgement_delay=delay, interleaving=interleaving)
    one = DataChannels(settings, seeded(1), client=True)
    other = DataChannels(settings, seeded(2), client=False)
    world = World(one, other)
    one.association.start(0.0)
    channel = one.open("state", 0.0, reliability=reliability)
    world.run(2.0)
    for end in (one, other):
        end.events()
    packets = [0, 0]
    now = world.now

    def once() -> None:
        nonlocal now
        now += 0.01
        one.send(channel, TEXT, now)
        for packet in one.packets_to_send():
            packets[0] += 1
            other.receive_packet(packet, now)
        assert len(other.events()) == 1
        for packet in other.packets_to_send():
            packets[1] += 1
            one.receive_packet(packet, now)
        one.timer()
        other.timer()

    microseconds = least(once, MESSAGES)
    return microseconds, packets[0] / MESSAGES, packets[1] / MESSAGES


class _Wire:
    """What aiortc's SCTP wants of DTLS; packets wait in `queue` of the other end's."""

    state = "connected"

    def __init__(self, role: str) -> None:
        self._role = role
        self.queue: deque[bytes] = deque()
        self.sent = 0
        self.other: _Wire

    def _register_data_receiver(self, receiver: object) -> None: ...

    def _unregister_data_receiver(self, receiver: object) -> None: ...

    async def _send_data(self, data: bytes) -> None:
        self.sent += 1
        self.other.queue.append(data)


async def aiortcs(reliability: Reliability) -> tuple[float, float, float]:
    """The same of aiortc's SCTP, without anything that the console changes in it."""
    wires = _Wire("client"), _Wire("server")
    wires[0].other, wires[1].other = wires[1], wires[0]
    ends: list[Any] = []
    for wire in wires:
        transport: Any = wire
        ends.append(RTCSctpTransport(transport))

    async def settle() -> None:
        for wire, end in zip(wires, ends, strict=True):
            while wire.queue:
                await end._handle_data(wire.queue.popleft())

    for end in ends:
        await end.start(RTCSctpCapabilities(maxMessageSize=0), 5000)
    for _ in range(20):
        await settle()
        await asyncio.sleep(0)
    channel = RTCDataChannel(
        ends[0],
        RTCDataChannelParameters(
            label="state", ordered=reliability.ordered, maxRetransmits=reliability.max_retransmits
        ),
    )
    for _ in range(20):
        await settle()
        await asyncio.sleep(0)
    before = [wire.sent for wire in wires]
    best = float("inf")
    for _ in range(MESSAGES // STRETCH):
        begun = time.process_time()
        for _ in range(STRETCH):
            channel.send(TEXT)
            await asyncio.sleep(0)
            await settle()
            await settle()
        best = min(best, time.process_time() - begun)
    packets = [(wire.sent - count) / MESSAGES for wire, count in zip(wires, before, strict=True)]
    for end in ends:
        await end.stop()
    return best / STRETCH * 1e6, packets[0], packets[1]


def cost() -> None:
    print("A message of 200 characters, sent and received (µs of processor time; packets there + back):")
    for name, reliability in KINDS.items():
        theirs = asyncio.run(aiortcs(reliability))
        for label, figures in (
            ("acknowledged with delay", ours(reliability, 0.15)),
            ("acknowledged at once", ours(reliability, 0.0)),
            ("I-DATA, with delay", ours(reliability, 0.15, interleaving=True)),
            ("aiortc", theirs),
        ):
            microseconds, there, back = figures
            ratio = microseconds / theirs[0]
            print(f"  {name:12} {label:24} {microseconds:6.1f} µs ({ratio:.2f} of aiortc)  {there:.2f} + {back:.2f}")


if __name__ == "__main__":
    recovery()
    cost()
