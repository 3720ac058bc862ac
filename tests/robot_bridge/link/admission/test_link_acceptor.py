import asyncio
import contextlib
import os
import ssl
import threading
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from lockstep.robot_bridge.link.admission.known_addresses import KnownAddresses
from lockstep.robot_bridge.link.admission.link_acceptor import LinkAcceptor, listening_socket
from lockstep.robot_bridge.link.link_tls import LinkTls
from tests.support.certificates import Authority
from tests.waiting import PATIENCE


class Tls:
    """An acceptor that speaks TLS, and clients of it."""

    def __init__(self, directory: Path, known: KnownAddresses | None) -> None:
        authority = Authority(directory)
        listener = listening_socket("127.0.0.1", 0)
        self.port = int(listener.getsockname()[1])
        self.failures: asyncio.Queue[None] = asyncio.Queue()
        self._trust = LinkTls(authority=authority.certificate).client_context()
        self.acceptor = LinkAcceptor(
            listener,
            LinkTls(certificate=authority.issue("bridge")).bridge_context(),
            asyncio.Protocol,
            lambda: self.failures.put_nowait(None),
            max_handshakes=8,
            known=known,
        )

    async def shake(self, host: str) -> None:
        """Returns when the handshake from this address is over."""
        _, writer = await self._open(host, self._trust)
        writer.close()
        with contextlib.suppress(ConnectionError, ssl.SSLError):
            await writer.wait_closed()

    async def say(self, data: bytes) -> asyncio.StreamWriter:
        """A connection from an address of its own that says this, and then nothing."""
        _, writer = await self._open("127.0.0.9", None)
        writer.write(data)
        return writer

    async def _open(self, host: str, trust: ssl.SSLContext | None) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
        return await asyncio.open_connection("127.0.0.1", self.port, ssl=trust, local_addr=(host, 0))


@asynccontextmanager
async def tls_acceptor(directory: Path, known: KnownAddresses | None = None) -> AsyncIterator[Tls]:
    tls = Tls(directory, known)
    async with asyncio.TaskGroup() as tasks:
        tasks.create_task(tls.acceptor.run())
        try:
            async with asyncio.timeout(PATIENCE):
                yield tls
        finally:
            await tls.acceptor.close()


@pytest.fixture
def one_handshake(monkeypatch: pytest.MonkeyPatch) -> None:
    """Strangers begin one, and the next a quarter of an hour later."""
    monkeypatch.setattr("lockstep.robot_bridge.link.admission.link_acceptor.HANDSHAKE_RATE", 0.001)
    monkeypatch.setattr("lockstep.robot_bridge.link.admission.link_acceptor.HANDSHAKE_BURST", 1)


@pytest.mark.usefixtures("one_handshake")
async def test_handshakes_of_strangers_wait_for_their_pace_and_an_address_that_was_admitted_does_not(
    tmp_path: Path,
) -> None:
    async with tls_acceptor(tmp_path) as tls:
        await tls.shake("127.0.0.2")
        waits = asyncio.create_task(tls.shake("127.0.0.2"))
        tls.acceptor.admitted("127.0.0.3")
        await tls.shake("127.0.0.3")
        assert not waits.done()
        waits.cancel()


@pytest.mark.usefixtures("one_handshake")
async def test_what_is_not_a_whole_record_takes_no_handshake_from_anybody(tmp_path: Path) -> None:
    async with tls_acceptor(tmp_path) as tls:
        says = [b"\x16\x03\x01\x02\x00\x01"] * 3 + [b"\x16\x03\x01\xff\xff" + bytes(1000), b"GET"]
        said = [await tls.say(each) for each in says]
        await tls.failures.get()
        said[-1].close()
        await tls.failures.get()
        await tls.shake("127.0.0.2")
        for each in said:
            each.transport.abort()


async def test_an_address_that_is_admitted_while_others_are_written_is_written_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "addresses.txt"
    begun, goes_on = threading.Event(), threading.Event()
    replace = os.replace

    def slow(fresh: Path, to: Path) -> None:
        begun.set()
        assert goes_on.wait(PATIENCE)
        replace(fresh, to)

    monkeypatch.setattr("lockstep.robot_bridge.link.admission.known_addresses.os.replace", slow)
    async with tls_acceptor(tmp_path, KnownAddresses(path)) as tls:
        tls.acceptor.admitted("192.0.2.1")
        await asyncio.to_thread(begun.wait, PATIENCE)
        tls.acceptor.admitted("192.0.2.2")
        goes_on.set()
    assert path.read_text().split() == ["192.0.2.1", "192.0.2.2"]


async def test_a_closing_that_is_cancelled_leaves_no_socket_open(monkeypatch: pytest.MonkeyPatch) -> None:
    listener = listening_socket("127.0.0.1", 0)
    acceptor = LinkAcceptor(listener, None, asyncio.Protocol, lambda: None, max_handshakes=1)
    async with asyncio.TaskGroup() as tasks:
        tasks.create_task(acceptor.run())
        await asyncio.sleep(0)  # it begins
        closing = tasks.create_task(acceptor.close())
        await asyncio.sleep(0)  # it waits for the task that accepts
        closing.cancel()
        with pytest.raises(asyncio.CancelledError):
            await closing
        assert listener.fileno() == -1


async def test_an_acceptor_that_is_closed_before_it_runs_accepts_nothing() -> None:
    acceptor = LinkAcceptor(listening_socket("127.0.0.1", 0), None, asyncio.Protocol, lambda: None, max_handshakes=1)
    await acceptor.close()
    await acceptor.run()


async def test_a_fault_in_one_connection_ends_no_other_and_not_the_acceptor() -> None:
    faults = iter([RuntimeError("planted")])
    served: asyncio.Queue[asyncio.Protocol] = asyncio.Queue()

    def factory() -> asyncio.Protocol:
        for fault in faults:
            raise fault
        served.put_nowait(protocol := asyncio.Protocol())
        return protocol

    listener, failures = listening_socket("127.0.0.1", 0), list[bool]()
    acceptor = LinkAcceptor(listener, None, factory, lambda: failures.append(True), max_handshakes=1)
    async with asyncio.TaskGroup() as tasks, asyncio.timeout(PATIENCE):
        tasks.create_task(acceptor.run())
        reader, unlucky = await asyncio.open_connection(*listener.getsockname()[:2])
        assert await reader.read() == b""
        _, lucky = await asyncio.open_connection(*listener.getsockname()[:2])
        await served.get()
        assert failures == [True]
        for each in (unlucky, lucky):
            each.transport.abort()
        await acceptor.close()
