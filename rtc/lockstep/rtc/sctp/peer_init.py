"""The content of INIT and INIT ACK, and the cookie that carries it (RFC 9260 5.1)."""

import hmac
from collections.abc import Iterable
from dataclasses import dataclass
from struct import Struct

from lockstep.rtc.sctp.errors import ProtocolViolation
from lockstep.rtc.sctp.settings import SctpSettings
from lockstep.rtc.sctp.wire.chunks import ForwardTsn, Init, InterleavedData, InterleavedForwardTsn, Reconfig
from lockstep.rtc.sctp.wire.parameters import (
    FORWARD_TSN_SUPPORTED,
    STATE_COOKIE,
    SUPPORTED_EXTENSIONS,
    UNRECOGNIZED_PARAMETER,
    Parameter,
    encode_parameters,
)

__all__ = ["Cookies", "PeerInit", "own_parameters", "read_init", "unrecognized"]

SMALLEST_WINDOW = 1500  # RFC 9260 3.3.2

_fields = Struct("!dLLLHH???")
_MAC = 16  # bytes


@dataclass(frozen=True, slots=True)
class PeerInit:
    """The content of the peer's INIT or INIT ACK."""

    tag: int
    window: int
    initial_tsn: int
    outbound_streams: int
    inbound_streams: int
    partial_reliability: bool  # RFC 3758
    reconfiguration: bool  # RFC 6525
    interleaving: bool  # RFC 8260


def own_parameters(settings: SctpSettings) -> list[Parameter]:
    """Return the parameters that name the abilities of this end."""
    extensions = [Reconfig.kind, ForwardTsn.kind]
    if settings.interleaving:
        extensions += [InterleavedData.kind, InterleavedForwardTsn.kind]
    return [(FORWARD_TSN_SUPPORTED, b""), (SUPPORTED_EXTENSIONS, bytes(extensions))]


def read_init(init: Init) -> PeerInit:
    """Return the content of an INIT or INIT ACK.

    Raises:
        ProtocolViolation: a value that RFC 9260 3.3.2 forbids.
    """
    if not init.initiate_tag or not init.outbound_streams or not init.inbound_streams:
        raise ProtocolViolation("init_invalid")
    if init.window < SMALLEST_WINDOW:
        raise ProtocolViolation("init_invalid")
    kinds = {kind for kind, _ in init.parameters}
    extensions = set(b"".join(value for kind, value in init.parameters if kind == SUPPORTED_EXTENSIONS))
    partial = FORWARD_TSN_SUPPORTED in kinds or ForwardTsn.kind in extensions
    return PeerInit(
        tag=init.initiate_tag,
        window=init.window,
        initial_tsn=init.initial_tsn,
        outbound_streams=init.outbound_streams,
        inbound_streams=init.inbound_streams,
        partial_reliability=partial,
        reconfiguration=Reconfig.kind in extensions,
        # RFC 8260 2.3.1: with partial reliability, both or none
        interleaving=InterleavedData.kind in extensions and (not partial or InterleavedForwardTsn.kind in extensions),
    )


def unrecognized(parameters: Iterable[Parameter]) -> list[Parameter]:
    """Return the parameters to report, by the two highest bits of their type (RFC 9260 3.2.1)."""
    found: list[Parameter] = []
    for kind, value in parameters:
        if kind in (STATE_COOKIE, UNRECOGNIZED_PARAMETER, FORWARD_TSN_SUPPORTED, SUPPORTED_EXTENSIONS):
            continue
        if kind & 0x4000:
            found.append((UNRECOGNIZED_PARAMETER, encode_parameters([(kind, value)])))
        if not kind & 0x8000:
            break
    return found


class Cookies:
    """Makes and opens cookies, which hold the state of a new peer, so that this side keeps none for it (5.1.3).

    Cookies have a MAC and end after a time. Behind DTLS no attacker can forge or spoof packets; the remaining case is a
    peer that answers late, or twice.
    """

    def __init__(self, key: bytes, lifetime: float) -> None:
        self._key = key
        self._lifetime = lifetime

    def seal(self, peer: PeerInit, now: float) -> bytes:
        body = _fields.pack(
            now,
            peer.tag,
            peer.window,
            peer.initial_tsn,
            peer.outbound_streams,
            peer.inbound_streams,
            peer.partial_reliability,
            peer.reconfiguration,
            peer.interleaving,
        )
        return body + self._mac(body)

    def open(self, cookie: bytes) -> tuple[PeerInit, float] | None:
        """Return the peer and the time at which the cookie was made. None: this side did not make it."""
        body, mac = cookie[: _fields.size], cookie[_fields.size :]
        if len(body) < _fields.size or not hmac.compare_digest(mac, self._mac(body)):
            return None
        made, *peer = _fields.unpack(body)
        return PeerInit(*peer), made

    def is_stale(self, made: float, now: float) -> bool:
        return now - made > self._lifetime

    def _mac(self, body: bytes) -> bytes:
        return hmac.digest(self._key, body, "sha256")[:_MAC]
