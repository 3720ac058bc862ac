"""Measures the cost of a datagram in the console's UDP socket: whole pictures in one call, and one by one."""

import time
from contextlib import ExitStack, closing

from lockstep.bench.context import Context
from lockstep.bench.figures.results import Result
from lockstep.rtc.addresses import Datagram, Path
from lockstep.rtc.sockets.udp_socket import UdpSocket

__all__ = ["run"]

SECTION = "datagrams"
HOST = "127.0.0.1"
SIZE = 1200  # bytes
DATAGRAMS = 384  # of each turn
SHAPES = ((1, 384), (64, 6), (384, 1))  # peers, and datagrams for each
TURNS, QUICK_TURNS = 1000, 20


async def run(context: Context) -> list[Result]:
    turns = context.scale(TURNS, QUICK_TURNS)
    return [_compare(peers, each, turns) for peers, each in SHAPES]


def _compare(peers: int, each: int, turns: int) -> Result:
    with ExitStack() as stack:
        receivers = [stack.enter_context(closing(UdpSocket.bind(HOST, 0))) for _ in range(peers)]
        sockets = [stack.enter_context(closing(UdpSocket.bind("0.0.0.0", 0, segments=cut))) for cut in (True, False)]
        seconds = [0.0, 0.0]
        for _ in range(turns):  # in turns, so that a busy machine affects both alike
            for place, sender in enumerate(sockets):
                seconds[place] += _send(sender, receivers, each)
    in_one, one_by_one = (1e6 * spent / turns / DATAGRAMS for spent in seconds)
    return Result(
        section=SECTION,
        name=f"sending, {peers} peers, {each} datagrams for each",
        value=in_one,
        unit="µs of processor for a datagram",
        baseline=one_by_one,
        baseline_name="one system call for each",
        samples=turns * DATAGRAMS,
        conditions=f"{SIZE} bytes, loopback, the receiver's share of the kernel's work included",
    )


def _send(sender: UdpSocket, receivers: list[UdpSocket], each: int) -> float:
    """Send the datagrams, and return this process' time in s."""
    paths = [Path((HOST, sender.address[1]), receiver.address) for receiver in receivers]
    datagrams = [Datagram(bytes(SIZE), path) for path in paths for _ in range(each)]
    began = time.process_time()
    sender.queue(datagrams)
    sender.flush()
    spent = time.process_time() - began
    for receiver in receivers:
        while receiver.receive():
            pass
    return spent
