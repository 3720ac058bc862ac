"""Measures the time from sending a command to its feedback over a bad network: 5 % loss each way, 100 ms round trip.

The client reaches its console through the network emulator, which delays and loses packets, exactly repeatably. The
baseline runs beside it through an emulator with the same loss and delay: two plain aiortc peers, one of which echoes
the other's messages, on a reliable ordered data channel, one message at a time. Its echo does no work, so its time is
the channel's alone.
"""

import asyncio
import time
from dataclasses import dataclass

from aiortc import RTCConfiguration, RTCDataChannel, RTCPeerConnection

from lockstep.bench.context import Context
from lockstep.bench.figures.results import Result
from lockstep.bench.figures.samples import quantile
from lockstep.bench.harness.driving import console_trips
from lockstep.bench.harness.loopback_peers import connect_through
from lockstep.bench.harness.stack import running_stack
from lockstep.client import Console
from lockstep.emulator import Constant, Impairment, Network, NetworkProcess, bursty, even_profile

__all__ = ["run"]

SECTION = "lossy"
ROUND_TRIP_MS = 100.0
BURST = 4.0  # packets in a row, on average
LOSSY = even_profile("lossy", Impairment(delay=Constant(ROUND_TRIP_MS / 2000), loss=bursty(0.05, BURST)))
EVENTS, QUICK_EVENTS = 500, 60
SECONDS = 75.0  # at most
P99_ROUND_TRIPS = 2.5
RELIABLE = "an echo over a reliable, ordered data channel of plain aiortc through the same loss and delay"


@dataclass(frozen=True)
class _Ours:
    trips: list[float]  # ms
    lost: int  # packets
    passed: int


async def run(context: Context) -> list[Result]:
    count = context.scale(EVENTS, QUICK_EVENTS)
    ours, echoes = await asyncio.gather(_lockstep(count), _echoes(count))
    lost = ours.lost / (ours.lost + ours.passed)
    conditions = (
        f"100 ms round trip, 5 % loss each way, {BURST:g} packets in a row on average ({lost:.1%} of "
        f"{ours.lost + ours.passed} packets), planar robot; {len(ours.trips)} events, {len(echoes)} echoes"
    )

    def row(name: str, share: float, *, scale: float = 1.0, unit: str = "ms", target: float | None = None) -> Result:
        return Result(
            section=SECTION,
            name=name,
            value=quantile(ours.trips, share) * scale,
            unit=unit,
            target=target,
            baseline=quantile(echoes, share) * scale,
            baseline_name=RELIABLE,
            samples=len(ours.trips),
            conditions=conditions,
        )

    per_trip = 1 / ROUND_TRIP_MS
    return [
        row("command → feedback, median", 0.5),
        row("p99", 0.99),
        row("worst", 1.0),
        row("median, in round trips", 0.5, scale=per_trip, unit="RTT"),
        row("p99, in round trips", 0.99, scale=per_trip, unit="RTT", target=P99_ROUND_TRIPS),
    ]


async def _lockstep(count: int) -> _Ours:
    async with (
        running_stack("planar") as stack,
        NetworkProcess(LOSSY, console_url=stack.url, seed=7) as network,
        Console(network.link(stack.operator), name="bench", decode=False) as console,
    ):
        await console.take_seat()
        await console_trips(console, 10)  # the first round trips teach the repeat timer
        trips = await console_trips(console, count, seconds=SECONDS)
        paths = network.statistics().paths
        counts = [each for kind in ("stun", "control", "media") for each in paths[kind].values()]
        return _Ours(
            [trip.seconds * 1000 for trip in trips],
            sum(each.lost for each in counts),
            sum(each.passed for each in counts),
        )


async def _echoes(count: int) -> list[float]:
    """Return the round trips in ms."""
    async with Network(LOSSY, seed=7) as network:
        asking = RTCPeerConnection(RTCConfiguration(iceServers=[]))
        answering = RTCPeerConnection(RTCConfiguration(iceServers=[]))
        try:
            channel = asking.createDataChannel("reliable")
            answering.on("datachannel", _echo)
            await connect_through(network.open_forwarder(), asking, answering)
            return await _ask(channel, count)
        finally:
            await asking.close()
            await answering.close()


def _echo(channel: RTCDataChannel) -> None:
    channel.on("message", channel.send)


async def _ask(channel: RTCDataChannel, count: int) -> list[float]:
    """Send one message at a time, the next when the last came back; return the round trips in ms."""
    opened, returned = asyncio.Event(), asyncio.Event()
    channel.on("open", opened.set)
    channel.on("message", lambda _: returned.set())
    if channel.readyState != "open":
        await opened.wait()
    times: list[float] = []
    end = time.monotonic() + SECONDS
    while len(times) < count and time.monotonic() < end:
        returned.clear()
        sent = time.monotonic()
        channel.send("x" * 100)  # about as long as a command
        await returned.wait()
        times.append((time.monotonic() - sent) * 1000)
    return times
