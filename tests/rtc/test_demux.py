import pytest

from lockstep.rtc.demux import DatagramKind, datagram_kind


@pytest.mark.parametrize(
    ("firsts", "kind"),
    [
        (range(4), DatagramKind.STUN),
        (range(4, 20), DatagramKind.UNKNOWN),
        (range(20, 64), DatagramKind.DTLS),
        (range(64, 128), DatagramKind.UNKNOWN),
        (range(128, 192), DatagramKind.RTP),
        (range(192, 256), DatagramKind.UNKNOWN),
    ],
)
def test_the_first_byte_tells_the_protocol(firsts: range, kind: DatagramKind) -> None:
    assert {datagram_kind(bytes((first, 96)) + bytes(10)) for first in firsts} == {kind}


@pytest.mark.parametrize(
    ("second", "kind"),
    [
        (96, DatagramKind.RTP),
        (128 | 127, DatagramKind.RTP),  # with the marker
        (191, DatagramKind.RTP),
        (192, DatagramKind.RTCP),
        (200, DatagramKind.RTCP),
        (223, DatagramKind.RTCP),
        (224, DatagramKind.RTP),
    ],
)
def test_the_second_byte_tells_rtcp_from_rtp(second: int, kind: DatagramKind) -> None:
    assert datagram_kind(bytes((0x80, second))) is kind


def test_nothing_and_one_byte_are_told_as_well() -> None:
    assert datagram_kind(b"") is DatagramKind.UNKNOWN
    assert datagram_kind(b"\x80") is DatagramKind.RTP
