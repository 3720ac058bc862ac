"""RFC 7675: when consent is checked, what renews it, and when it has expired."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

import aioice.ice
import aioice.stun
import pytest
from aioice import Candidate, Connection
from aioice.candidate import candidate_foundation, candidate_priority

from robot_bridge.protocol import ice_consent
from robot_bridge.protocol.ice_consent import (
    CHECK_SECONDS,
    EXPIRY_SECONDS,
    Consent,
    keep_consent,
    require_consent_hooks,
)

TICK = 0.02  # s that stand for 5 s between two checks
LATE = 5 * TICK  # an answer takes as long as five checks are apart


def test_checks_are_four_to_six_seconds_apart_and_consent_lasts_thirty() -> None:
    assert (CHECK_SECONDS, EXPIRY_SECONDS) == ((4.0, 6.0), 30.0)
    drawn = iter([4.0, 6.0])
    consent = Consent(100.0, lambda low, high: next(drawn))
    assert consent.next_check_at == 104.0
    consent.checked(104.0)
    assert consent.next_check_at == 110.0
    assert consent.wait(105.0) == 5.0
    assert consent.wait(111.0) == 0.0


def test_consent_expires_thirty_seconds_after_the_last_answer_and_no_sooner() -> None:
    consent = Consent(0.0)
    assert not consent.expired(29.99)
    consent.answered(29.99)
    assert not consent.expired(59.98)
    assert consent.expired(59.99)


def test_a_path_of_any_delay_keeps_consent_while_a_tenth_of_its_answers_comes() -> None:
    for round_trip in (0.0, 0.3, 0.6, 1.2, 5.0, 20.0):
        consent, now, sent, answers = Consent(0.0, lambda low, high: high), 0.0, 0, list[float]()
        while now < 600.0:
            now = min([consent.next_check_at, *answers])
            assert not consent.expired(now), round_trip
            if answers and answers[0] == now:
                answers.pop(0)
                consent.answered(now)
            else:
                consent.checked(now)
                if sent % 2 == 0:  # every other one is lost
                    answers.append(now + round_trip)
                sent += 1


@asynccontextmanager
async def _connected(answer_delay: float) -> AsyncIterator[tuple[Connection, Connection]]:
    """Two of aioice's on loopback, connected; from then on the second one's answers take `answer_delay`."""
    ends = [Connection(ice_controlling=True), Connection(ice_controlling=False)]
    for end in ends:
        _gather_on_loopback(end)
        await end.gather_candidates()
    for end, other in (ends, ends[::-1]):
        end.remote_username, end.remote_password = other.local_username, other.local_password
        for candidate in other.local_candidates:
            await end.add_remote_candidate(candidate)
        await end.add_remote_candidate(None)
    try:
        await asyncio.gather(*(end.connect() for end in ends))
        _answer_late(ends[1], answer_delay)
        yield ends[0], ends[1]
    finally:
        await asyncio.gather(*(end.close() for end in ends))


def _gather_on_loopback(end: Any) -> None:
    gather = end.get_component_candidates

    async def gather_here(component: int, addresses: list[str]) -> Any:
        return await gather(component=component, addresses=["127.0.0.1"])

    end.get_component_candidates = gather_here


def _answer_late(end: Any, delay: float) -> None:
    for pair in end._nominated.values():
        send = pair.protocol.send_stun

        def send_if_open(
            message: Any, address: Any, send: Any = send, transport: Any = pair.protocol.transport
        ) -> None:
            if not transport.is_closing():
                send(message, address)

        def send_late(message: Any, address: Any, send: Any = send_if_open) -> None:
            if message.message_class == aioice.stun.Class.RESPONSE:
                asyncio.get_running_loop().call_later(delay, send, message, address)
            else:
                send(message, address)

        pair.protocol.send_stun = send_late


@pytest.fixture
def hasty(monkeypatch: pytest.MonkeyPatch) -> None:
    """All times a 250th of what they are, in aioice and here."""
    monkeypatch.setattr(aioice.ice, "CONSENT_INTERVAL", TICK)
    monkeypatch.setattr(aioice.stun, "RETRY_RTO", TICK / 10)
    monkeypatch.setattr(ice_consent, "CHECK_SECONDS", (0.8 * TICK, 1.2 * TICK))
    monkeypatch.setattr(ice_consent, "EXPIRY_SECONDS", 60 * TICK)


async def _answers(end: Any, count: int) -> None:
    """Returns when so many checks of `end` were answered."""
    came = asyncio.Semaphore(0)
    for pair in end._nominated.values():
        receive = pair.protocol.datagram_received

        def received(data: Any, address: Any, receive: Any = receive) -> None:
            receive(data, address)
            if data[:2] == b"\x01\x01":  # a binding response
                came.release()

        pair.protocol.datagram_received = received
    for _ in range(count):
        await came.acquire()


@pytest.mark.usefixtures("hasty")
async def test_answers_that_come_after_the_next_checks_keep_a_connection() -> None:
    patched = pytest.MonkeyPatch()
    build = Connection.__init__

    def built(self: Any, *arguments: Any, **more: Any) -> None:
        build(self, *arguments, **more)
        keep_consent(self)

    patched.setattr(Connection, "__init__", built)
    try:
        async with asyncio.timeout(20), _connected(LATE) as (end, other):
            await _answers(end, 100)  # aioice alone gives up after six checks
            await end.send(b"still here")
            assert await other.recv() == b"still here"
    finally:
        patched.undo()


@pytest.mark.usefixtures("hasty")
async def test_aioice_alone_still_closes_a_connection_whose_answers_come_late() -> None:
    """When this fails, aioice has been mended, and ice_consent.py can go."""
    async with asyncio.timeout(20), _connected(LATE) as (end, _):
        assert isinstance(await end.get_event(), aioice.ice.ConnectionClosed)


class _Pair:
    """A nominated pair whose checks nobody answers, or whoever a test lets answer."""

    remote_addr = ("192.0.2.1", 4000)
    nominated = True
    state = aioice.ice.CandidatePair.State.SUCCEEDED
    component = 1

    def __init__(self) -> None:
        self.protocol = self
        self.transactions: dict[bytes, Any] = {}
        self.sent = asyncio.Queue[aioice.stun.Message]()
        self.local_candidate = Candidate(
            foundation=candidate_foundation("host", "udp", "127.0.0.1"),
            component=1,
            transport="udp",
            priority=candidate_priority(1, "host"),
            host="127.0.0.1",
            port=1,
            type="host",
        )

    def send_stun(self, message: aioice.stun.Message, address: tuple[str, int]) -> None:
        assert address == self.remote_addr
        self.sent.put_nowait(message)


class _Rigged:
    """A connection that has nominated `pair` and begins to check; `expired` says that it gave up."""

    def __init__(self) -> None:
        self.connection = Connection(ice_controlling=True)
        self.connection.remote_username, self.connection.remote_password = "them", "p" * 22
        self.expired = asyncio.Event()
        keep_consent(self.connection, self.expired.set)
        self.pair = _Pair()
        self.connection.check_complete(self.pair)  # type: ignore[arg-type]
        self.task = asyncio.create_task(self.connection.query_consent())

    async def answer(self, password: str, address: tuple[str, int], kind: int = aioice.stun.Class.RESPONSE) -> None:
        """To the next check."""
        asked = await self.pair.sent.get()
        answer = aioice.stun.Message(asked.message_method, aioice.stun.Class(kind), asked.transaction_id)
        answer.add_message_integrity(password.encode())
        self.pair.transactions[asked.transaction_id].response_received(answer, address)

    async def close(self) -> None:
        await self.connection.close()
        self.task.cancel()
        await asyncio.gather(self.task, return_exceptions=True)


@asynccontextmanager
async def _rigged() -> AsyncIterator[_Rigged]:
    rigged = _Rigged()
    try:
        async with asyncio.timeout(20):
            yield rigged
    finally:
        await rigged.close()


@pytest.mark.usefixtures("hasty")
async def test_a_connection_that_nobody_answers_ends_and_says_so_first() -> None:
    async with _rigged() as rigged:
        closed = asyncio.create_task(rigged.connection.get_event())
        await rigged.expired.wait()
        assert isinstance(await closed, aioice.ice.ConnectionClosed)
        assert not rigged.pair.transactions, "no check is remembered"


@pytest.mark.usefixtures("hasty")
@pytest.mark.parametrize(
    ("password", "address", "kind"),
    [
        ("q" * 22, _Pair.remote_addr, aioice.stun.Class.RESPONSE),
        ("p" * 22, ("192.0.2.9", 4000), aioice.stun.Class.RESPONSE),
        ("p" * 22, _Pair.remote_addr, aioice.stun.Class.ERROR),
    ],
)
async def test_an_answer_of_somebody_else_or_an_error_is_no_consent(
    password: str, address: tuple[str, int], kind: int
) -> None:
    async with _rigged() as rigged:
        while not rigged.expired.is_set():
            answering = asyncio.create_task(rigged.answer(password, address, kind))
            await asyncio.wait({answering, asyncio.create_task(rigged.expired.wait())}, return_when="FIRST_COMPLETED")
            answering.cancel()


@pytest.mark.usefixtures("hasty")
async def test_checks_without_an_answer_are_forgotten_when_it_could_not_count_any_more(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(ice_consent, "EXPIRY_SECONDS", 10 * TICK)
    async with _rigged() as rigged:
        for _ in range(60):
            await rigged.answer("p" * 22, _Pair.remote_addr)
            assert len(rigged.pair.transactions) <= 16
        assert not rigged.expired.is_set()


@pytest.mark.usefixtures("hasty")
async def test_a_pair_that_is_nominated_later_is_checked_from_then_on() -> None:
    async with _rigged() as rigged:
        await rigged.answer("p" * 22, _Pair.remote_addr)
        newer = _Pair()
        rigged.connection.check_complete(newer)  # type: ignore[arg-type]
        await newer.sent.get()
        while not rigged.pair.sent.empty():
            rigged.pair.sent.get_nowait()
        await newer.sent.get()
        assert rigged.pair.sent.empty()


def test_a_program_does_not_start_when_aioice_has_lost_what_consent_needs() -> None:
    require_consent_hooks(aioice.Connection, aioice.ice.StunProtocol)

    class Other:
        def close(self) -> None: ...

    with pytest.raises(RuntimeError, match="aioice has no build_request any more"):
        require_consent_hooks(Other, aioice.ice.StunProtocol)
    with pytest.raises(RuntimeError, match="aioice has no build_request any more"):
        keep_consent(Other())
