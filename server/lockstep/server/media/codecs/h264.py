"""Inspects an H.264 byte stream without decoding it (ITU-T H.264, Annex B). Pure functions."""

from typing import NamedTuple

from lockstep.server.media.codecs.packetise import split_nal_units

__all__ = ["START_CODE", "H264Access", "Profile", "accepts", "holds_slice", "inspect", "profile_of_fmtp"]

START_CODE = b"\x00\x00\x00\x01"
NAL_SLICE, NAL_IDR, NAL_SPS, NAL_PPS = 1, 5, 7, 8
BASELINE, MAIN, HIGH = 66, 77, 100
SLICES = range(1, 6)  # NAL types of a picture's parts, table 7-1
SLICE_B = (1, 6)  # table 7-6
HEAD = 16  # bytes of a slice that hold the two numbers we need


class Profile(NamedTuple):
    """A profile, as in a sequence parameter set and in profile-level-id (RFC 6184 8.1)."""

    idc: int
    constraints: int  # the byte of constraint_set flags
    level: int

    @property
    def constrained(self) -> bool:
        """True for constrained baseline, which every decoder takes (constraint_set1)."""
        return self.idc == BASELINE and bool(self.constraints & 0x40)

    def __str__(self) -> str:
        return f"{self.idc:02x}{self.constraints:02x}{self.level:02x}"


class H264Access(NamedTuple):
    """The relevant properties of one access unit."""

    keyframe: bool  # holds an IDR picture
    profile: Profile | None  # of its sequence parameter set; None without one
    parameter_sets: bytes  # its SPS and PPS with start codes; b"" without
    reordered: bool  # holds a B slice: it may be shown at another time than it is sent


def inspect(stream: bytes) -> H264Access:
    """Look at an access unit in Annex B form."""
    keyframe, reordered, profile, sets = False, False, None, b""
    for nal in split_nal_units(stream):
        kind = nal[0] & 0x1F
        if kind == NAL_IDR:
            keyframe = True
        elif kind == NAL_SLICE:
            reordered = reordered or _slice_type(nal) in SLICE_B
        elif kind in (NAL_SPS, NAL_PPS):
            sets += START_CODE + nal
            if kind == NAL_SPS and len(nal) >= 4:
                profile = Profile(nal[1], nal[2], nal[3])
    return H264Access(keyframe, profile, sets, reordered)


def holds_slice(stream: bytes) -> bool:
    """Return whether this is a picture or a part of one: some cameras send parameter sets or messages by themselves."""
    at = stream.find(START_CODE[1:])
    while 0 <= at < len(stream) - 3:
        if stream[at + 3] & 0x1F in SLICES:
            return True
        at = stream.find(START_CODE[1:], at + 3)
    return False


def accepts(negotiated: Profile, stream: Profile) -> bool:
    """True if a peer that negotiated one profile can decode a stream of another: each holds those before it.

    The level does not decide: browsers name 3.1 whatever they can do, and the console's own encoding at the same size
    has the same level.
    """
    if stream.constrained:
        return negotiated.idc in (BASELINE, MAIN, HIGH)
    if stream.idc == BASELINE:  # with slice orders that Main does not have
        return negotiated.idc == BASELINE and not negotiated.constrained
    return (stream.idc, negotiated.idc) in ((MAIN, MAIN), (MAIN, HIGH), (HIGH, HIGH))


def profile_of_fmtp(text: str) -> Profile:
    """Parse a profile-level-id; an invalid one counts as the default, constrained baseline 3.1 (RFC 6184 8.1)."""
    try:
        value = bytes.fromhex(text)
    except ValueError:
        value = b""
    return Profile(*value) if len(value) == 3 else Profile(BASELINE, 0xE0, 31)


def _slice_type(nal: bytes) -> int:
    """Return slice_type; it follows first_mb_in_slice, both in Exp-Golomb code (7.3.3)."""
    head = nal[1:HEAD].replace(b"\x00\x00\x03", b"\x00\x00")
    bits = "".join(f"{byte:08b}" for byte in head)
    _, at = _exp_golomb(bits, 0)
    return _exp_golomb(bits, at)[0]


def _exp_golomb(bits: str, at: int) -> tuple[int, int]:
    """Return the number at `at`, -1 when it is cut off, and the position of the next (9.1)."""
    one = bits.find("1", at)
    if one == -1 or 2 * one - at + 1 > len(bits):
        return -1, len(bits)
    end = 2 * one - at + 1
    return int(bits[one:end], 2) - 1, end
