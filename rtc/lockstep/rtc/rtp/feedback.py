"""RTCP feedback: NACK and PLI (RFC 4585), FIR (RFC 5104), REMB and transport-wide feedback (drafts of rmcat)."""

import struct
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from lockstep.rtc.rtp.errors import RtpError

__all__ = [
    "PAYLOAD_FEEDBACK",
    "TRANSPORT_FEEDBACK",
    "Feedback",
    "FullIntraRequest",
    "Nack",
    "PictureLoss",
    "Remb",
    "TransportFeedback",
    "parse_feedback",
]

TRANSPORT_FEEDBACK, PAYLOAD_FEEDBACK = 205, 206  # packet types
NACK, TWCC = 1, 15  # formats of the first
PLI, FIR, APPLICATION = 1, 4, 15  # formats of the second
REMB = b"REMB"
MAX_NACKED = 1024  # packets in one; no sender keeps more of them at a browser's rate
MAX_STATUSES = 8192  # packets of one transport-wide feedback: one second at 90 Mbit/s; ten come in a second
TICK = 0.000_25  # s, of an arrival's difference
REFERENCE = 0.064  # s, of the reference time
MAX_BITRATE = 1 << 53  # bit/s; an exponent of 63 stands for more than any path has


def _header(kind: int, form: int, sender: int, media: int, body: bytes = b"") -> bytes:
    return struct.pack("!BBHII", 0x80 | form, kind, 2 + len(body) // 4, sender, media) + body


@dataclass(frozen=True, slots=True)
class Nack:
    """A request for missing packets (RFC 4585 6.2.1)."""

    sender_ssrc: int
    media_ssrc: int
    lost: tuple[int, ...]  # sequence numbers

    def pack(self) -> bytes:
        body = b"".join(struct.pack("!HH", first, bits) for first, bits in _pairs(self.lost))
        return _header(TRANSPORT_FEEDBACK, NACK, self.sender_ssrc, self.media_ssrc, body)


def _pairs(lost: Iterable[int]) -> Iterator[tuple[int, int]]:
    """Yield a sequence number and the sixteen bits for those after it."""
    first, bits = -1, 0
    for number in lost:
        ahead = (number - first) & 0xFFFF
        if first >= 0 and 1 <= ahead <= 16:
            bits |= 1 << (ahead - 1)
        else:
            if first >= 0:
                yield first, bits
            first, bits = number, 0
    if first >= 0:
        yield first, bits


@dataclass(frozen=True, slots=True)
class PictureLoss:
    """The receiver cannot decode the picture (RFC 4585 6.3.1)."""

    sender_ssrc: int
    media_ssrc: int

    def pack(self) -> bytes:
        return _header(PAYLOAD_FEEDBACK, PLI, self.sender_ssrc, self.media_ssrc)


@dataclass(frozen=True, slots=True)
class FullIntraRequest:
    """A request for a keyframe (RFC 5104 4.3.1)."""

    sender_ssrc: int
    requests: tuple[tuple[int, int], ...]  # SSRC, and the request's number: one that repeats is the same request

    def pack(self) -> bytes:
        body = b"".join(struct.pack("!IB3x", ssrc, number) for ssrc, number in self.requests)
        return _header(PAYLOAD_FEEDBACK, FIR, self.sender_ssrc, 0, body)


@dataclass(frozen=True, slots=True)
class Remb:
    """The bitrate that the receiver believes the path to carry (draft-alvestrand-rmcat-remb 2.2)."""

    sender_ssrc: int
    bitrate: int  # bit/s, of all streams together
    ssrcs: tuple[int, ...]

    def pack(self) -> bytes:
        exponent = max(0, self.bitrate.bit_length() - 18)
        rate = bytes((exponent << 2 | self.bitrate >> exponent >> 16,))
        rate += struct.pack("!H", self.bitrate >> exponent & 0xFFFF)
        body = REMB + bytes((len(self.ssrcs),)) + rate + struct.pack(f"!{len(self.ssrcs)}I", *self.ssrcs)
        return _header(PAYLOAD_FEEDBACK, APPLICATION, self.sender_ssrc, 0, body)


@dataclass(frozen=True, slots=True)
class TransportFeedback:
    """The arrival times of packets, by transport-wide numbers (draft-holmer-rmcat-transport-wide-cc-extensions 3.1)."""

    sender_ssrc: int
    media_ssrc: int
    number: int  # of this feedback, 8 bits
    base: int  # the first packet's transport-wide number, 16 bits
    arrivals: tuple[float | None, ...]  # s of the receiver's clock, of packet `base` and those after it; None: not yet

    def pack(self) -> bytes:
        known = [each for each in self.arrivals if each is not None]
        reference = int(known[0] / REFERENCE) if known else 0
        symbols, deltas, ticks = [], b"", round(reference * REFERENCE / TICK)
        for each in self.arrivals:
            difference = 0 if each is None else round(each / TICK) - ticks
            ticks += difference
            symbols.append(0 if each is None else 1 if 0 <= difference <= 255 else 2)
            deltas += b"" if each is None else struct.pack("!B" if symbols[-1] == 1 else "!h", difference)
        body = struct.pack("!HH", self.base, len(symbols))
        body += (reference & 0xFFFFFF).to_bytes(3, "big") + bytes((self.number,))
        body += b"".join(_chunk(symbols[start : start + 7]) for start in range(0, len(symbols), 7)) + deltas
        body += bytes(-len(body) % 4)
        return _header(TRANSPORT_FEEDBACK, TWCC, self.sender_ssrc, self.media_ssrc, body)


def _chunk(symbols: list[int]) -> bytes:
    """Return a vector of seven two-bit symbols (3.1.4)."""
    bits = 0b11
    for symbol in [*symbols, *[0] * (7 - len(symbols))]:
        bits = bits << 2 | symbol
    return struct.pack("!H", bits)


Feedback = Nack | PictureLoss | FullIntraRequest | Remb | TransportFeedback


def parse_feedback(kind: int, form: int, body: bytes) -> Feedback | None:
    """Return the feedback; None for a format that is not read here. Raises RtpError, struct.error and IndexError."""
    sender, media = struct.unpack_from("!II", body)
    control = body[8:]
    if kind == TRANSPORT_FEEDBACK and form == NACK:
        return Nack(sender, media, tuple(_lost(control)))
    if kind == TRANSPORT_FEEDBACK and form == TWCC:
        return _transport_feedback(sender, media, control)
    if kind == PAYLOAD_FEEDBACK and form == PLI:
        return PictureLoss(sender, media)
    if kind == PAYLOAD_FEEDBACK and form == FIR:
        usable = control[: len(control) // 8 * 8]
        return FullIntraRequest(sender, tuple(struct.iter_unpack("!IB3x", usable)))
    if kind == PAYLOAD_FEEDBACK and form == APPLICATION and control[:4] == REMB:
        return _remb(sender, control)
    return None


def _lost(control: bytes) -> list[int]:
    lost: list[int] = []
    for first, bits in struct.iter_unpack("!HH", control):
        lost.append(first)
        lost += [(first + 1 + bit) & 0xFFFF for bit in range(16) if bits >> bit & 1]
        if len(lost) > MAX_NACKED:
            raise RtpError(f"a NACK of more than {MAX_NACKED} packets")
    return lost


def _remb(sender: int, control: bytes) -> Remb:
    count, first, rest = struct.unpack_from("!BBH", control, 4)
    bitrate = min((first & 0x03) << 16 | rest, MAX_BITRATE) << (first >> 2)
    return Remb(sender, min(bitrate, MAX_BITRATE), struct.unpack_from(f"!{count}I", control, 8))


def _transport_feedback(sender: int, media: int, control: bytes) -> TransportFeedback:
    base, count, word = struct.unpack_from("!HHI", control)
    if count > MAX_STATUSES:
        raise RtpError(f"feedback on more than {MAX_STATUSES} packets")
    symbols: list[int] = []
    position = 8
    while len(symbols) < count:
        (chunk,) = struct.unpack_from("!H", control, position)
        position += 2
        symbols += _symbols(chunk)
    reference = (word >> 8) - ((word >> 31) << 24)  # 24 bits, signed
    ticks = round(reference * REFERENCE / TICK)
    arrivals: list[float | None] = []
    for symbol in symbols[:count]:
        if symbol not in (1, 2):  # 3 is reserved: it has no difference
            arrivals.append(None)
            continue
        (difference,) = struct.unpack_from("!B" if symbol == 1 else "!h", control, position)
        position += symbol
        ticks += difference
        arrivals.append(ticks * TICK)
    return TransportFeedback(sender, media, word & 0xFF, base, tuple(arrivals))


def _symbols(chunk: int) -> list[int]:
    """Return the symbols of a run (3.1.3), or of a vector of one- or two-bit symbols (3.1.4)."""
    if not chunk & 0x8000:
        return [chunk >> 13 & 0b11] * (chunk & 0x1FFF)
    if not chunk & 0x4000:
        return [chunk >> bit & 1 for bit in range(13, -1, -1)]
    return [chunk >> bit & 0b11 for bit in range(12, -1, -2)]
