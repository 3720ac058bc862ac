"""Measures the emulator's own delay: `python -m lockstep.bench.emulator_delay [--clients N]`.

The forwarder runs in this process, as it does in `lockstep network`; both ends of every connection are in another one.
Each client gets 3 Mbit/s of media, thirty bursts of ten packets a second, over a path of 50 ms. A packet carries the
time at which it was sent; both processes read the same monotonic clock.
"""

import asyncio
import json
import socket
import struct
import sys
import time
from typing import Annotated, Any

import typer
import uvloop
from aioice import stun

from lockstep.bench.figures.samples import quantile
from lockstep.bench.harness.processes import running_process
from lockstep.emulator.impairment.delay import Constant
from lockstep.emulator.impairment.deliveries import prefer_this_process
from lockstep.emulator.impairment.impairment import Impairment
from lockstep.emulator.impairment.profile import even_profile
from lockstep.emulator.network import Network
from lockstep.emulator.transport.udp_forwarder import UdpForwarder

__all__ = ["measure"]

DELAY = 0.05  # s
PATIENCE = 30.0  # s
FRAME_RATE = 30
BURST = 10  # packets
PACKET = 1250  # bytes
STAMP = struct.Struct("!xd")  # the first byte gives the kind
MEDIA = 0x80
OFFER, ANSWER = "client", "console"


async def measure(clients: int, seconds: float) -> dict[str, Any]:
    """Return the delay of packets besides the path's, in ms; the same without a forwarder; its share of a core."""
    command = [
        sys.executable,
        "-m",
        "lockstep.bench.emulator_delay",
        "--clients",
        str(clients),
        "--seconds",
        str(seconds),
    ]
    async with running_process(*command, "--ends") as (ends, _):
        direct = await ends.ask("[]", seconds + PATIENCE)
    async with (
        Network(even_profile("own", Impairment(delay=Constant(DELAY)))) as network,
        running_process(*command, "--ends") as (ends, ready),
    ):
        doors = [_lead(network.open_forwarder(), client, console) for client, console in ready["ports"]]
        began, used = time.monotonic(), time.process_time()
        forwarded = await ends.ask(json.dumps(doors), seconds + PATIENCE)
        core = (time.process_time() - used) / (time.monotonic() - began)
    return {
        "packets": forwarded["sent"],
        "lost": forwarded["sent"] - len(forwarded["took"]),
        "late_ms": _spread([each - DELAY * 1000 for each in forwarded["took"]]),
        "direct_ms": _spread(direct["took"]),
        "forwarder_core_percent": round(100 * core, 1),
    }


def _spread(values: list[float]) -> dict[str, float]:
    shares = {"least": 1e-9, "median": 0.5, "p99": 0.99, "most": 1.0}
    return {name: round(quantile(values, share), 3) for name, share in shares.items()}


def _lead(forwarder: UdpForwarder, client: int, console: int) -> int:
    """Lead a client and a console through the forwarder, and return the port at which the client finds it."""
    forwarder.offer(_description(OFFER, client))
    return int(forwarder.answer(_description(ANSWER, console)).split(" typ host")[0].rsplit(" ", 1)[1])


def _description(name: str, port: int) -> str:
    return f"a=ice-ufrag:{name}\r\nm=video 9 X\r\na=candidate:1 1 udp 5 127.0.0.1 {port} typ host\r\n"


class _Ends:
    """Both ends of all connections."""

    def __init__(self, clients: int) -> None:
        self.took: list[float] = []  # ms
        self.sent = 0
        self._pairs = [(_socket(), _socket()) for _ in range(clients)]

    @property
    def ports(self) -> list[list[int]]:
        return [[own.getsockname()[1] for own in pair] for pair in self._pairs]

    async def run(self, doors: list[int], seconds: float) -> None:
        behind: list[tuple[socket.socket, tuple[str, int]]] = []
        for (client, console), door in zip(self._pairs, doors, strict=True):
            check = stun.Message(message_method=stun.Method.BINDING, message_class=stun.Class.REQUEST)
            check.attributes["USERNAME"] = f"{ANSWER}:{OFFER}"
            client.sendto(bytes(check), ("127.0.0.1", door))
            console.settimeout(5)
            _, address = await asyncio.to_thread(console.recvfrom, 2000)
            console.setblocking(False)
            behind.append((console, address))
        await self._play(behind, seconds)

    async def run_directly(self, seconds: float) -> None:
        """Send without a forwarder, for the delay of the two ends and the system."""
        await self._play([(console, client.getsockname()) for client, console in self._pairs], seconds)

    async def _play(self, behind: list[tuple[socket.socket, tuple[str, int]]], seconds: float) -> None:
        loop = asyncio.get_running_loop()
        for client, _ in self._pairs:
            loop.add_reader(client, self._arrived, client)
        started = time.monotonic()
        for burst in range(int(seconds * FRAME_RATE)):
            for number, (console, address) in enumerate(behind):
                # Cameras are not in step with each other.
                await asyncio.sleep(started + (burst + number / len(behind)) / FRAME_RATE - time.monotonic())
                self._send(console, address)
        await asyncio.sleep(2 * DELAY + 0.2)

    def _send(self, console: socket.socket, address: tuple[str, int]) -> None:
        for _ in range(BURST):
            stamp = bytes([MEDIA]) + STAMP.pack(time.monotonic())[1:]
            console.sendto(stamp + bytes(PACKET - len(stamp)), address)
            self.sent += 1

    def _arrived(self, client: socket.socket) -> None:
        while True:
            try:
                data = client.recv(2000)
            except OSError:
                return
            self.took.append((time.monotonic() - STAMP.unpack_from(data)[0]) * 1000)


def _socket() -> socket.socket:
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    made.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
    made.bind(("127.0.0.1", 0))
    made.setblocking(False)
    return made


async def _be_the_ends(clients: int, seconds: float) -> None:
    ends = _Ends(clients)
    prefer_this_process()  # so that the forwarder is what limits the figures
    print(json.dumps({"ports": ends.ports}), flush=True)
    doors = json.loads(await asyncio.to_thread(sys.stdin.readline))
    await (ends.run(doors, seconds) if doors else ends.run_directly(seconds))
    print(json.dumps({"sent": ends.sent, "took": [round(each, 3) for each in ends.took]}), flush=True)


def _main(
    clients: Annotated[int, typer.Option(min=1, max=200)] = 3,
    seconds: Annotated[float, typer.Option(min=0.1, max=600)] = 10,
    ends: Annotated[bool, typer.Option("--ends", hidden=True)] = False,
) -> None:
    if ends:
        uvloop.run(_be_the_ends(clients, seconds))
        return
    preferred = prefer_this_process()
    print(json.dumps(uvloop.run(measure(clients, seconds)) | {"preferred": preferred}))


if __name__ == "__main__":
    typer.run(_main)
