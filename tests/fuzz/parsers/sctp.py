"""What an SCTP association and its data channels must withstand, as one function of bytes.

The first byte chooses the state that the end is in. The rest is packets: two bytes of length, of which the highest bit
lets time pass first, and chunks, which get a valid header in front. `Victim` asserts the bounds after each.
"""

import contextlib

from lockstep.rtc.dcep import DcepError, decode_open
from lockstep.rtc.sctp.errors import SctpParseError
from lockstep.rtc.sctp.wire.packet import decode_packet
from tests.rtc.sctp.hostile import Victim

__all__ = ["SCENES", "pack", "try_input"]

MOST_PACKETS = 64
SECONDS = 0.3


def pack(packets: list[bytes]) -> bytes:
    """The input that makes these packets."""
    return b"".join(len(chunks).to_bytes(2, "big") + chunks for chunks in packets)


def say_all(victim: Victim, data: bytes) -> None:
    for _ in range(MOST_PACKETS):
        if len(data) < 2:
            break
        length = int.from_bytes(data[:2], "big")
        if length & 0x8000:
            victim.wait(SECONDS)
        length &= 0x7FFF
        victim.say_raw(data[2 : 2 + length])
        data = data[2 + length :]
    victim.wait(SECONDS)
    victim.wait(60.0)


def before_the_handshake(data: bytes) -> None:
    say_all(Victim(established=False), data)


def established(data: bytes) -> None:
    say_all(Victim(), data)


def interleaving(data: bytes) -> None:
    say_all(Victim(interleaving=True), data)


def parsers(data: bytes) -> None:
    with contextlib.suppress(SctpParseError):
        decode_packet(data)
    with contextlib.suppress(DcepError):
        decode_open(data)


SCENES = (established, interleaving, before_the_handshake, parsers)


def try_input(data: bytes) -> None:
    """Raises whatever goes wrong."""
    code = data[0] if data else 0
    SCENES[code % len(SCENES)](data[1:])
