"""Times and bounds towards STUN and TURN servers, each with its reason."""

from dataclasses import dataclass

__all__ = ["TurnSettings"]


@dataclass(frozen=True, slots=True)
class TurnSettings:
    """Times are seconds, unless a field says otherwise."""

    rto: float = 0.5  # the first wait for an answer (RFC 8489 6.2.1); each further one is twice as long
    transmissions: int = 7  # of one request on UDP (Rc)
    last_wait: float = 8.0  # after the last transmission (Rm times `rto`), and on a stream after the only one: 39.5 s
    lifetime: int = 600  # of the allocation, as this side asks for it; servers give less where they like
    refresh_share: float = 0.5  # part of its lifetime after which an allocation is refreshed; the rest is for repeats
    refresh_again: float = 5.0  # after an unanswered refresh, as while a network is cut
    rebind_interval: float = 240.0  # a permission ends after 300 s (RFC 8656 9), a channel after 600 s (12)
    refused_seconds: float = 30.0  # time in which nothing is asked for a peer that the server has refused
    max_peers: int = 64  # peers that have a channel: an agent has fewer remote candidates
    max_waiting: int = 8  # datagrams to one peer that wait for its channel; a check or the first flight of a handshake
