"""The checks of the peer, and the answers of this side (RFC 8445 7.3, RFC 8489 6.3.1)."""

from collections import Counter

from lockstep.rtc.addresses import Datagram, Path
from lockstep.rtc.ice.credentials import Credentials
from lockstep.rtc.ice.role import Role
from lockstep.rtc.ice.settings import IceSettings
from lockstep.rtc.stun import BINDING, Kind, Message, StunError, StunErrorCode, is_authentic, parse, serialize
from lockstep.rtc.token_bucket import TokenBucket

__all__ = ["ROLE_CONFLICT", "PeerChecks", "authentic"]

ROLE_CONFLICT = 487


class PeerChecks:
    """Answers checks at a bounded rate, and knows those that come again. `out` has the answers; drained."""

    def __init__(self, credentials: Credentials, role: Role, settings: IceSettings, counts: Counter[str]) -> None:
        self.out: list[Datagram] = []
        self._credentials = credentials
        self._role = role
        self._remembered = settings.remembered_checks
        self._counts = counts
        self._seen: dict[bytes, None] = {}  # transactions, the newest last
        self._rate = TokenBucket(settings.max_checks_per_second, settings.check_burst)
        self._rate_again = TokenBucket(settings.max_checks_per_second, settings.check_burst)  # for known checks

    def receive(self, data: bytes, path: Path, now: float) -> Message | None:
        """Answer a check. Return it if it counts: it is authentic, and was answered with success."""
        request = authentic(data, self._credentials.password, self._counts)
        if request is None:
            return None
        # Recorded checks that an attacker sends again and again do not use up the peer's rate.
        if not (self._rate if self.is_new(request) else self._rate_again).take(now):
            self._counts["checks_over_rate"] += 1
        elif request.not_understood:  # RFC 8489 6.3.1
            self._refuse(request, path, StunErrorCode(420, "Unknown Attribute"), request.not_understood)
        elif request.method != BINDING or request.priority is None:
            self._refuse(request, path, StunErrorCode(400, "Bad Request"))
        elif self._role.conflicts(request) and self._role.keeps_against(request):
            self._refuse(request, path, StunErrorCode(ROLE_CONFLICT, "Role Conflict"))
        else:
            success = Message(Kind.SUCCESS, request.transaction, mapped=path.remote)
            self.out.append(Datagram(serialize(success, self._credentials.password), path))
            return request
        return None

    def _refuse(self, request: Message, path: Path, error: StunErrorCode, unknown: tuple[int, ...] = ()) -> None:
        self._counts[f"answered_{error.code}"] += 1
        answer = Message(Kind.ERROR, request.transaction, request.method, error=error, unknown_attributes=unknown)
        self.out.append(Datagram(serialize(answer, self._credentials.password), path))

    def is_new(self, request: Message) -> bool:
        """False if it was remembered: it is a repetition of the peer, or an attacker has recorded it."""
        return request.transaction not in self._seen

    def remember(self, request: Message) -> None:
        self._seen[request.transaction] = None
        if len(self._seen) > self._remembered:
            del self._seen[next(iter(self._seen))]


def authentic(data: bytes, password: str, counts: Counter[str]) -> Message | None:
    """Return a message of the peer; None for any other, which is counted."""
    try:
        message = parse(data)
    except StunError:
        counts["malformed"] += 1
        return None
    if not is_authentic(data, password):
        # RFC 8489 9.1.3 answers 400 or 401. Silence gives a stranger nothing, and nothing to aim at others.
        counts["unauthentic"] += 1
        return None
    return message
