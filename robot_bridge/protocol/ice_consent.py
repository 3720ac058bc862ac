"""Consent to send on an ICE connection (RFC 7675), for the console and for the client: `keep_consent`.

aioice gives each check half a second, so that on a path with a longer round trip no answer is ever in time, and after
six checks it closes a connection on which everything arrives. RFC 7675 5.1 says otherwise: a check is sent every 4 to 6
seconds and never repeated, and consent expires 30 s after the last valid answer, however late that answer came.

Only an answer counts, and not a check of the peer's: an attacker can record checks and send them again, while an
answer names 96 random bits of a check that is at most 30 s old and is authenticated with the connection's password.

`Consent` is the rule. `keep_consent` replaces two public methods of one aioice connection, `query_consent` and
`check_complete`, and uses others; `require_consent_hooks` says at start when one of them is gone.
docs/upstream/ has the same as a change to aioice.
"""

import asyncio
import random
from collections.abc import Callable
from typing import Any

__all__ = ["CHECK_SECONDS", "EXPIRY_SECONDS", "Consent", "keep_consent", "require_consent_hooks"]

CHECK_SECONDS = (4.0, 6.0)  # between two checks, drawn evenly (RFC 7675 5.1)
EXPIRY_SECONDS = 30.0  # after the last valid answer (RFC 7675 5.1)
SUCCESS_RESPONSE = 0x100  # the class bits of a STUN success response (RFC 8489 5)
CONNECTION_HOOKS = ("build_request", "check_complete", "close", "connect", "query_consent")
PROTOCOL_HOOKS = ("send_stun",)


class Consent:
    """When to check the path next, and whether consent has expired. Times are seconds of one monotonic clock."""

    def __init__(self, now: float, draw: Callable[[float, float], float] = random.uniform) -> None:
        """Consent begins with `now`, when ICE's own check succeeded. `draw` chooses evenly between two numbers."""
        self.expires_at = now + EXPIRY_SECONDS
        self._draw = draw
        self.next_check_at = now + draw(*CHECK_SECONDS)

    def checked(self, now: float) -> None:
        """A check was sent."""
        self.next_check_at = now + self._draw(*CHECK_SECONDS)

    def answered(self, now: float) -> None:
        """A valid answer came, to whichever check of the last 30 s."""
        self.expires_at = now + EXPIRY_SECONDS

    def expired(self, now: float) -> bool:
        return now >= self.expires_at

    def wait(self, now: float) -> float:
        """Seconds until there is something to do."""
        return max(0.0, min(self.next_check_at, self.expires_at) - now)


class _Check:
    """Stands for one check among a socket's transactions, for as long as its answer would count."""

    def __init__(self, address: tuple[str, int], key: bytes, answered: Callable[[], None]) -> None:
        self._address = address
        self._key = key
        self._answered = answered

    def response_received(self, message: Any, addr: tuple[str, int]) -> None:
        """aioice found the transaction; an answer from elsewhere or without the password is not consent."""
        if message.message_class != SUCCESS_RESPONSE or addr != self._address:
            return
        if message.check_message_integrity(self._key):
            self._answered()


class _ConsentKeeper:
    """The checks of one connection, on the pair that was nominated last."""

    def __init__(self, connection: Any, on_expired: Callable[[], bool | None]) -> None:
        self._connection = connection
        self._complete = connection.check_complete
        self._on_expired = on_expired
        self._pair: Any = None
        self._consent: Consent | None = None
        self._open: list[tuple[float, Any, bytes]] = []  # (sent at, socket, transaction) of checks without an answer
        self._closing: asyncio.Task[None] | None = None

    def check_complete(self, pair: Any) -> None:
        """In place of aioice's: a pair that succeeded and is nominated carries the data from now on."""
        self._complete(pair)
        if pair.nominated and pair.state.name == "SUCCEEDED":
            self._pair = pair
            if self._consent is not None:
                self._consent.answered(asyncio.get_running_loop().time())

    async def query_consent(self) -> None:
        """In place of aioice's, which `connect` starts and `close` cancels. Ends when consent has expired."""
        loop = asyncio.get_running_loop()
        consent = self._consent = Consent(loop.time())
        try:
            while True:
                await asyncio.sleep(consent.wait(loop.time()))
                await asyncio.sleep(0)  # after a pause of the whole process: received answers count first
                now = loop.time()
                if consent.expired(now):
                    break
                if now >= consent.next_check_at:
                    consent.checked(now)
                    self._send_check(now)
        finally:
            self._forget(float("inf"))
        if self._on_expired():
            return
        # `close` waits for this very task, so that another one has to call it.
        self._closing = loop.create_task(self._connection.close(), name="ice consent expired")

    def _send_check(self, now: float) -> None:
        self._forget(now - EXPIRY_SECONDS)
        connection, pair = self._connection, self._pair
        key = connection.remote_password.encode()
        request = connection.build_request(pair, nominate=False)
        request.add_message_integrity(key)
        transaction = request.transaction_id
        pair.protocol.transactions[transaction] = _Check(pair.remote_addr, key, lambda: self._answered(pair))
        self._open.append((now, pair.protocol, transaction))
        pair.protocol.send_stun(request, pair.remote_addr)

    def _answered(self, pair: Any) -> None:
        if pair is self._pair and self._consent is not None:
            self._consent.answered(asyncio.get_running_loop().time())

    def _forget(self, sent_before: float) -> None:
        for sent, protocol, transaction in self._open:
            if sent < sent_before:
                protocol.transactions.pop(transaction, None)
        self._open = [each for each in self._open if each[0] >= sent_before]


def keep_consent(connection: Any, on_expired: Callable[[], bool | None] = lambda: None) -> None:
    """Let `connection`, one of aioice with one component, end after 30 s without a valid answer and no sooner.

    Call before its `connect`. `on_expired` is called once, before the connection closes because of it. True: the
    connection does not close, and the called party sends nothing more by it.

    Raises:
        RuntimeError: as `require_consent_hooks`.
    """
    _require(connection, CONNECTION_HOOKS)
    keeper = _ConsentKeeper(connection, on_expired)
    connection.check_complete = keeper.check_complete
    connection.query_consent = keeper.query_consent


def require_consent_hooks(connection_class: type, protocol_class: type) -> None:
    """For the start of a program: aioice's classes have what `keep_consent` uses.

    Raises:
        RuntimeError: one is gone; without it connections would end on long paths.
    """
    _require(connection_class, CONNECTION_HOOKS)
    _require(protocol_class, PROTOCOL_HOOKS)


def _require(owner: Any, names: tuple[str, ...]) -> None:
    for name in names:
        if not callable(getattr(owner, name, None)):
            raise RuntimeError(f"aioice has no {name} any more: see robot_bridge/protocol/ice_consent.py")
