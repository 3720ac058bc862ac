"""The answers to a peer's checks, without a session."""

from collections import Counter
from random import Random

from lockstep.rtc.addresses import Path
from lockstep.rtc.ice.credentials import Credentials, new_credentials
from lockstep.rtc.ice.role import Role
from lockstep.rtc.ice.session.peer_checks import PeerChecks
from lockstep.rtc.ice.settings import IceSettings
from lockstep.rtc.stun import Kind, Message, parse, serialize

OURS = new_credentials(Random(1).randbytes)
PATH = Path(("192.0.2.1", 5000), ("198.51.100.7", 5000))
SETTINGS = IceSettings(check_burst=3, remembered_checks=2)


def peer_checks(counts: Counter[str] | None = None) -> PeerChecks:
    return PeerChecks(OURS, Role(controlling=True, tie_breaker=5), SETTINGS, Counter() if counts is None else counts)


def check(transaction: int, credentials: Credentials = OURS, tie_breaker: int | None = None) -> bytes:
    request = Message(Kind.REQUEST, transaction.to_bytes(12), priority=1, controlling=tie_breaker)
    return serialize(request, credentials.password)


def test_a_check_is_answered_with_the_address_of_its_sender() -> None:
    checks = peer_checks()
    assert checks.receive(check(1), PATH, 0.0) is not None
    [answer] = checks.out
    assert (answer.path, parse(answer.data).mapped) == (PATH, PATH.remote)


def test_a_check_of_a_stranger_is_counted_and_not_answered() -> None:
    counts: Counter[str] = Counter()
    checks = peer_checks(counts)
    assert checks.receive(check(1, new_credentials(Random(2).randbytes)), PATH, 0.0) is None
    assert checks.receive(b"\0\1", PATH, 0.0) is None
    assert counts == {"unauthentic": 1, "malformed": 1}
    assert checks.out == []


def test_a_peer_with_the_lesser_claim_to_the_same_role_is_told_to_change() -> None:
    checks = peer_checks()
    assert checks.receive(check(1, tie_breaker=4), PATH, 0.0) is None
    error = parse(checks.out[0].data).error
    assert error is not None
    assert error.code == 487
    assert checks.receive(check(2, tie_breaker=6), PATH, 0.0) is not None


def test_known_checks_do_not_use_up_the_rate_of_new_ones() -> None:
    counts: Counter[str] = Counter()
    checks = peer_checks(counts)
    known = checks.receive(check(1), PATH, 0.0)
    assert known is not None
    checks.remember(known)
    for _ in range(10):
        checks.receive(check(1), PATH, 0.0)
    assert counts["checks_over_rate"] == 7
    assert checks.receive(check(2), PATH, 0.0) is not None


def test_the_oldest_check_is_forgotten_first() -> None:
    checks = peer_checks()
    seen = [parse(check(number)) for number in range(3)]
    for request in seen:
        checks.remember(request)
    assert [checks.is_new(request) for request in seen] == [True, False, False]
