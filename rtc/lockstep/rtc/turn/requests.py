"""Requests to a server, which are repeated until they are answered (RFC 8489 6.2), with long-term credentials (9.2)."""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from lockstep.rtc.stun import (
    BINDING,
    Kind,
    StunError,
    StunErrorCode,
    is_authentic,
    pack,
    parse_error_code,
    read_attributes,
    transaction_of,
)
from lockstep.rtc.turn.messages import Attribute, long_term_key
from lockstep.rtc.turn.settings import TurnSettings

__all__ = ["TIMEOUT", "Answer", "Request", "Requests"]

UNAUTHENTICATED, STALE_NONCE = 401, 438
TIMEOUT = StunErrorCode(408, "no answer")  # a code of this package: RFC 8489 has none for it
Attributes = Sequence[tuple[int, bytes]]


@dataclass(slots=True, eq=False)
class Request:
    """A request that waits for its answer."""

    method: int
    attributes: Attributes
    subject: object = None  # chosen by its user
    transaction: bytes = b""
    data: bytes = b""
    due_at: float = 0.0  # the time to repeat it, or to give it up
    wait: float = 0.0
    sent: int = 0
    nonce: bytes | None = None  # the nonce that it was sent with


@dataclass(frozen=True, slots=True)
class Answer:
    """The outcome of a request."""

    request: Request
    error: StunErrorCode | None  # None: success
    attributes: dict[int, bytes] = field(default_factory=dict)


class Requests:
    """Repeats requests until they are answered. `begin`, then as every core: pass the server's answers to `receive`;
    drain `data_to_send` and `answers`."""

    def __init__(
        self,
        random_bytes: Callable[[int], bytes],
        settings: TurnSettings,
        *,
        username: str | None = None,
        password: str | None = None,
        reliable: bool = False,
    ) -> None:
        """`reliable`: True on a stream, where nothing is repeated (RFC 8489 6.2.2)."""
        self.counts: Counter[str] = Counter()
        self._random_bytes = random_bytes
        self._settings = settings
        self._username, self._password = username, password
        self._reliable = reliable
        self._realm: bytes | None = None
        self._nonce: bytes | None = None
        self._key: bytes | None = None  # None until the server has named its realm
        self._pending: dict[bytes, Request] = {}
        self._out: list[bytes] = []
        self._answers: list[Answer] = []

    def begin(self, method: int, attributes: Attributes, now: float, subject: object = None) -> None:
        self._send(Request(method, attributes, subject), now)

    def is_pending(self, subject: object) -> bool:
        return any(each.subject is subject for each in self._pending.values())

    def forget(self) -> None:
        """Forget all requests: nobody waits for answers any more."""
        self._pending.clear()

    def _send(self, request: Request, now: float) -> None:
        settings = self._settings
        request.transaction, request.nonce, request.sent = self._random_bytes(12), self._nonce, 1
        attributes = list(request.attributes)
        if self._key is not None and self._realm is not None and self._nonce is not None:
            attributes.append((Attribute.USERNAME, (self._username or "").encode()))
            attributes += [(Attribute.REALM, self._realm), (Attribute.NONCE, self._nonce)]
        request.data = pack(Kind.REQUEST, request.method, request.transaction, attributes, self._key)
        request.wait = settings.rto
        whole = settings.rto * (2 ** (settings.transmissions - 1) - 1) + settings.last_wait
        request.due_at = now + (whole if self._reliable else request.wait)
        self._pending[request.transaction] = request
        self._out.append(request.data)

    # Input

    def receive(self, data: bytes, now: float) -> None:
        """Take a STUN response; one that answers no request of this object is counted."""
        head = transaction_of(data)
        request = self._pending.get(head[1]) if head is not None else None
        if head is None or request is None or head[0] not in (Kind.SUCCESS, Kind.ERROR):
            self.counts["unknown_transaction"] += 1
            return
        try:
            attributes = read_attributes(data)
            error = parse_error_code(attributes.get(Attribute.ERROR_CODE))
        except StunError:
            self.counts["malformed"] += 1
            return
        if head[0] is Kind.SUCCESS and self._key is not None and not is_authentic(data, self._key):
            self.counts["unauthentic"] += 1
            return
        if head[0] is Kind.ERROR and error is None:
            self.counts["malformed"] += 1
            return
        del self._pending[request.transaction]
        if error is not None and self._try_again(request, error, attributes, now):
            return
        self._answers.append(Answer(request, error, attributes))

    def _try_again(self, request: Request, error: StunErrorCode, attributes: dict[int, bytes], now: float) -> bool:
        """Try again with the credentials that the server asks for, or with its new nonce (RFC 8489 9.2.5)."""
        realm, nonce = attributes.get(Attribute.REALM), attributes.get(Attribute.NONCE)
        if error.code not in (UNAUTHENTICATED, STALE_NONCE) or nonce is None or nonce == request.nonce:
            return False
        if self._username is None or self._password is None or request.method == BINDING:
            return False
        if error.code == UNAUTHENTICATED and (request.nonce is not None or realm is None):
            return False  # it does not accept the credentials
        self._nonce = nonce
        if realm is not None:
            self._realm = realm
            self._key = long_term_key(self._username, realm, self._password)
        self._send(request, now)
        return True

    # Output

    def data_to_send(self) -> list[bytes]:
        out, self._out = self._out, []
        return out

    def answers(self) -> list[Answer]:
        answers, self._answers = self._answers, []
        return answers

    def timer(self) -> float | None:
        return min((each.due_at for each in self._pending.values()), default=None)

    def handle_timer(self, now: float) -> None:
        for request in [each for each in self._pending.values() if now >= each.due_at]:
            if self._reliable or request.sent > self._settings.transmissions - 1:
                del self._pending[request.transaction]
                self._answers.append(Answer(request, TIMEOUT))
                continue
            request.sent += 1
            request.wait *= 2
            last = request.sent == self._settings.transmissions
            request.due_at = now + (self._settings.last_wait if last else request.wait)
            self._out.append(request.data)
