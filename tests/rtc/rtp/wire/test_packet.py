import struct

import pytest
from aiortc.rtcrtpparameters import RTCRtpHeaderExtensionParameters, RTCRtpReceiveParameters
from aiortc.rtp import HeaderExtensions, HeaderExtensionsMap
from aiortc.rtp import RtpPacket as AiortcPacket
from hypothesis import given
from hypothesis import strategies as st

from lockstep.rtc.rtp.errors import RtpError
from lockstep.rtc.rtp.wire.packet import RtpPacket, pack_extensions, parse_extensions

values = st.dictionaries(st.integers(1, 255), st.binary(max_size=255), max_size=5)
packets = st.builds(
    RtpPacket,
    payload_type=st.integers(0, 127),
    sequence_number=st.integers(0, 0xFFFF),
    timestamp=st.integers(0, 0xFFFFFFFF),
    ssrc=st.integers(0, 0xFFFFFFFF),
    payload=st.binary(max_size=100),
    marker=st.booleans(),
    csrcs=st.lists(st.integers(0, 0xFFFFFFFF), max_size=15).map(tuple),
    extensions=values.map(lambda found: {key: value for key, value in found.items() if key != 15 or len(value) > 16}),
)


@given(packets)
def test_a_packet_is_what_it_was_after_packing(packet: RtpPacket) -> None:
    assert RtpPacket.parse(packet.pack()) == packet


@given(st.binary(max_size=100))
def test_no_bytes_raise_anything_else(data: bytes) -> None:
    for each in (data, b"\x90" + data, b"\xbf" + data):
        try:
            RtpPacket.parse(each).pack()
        except RtpError:
            continue


@pytest.mark.parametrize(
    "data",
    [
        b"",
        bytes(12),
        b"\x80" + bytes(10),
        b"\x81" + bytes(11),
        b"\x90" + bytes(11),
        b"\x90" + bytes(11) + b"\xbe\xde\x00\x01",
        b"\x90" + bytes(11) + b"\xbe\xde\x00\x01\x1f\x00\x00\x00",
        b"\x90" + bytes(11) + b"\x10\x00\x00\x01\x00\x00\x00\x01",
        b"\x90" + bytes(11) + b"\x10\x00\x00\x01\x01\x05\x00\x01",
        b"\xa0" + bytes(12),
        b"\xa0" + bytes(11) + b"\x02",
    ],
)
def test_what_is_cut_short_is_refused(data: bytes) -> None:
    with pytest.raises(RtpError):
        RtpPacket.parse(data)


def test_padding_is_taken_off() -> None:
    data = b"\xa0" + bytes(11) + b"payload" + b"\x00\x00\x03"
    assert RtpPacket.parse(data).payload == b"payload"


def test_one_id_over_14_or_a_long_or_empty_value_needs_the_two_byte_form() -> None:
    for elements, profile in (
        ({1: b"x", 14: b"y" * 16}, 0xBEDE),
        ({15: b"x"}, 0x1000),
        ({1: b""}, 0x1000),
        ({1: b"y" * 17}, 0x1000),
    ):
        block = pack_extensions(elements)
        assert struct.unpack_from("!H", block)[0] == profile
        assert parse_extensions(profile, block[4:]) == elements
    assert pack_extensions({1: b"x"}, two_byte=True)[:2] == b"\x10\x00"


@pytest.mark.parametrize("elements", [{0: b"x"}, {256: b"x"}, {4096: b"x"}, {1: bytes(256)}])
def test_what_no_packet_can_carry_is_an_error_of_the_caller(elements: dict[int, bytes]) -> None:
    with pytest.raises(ValueError, match="1 to 255"):
        pack_extensions(elements)


def test_an_element_15_ends_the_one_byte_form_and_other_profiles_are_left_alone() -> None:
    assert parse_extensions(0xBEDE, b"\x10a\xf0b\x20c\x00\x00") == {1: b"a"}
    assert parse_extensions(0x1234, b"\xff\xff\xff\xff") == {}
    assert parse_extensions(0x100F, b"\x10\x01a\x00") == {16: b"a"}


def test_aiortc_reads_what_we_write() -> None:
    known = HeaderExtensionsMap()
    uri = "urn:ietf:params:rtp-hdrext:sdes:mid"
    known.configure(RTCRtpReceiveParameters(headerExtensions=[RTCRtpHeaderExtensionParameters(id=3, uri=uri)]))
    ours = RtpPacket(96, 65535, 2**32 - 1, 1234, b"payload", True, (5, 6), {3: b"camera"})
    theirs = AiortcPacket.parse(ours.pack(), known)
    assert (theirs.payload_type, theirs.marker, theirs.csrc) == (96, 1, [5, 6])
    assert theirs.extensions == HeaderExtensions(mid="camera")
    assert RtpPacket.parse(theirs.serialize(known)) == ours
