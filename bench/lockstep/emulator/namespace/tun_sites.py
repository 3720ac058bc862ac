"""Network namespaces that only reach each other by what a subclass passes on."""

import asyncio
import os
import signal
import sys
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AsyncExitStack, suppress
from pathlib import Path
from types import TracebackType
from typing import Any, Generic, Self, TypeVar

from lockstep.emulator.impairment.deliveries import Deliveries
from lockstep.emulator.namespace.tun import Tun, open_tun

__all__ = ["TunSites"]

ENTER = Path(__file__).with_name("enter.py")
MAX_PACKET = 65536
BATCH = 64  # packets read in one turn of the loop
STOP_SECONDS = 10.0

Site = TypeVar("Site", bound=str)


class TunSites(ABC, Generic[Site]):
    """A namespace for each site. Enter it, then `start` processes at the sites; leaving ends them.

    Linux and root only.

    Raises:
        NamespacesUnavailable: on entering; names the missing part.
    """

    def __init__(self, addresses: Mapping[Site, str]) -> None:
        """`addresses`: the IPv4 address of each site, as its processes see it."""
        self._addresses = dict(addresses)
        self._tuns: dict[Site, Tun] = {}
        self._stack = AsyncExitStack()

    async def __aenter__(self) -> Self:
        async with AsyncExitStack() as stack:
            loop = asyncio.get_running_loop()
            self._deliveries = Deliveries()
            stack.callback(self._deliveries.close)
            for site, address in self._addresses.items():
                tun = await asyncio.to_thread(open_tun, address)
                stack.callback(tun.close)
                self._tuns[site] = tun
            for site, tun in self._tuns.items():
                loop.add_reader(tun.packets, self._read, site)
                stack.callback(loop.remove_reader, tun.packets)
            self._stack = stack.pop_all()
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self._stack.aclose()

    async def start(self, site: Site, command: Sequence[str], **options: Any) -> asyncio.subprocess.Process:
        """Start a process that only knows its site's network; `options` are those of `create_subprocess_exec`."""
        descriptor = self._tuns[site].namespace
        process = await asyncio.create_subprocess_exec(
            *(sys.executable, "-I", str(ENTER), str(descriptor), *command),
            pass_fds=(descriptor,),
            start_new_session=True,
            **options,
        )
        self._stack.push_async_callback(_end_process, process)
        return process

    @abstractmethod
    def _left(self, site: Site, packet: bytes) -> None:
        """Take a packet that has left a site, and `_deliver` it where it arrives."""

    def _deliver(self, site: Site, packet: bytes, at: float) -> None:
        """Let a packet arrive at a site at a time of `time.monotonic()`."""
        self._deliveries.at(at, _write_packet, self._tuns[site].packets, packet)

    def _read(self, site: Site) -> None:
        for packet in _packets(self._tuns[site].packets):
            self._left(site, packet)


def _packets(descriptor: int) -> Iterator[bytes]:
    for _ in range(BATCH):
        try:
            yield os.read(descriptor, MAX_PACKET)
        except OSError:
            return


def _write_packet(descriptor: int, packet: bytes) -> None:
    with suppress(OSError):  # the queue is full, or the device is closed
        os.write(descriptor, packet)


async def _end_process(process: asyncio.subprocess.Process) -> None:
    """End the process and all that it started."""
    for number in (signal.SIGTERM, signal.SIGKILL):
        with suppress(ProcessLookupError):
            os.killpg(process.pid, number)
        with suppress(TimeoutError):
            async with asyncio.timeout(STOP_SECONDS):
                await process.wait()
