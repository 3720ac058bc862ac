"""Codecs in session descriptions: their lines, and the codecs that two ends share."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from lockstep.rtc.sdp.description import Codec
from lockstep.rtc.sdp.errors import SdpError

__all__ = ["common_codecs", "is_same_format", "read_codecs"]

RTPMAP = re.compile(r"([!-.0-~]{1,64})/([0-9]{1,7})(?:/([0-9]{1,3}))?")
STATIC = {0: ("PCMU", 8000), 8: ("PCMA", 8000), 9: ("G722", 8000)}  # RFC 3551 6
MAX_PAYLOAD_TYPE = 127  # RFC 3550 5.1: seven bits
LIKE_RTCP = range(64, 96)  # RFC 5761 4: packets with these are taken for RTCP
AUXILIARY = {"rtx", "red", "ulpfec", "flexfec-03", "telephone-event", "cn"}  # carry nothing without another codec
# The parameters that make two codecs of one name different things, with the values that are meant by default.
FORMAT: Mapping[str, Mapping[str, str]] = {
    "h264": {"packetization-mode": "0"},  # RFC 6184 8.1; the profile is compared by its meaning
    "vp9": {"profile-id": "0"},  # RFC 9628 6
    "av1": {"profile": "0"},  # AV1's RTP payload format 7.2.1
    "h265": {"profile-id": "1"},  # RFC 7798 7.1
}
H264_BASELINE, H264_MAIN, H264_EXTENDED = 0x42, 0x4D, 0x58


def read_codecs(
    formats: Sequence[str], attributes: Iterable[tuple[str, str]], kind: str, section: str
) -> tuple[Codec, ...]:
    """Return the codecs of an m= line, in its order, that a packet can carry and that have a name. Raises SdpError."""
    of_type: dict[str, dict[int, list[str]]] = {"rtpmap": {}, "fmtp": {}, "rtcp-fb": {}}
    for_all: list[str] = []  # RFC 4585 4.2: feedback of every payload type
    for name, value in attributes:
        number, _, rest = value.partition(" ")
        if name == "rtcp-fb" and number == "*":
            for_all.append(rest.strip())
        elif name in of_type and number.isascii() and number.isdecimal() and len(number) <= 3:
            of_type[name].setdefault(int(number), []).append(rest.strip())
    codecs = []
    for payload_type in dict.fromkeys(_payload_type(each, section) for each in formats):
        names = of_type["rtpmap"].get(payload_type)
        named = _named(payload_type, names[0] if names else None, kind, section)
        if named is None or payload_type in LIKE_RTCP:
            continue
        feedback = dict.fromkeys([*of_type["rtcp-fb"].get(payload_type, ()), *for_all])
        parameters = _parameters(of_type["fmtp"].get(payload_type, ()))
        codecs.append(replace(named, parameters=parameters, feedback=tuple(feedback)))
    return tuple(codecs)


def _payload_type(text: str, section: str) -> int:
    if not (text.isascii() and text.isdecimal()) or len(text) > 9 or int(text) > MAX_PAYLOAD_TYPE:
        raise SdpError(f"payload type {text[:9]}: 0 to {MAX_PAYLOAD_TYPE} fit a packet (RFC 3550 5.1)", section)
    return int(text)


def _named(payload_type: int, mapping: str | None, kind: str, section: str) -> Codec | None:
    if mapping is None:
        name, clock_rate = STATIC.get(payload_type, ("", 0)) if kind == "audio" else ("", 0)
        return Codec(payload_type, name, clock_rate) if name else None
    match = RTPMAP.fullmatch(mapping)
    if match is None or int(match[2]) == 0:
        raise SdpError(f"a=rtpmap:{payload_type} is not a name and a clock rate (RFC 8866 6.6)", section)
    return Codec(payload_type, match[1], int(match[2]), int(match[3] or 1))


def _parameters(lines: Iterable[str]) -> dict[str, str]:
    parts = [part.strip().partition("=") for line in lines for part in line.split(";")]
    return {name.strip(): value.strip() for name, _, value in parts if name.strip()}


def common_codecs(offered: Sequence[Codec], known: Sequence[Codec]) -> tuple[Codec, ...]:
    """Return those of `offered` that `known` has too, the first of `known` first; with the codecs that repair them.

    They have the offer's payload types and format, and the parameters and feedback of both (RFC 3264 6.1, 8.3.2).
    """
    chosen: list[Codec] = []
    for own in known:
        if own.name.lower() == "rtx":
            continue
        same = (each for each in offered if is_same_format(each, own) and each not in chosen)
        chosen += [_agreed(each, own) for each in same if all(x.payload_type != each.payload_type for x in chosen)]
    if all(codec.name.lower() in AUXILIARY for codec in chosen):
        return ()
    if any(own.name.lower() == "rtx" for own in known):
        numbers = {codec.payload_type for codec in chosen}
        chosen += [replace(each, feedback=()) for each in offered if each.repairs in numbers]
    return tuple(chosen)


def _agreed(offered: Codec, own: Codec) -> Codec:
    kept = {*FORMAT.get(offered.name.lower(), ()), "profile-level-id", "level-asymmetry-allowed"}
    format_of = {name: value for name, value in offered.parameters.items() if name in kept}
    feedback = tuple(each for each in offered.feedback if each in own.feedback)
    return replace(offered, parameters={**own.parameters, **format_of}, feedback=feedback)


def is_same_format(one: Codec, other: Codec) -> bool:
    """True if a stream of one is a stream of the other."""
    name = one.name.lower()
    if (name, one.clock_rate, one.channels) != (other.name.lower(), other.clock_rate, other.channels):
        return False
    if name == "rtx":
        return True
    for parameter, default in FORMAT.get(name, {}).items():
        if one.parameters.get(parameter, default) != other.parameters.get(parameter, default):
            return False
    return name != "h264" or _h264_profile(one) == _h264_profile(other)


def _h264_profile(codec: Codec) -> tuple[int, bool] | None:
    """Return the profile, and True if it is constrained (RFC 6184 8.1, table 5); None for an invalid one, which equals
    no known one."""
    text = codec.parameters.get("profile-level-id", "42000a")  # RFC 6184 8.1: the default
    if not re.fullmatch(r"[0-9A-Fa-f]{6}", text):
        return None
    number = int(text, 16)
    profile, flags = number >> 16, number >> 8 & 0xFF
    of_baseline, of_main = flags & 0x80, flags & 0x40
    if (
        (profile == H264_BASELINE and of_main)
        or (profile == H264_MAIN and of_baseline)
        or (profile == H264_EXTENDED and of_baseline and of_main)
    ):
        return H264_BASELINE, True
    if profile == H264_EXTENDED and of_baseline:
        return H264_BASELINE, False
    if profile == 0x64 and flags & 0x0C == 0x0C:
        return 0x64, True  # constrained high
    return profile, False
