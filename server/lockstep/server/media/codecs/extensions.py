"""Chooses the RTP header extensions of an offer (RFC 8285) that the console accepts for its streams."""

from collections.abc import Collection

from lockstep.protocol.carriers import CAPTURE_TIME_URI, EVENT_REFERENCE_URI, PLAYOUT_DELAY_URI, Carrier
from lockstep.rtc.rtp.wire.extensions import ABS_SEND_TIME_URI
from lockstep.rtc.sdp import MID_URI

__all__ = ["choose_carrier", "wanted_uris"]


def choose_carrier(offered: Collection[str], trailer: bool) -> Carrier:
    """Choose the carrier of the stamp for a peer that offers the extensions `offered` (URIs)."""
    if trailer:
        return "trailer"
    if EVENT_REFERENCE_URI in offered:
        return "native"
    if CAPTURE_TIME_URI in offered:
        return "capture-time"
    return "none"


def wanted_uris(kind: str, carrier: Carrier) -> tuple[str, ...]:
    """Return the extensions that are accepted if offered; all others are declined."""
    uris = [MID_URI]
    if kind == "video":
        uris += [PLAYOUT_DELAY_URI, ABS_SEND_TIME_URI]
    if carrier == "native":
        uris.append(EVENT_REFERENCE_URI)
    elif carrier == "capture-time":
        uris.append(CAPTURE_TIME_URI)
    return tuple(uris)
