from aiortc.rtp import HeaderExtensions, HeaderExtensionsMap, RtpPacket, pack_header_extensions
from hypothesis import given
from hypothesis import strategies as st

from lockstep.client.media.rtp_header import find_extension, parse_rtp_header

elements = st.lists(st.tuples(st.integers(1, 14), st.binary(min_size=1, max_size=16)), max_size=5)


class PackedExtensions(HeaderExtensionsMap):
    """Hands aiortc's own packing through."""

    def __init__(self, packed: list[tuple[int, bytes]]) -> None:
        super().__init__()
        self._packed = packed

    def set(self, values: HeaderExtensions) -> tuple[int, bytes]:
        return pack_header_extensions(self._packed)


@given(elements, st.integers(0, 65535), st.integers(0, 2**32 - 1), st.booleans(), st.integers(0, 3))
def test_a_packet_that_aiortc_wrote_is_read(
    packed: list[tuple[int, bytes]], sequence: int, timestamp: int, marker: bool, sources: int
) -> None:
    packet = RtpPacket(
        payload_type=97, marker=int(marker), sequence_number=sequence, timestamp=timestamp, ssrc=5, payload=b"data"
    )
    packet.csrc = list(range(sources))
    header = parse_rtp_header(packet.serialize(PackedExtensions(packed)))
    assert header is not None
    assert header[:5] == (97, marker, sequence, timestamp, 5)
    first: dict[int, bytes] = {}
    for number, value in packed:
        first.setdefault(number, value)
    for number in range(1, 15):
        assert find_extension(header.profile, header.extension, number) == first.get(number)


def test_elements_in_the_two_byte_form_are_found() -> None:
    profile, extension = pack_header_extensions([(20, b"long"), (3, b"x" * 40)])
    assert profile == 0x1000
    assert find_extension(profile, extension, 20) == b"long"
    assert find_extension(profile, extension, 3) == b"x" * 40
    assert find_extension(profile, extension, 4) is None


@given(st.binary(max_size=100))
def test_no_bytes_raise(data: bytes) -> None:
    header = parse_rtp_header(data)
    if header is not None:
        find_extension(header.profile, header.extension, 4)
    for profile in (0xBEDE, 0x1000, 0x100F, 0, 77):
        value = find_extension(profile, data, 4)
        assert value is None or value in data
