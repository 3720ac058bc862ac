"""Times and bounds of an ICE agent, each with its reason."""

from dataclasses import dataclass

__all__ = ["IceSettings"]


@dataclass(frozen=True, slots=True)
class IceSettings:
    """Times are seconds, unless a field says otherwise."""

    check_interval: float = 0.02  # Ta, between two new checks (RFC 8445 14.2: at least 5 ms)
    rto: float = 0.5  # the first wait for an answer, at least (RFC 8445 14.3)
    transmissions: int = 7  # of one check (Rc, RFC 8489 6.2.1): the last leaves 31.5 s after the first
    last_wait: int = 16  # times `rto`, after the last transmission (Rm, RFC 8489 6.2.1)
    connect_seconds: float = 40.0  # from the peer's credentials to the first path: all transmissions of a check, 39.5 s
    nomination_wait: float = 0.1  # at least, for a better pair than the first that works
    rival_wait: float = 1.0  # at least, for an answer on the path in use before a worse, nominated path replaces it
    consent_seconds: float = 30.0  # after the last valid answer or check (RFC 7675 5.1)
    consent_interval: tuple[float, float] = (4.0, 6.0)  # between two checks, drawn evenly (RFC 7675 5.1)
    retired_seconds: float = 30.0  # time to listen on the path before a restart: datagrams are under way there
    max_pairs: int = 100  # RFC 8445 6.1.2.5
    max_local_candidates: int = 32
    max_remote_candidates: int = 32  # candidates from signalling; a browser with many interfaces has about twenty
    max_peer_reflexive: int = 16  # candidates from checks: each costs checks to an address that a peer chose
    max_checks_per_second: float = 50.0  # checks that are answered; libwebrtc begins with about twenty a second
    check_burst: float = 100.0  # checks
    remembered_checks: int = 256  # transactions, so that a recorded check that comes again counts for nothing
