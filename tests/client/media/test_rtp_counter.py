from lockstep.client.media.rtp_counter import RtpCounter
from lockstep.client.media.rtp_header import RtpHeader
from lockstep.protocol.carriers import pack_event_reference, unpack_event_reference


def packet(sequence: int, timestamp: int, event: int | None = None) -> RtpHeader:
    extension = b"" if event is None else b"\x43" + pack_event_reference(event)
    return RtpHeader(97, False, sequence % 65536, timestamp, 1, 0xBEDE if extension else 0, extension)


def counted(*packets: RtpHeader, extension_id: int | None = 4) -> RtpCounter:
    counter = RtpCounter(extension_id, unpack_event_reference)
    for each in packets:
        counter.take(each)
    return counter


def test_packets_of_one_timestamp_are_one_frame() -> None:
    counter = counted(packet(65535, 1, 7), packet(0, 1, 7), packet(1, 2, 8))
    assert (counter.packets, counter.frames, counter.lost, counter.stamp) == (3, 2, 0, 8)


def test_a_gap_is_lost_until_the_packet_comes_after_all() -> None:
    assert counted(packet(1, 1, 7), packet(4, 2, 7)).lost == 2
    assert counted(packet(1, 1, 7), packet(4, 2, 7), packet(3, 1, 7)).lost == 1


def test_a_frame_without_a_reference_is_counted() -> None:
    counter = counted(packet(1, 1), packet(2, 2, 9), packet(3, 3))
    assert (counter.unstamped, counter.stamp) == (2, 9)


def test_without_an_extension_no_reference_is_expected() -> None:
    counter = counted(packet(1, 1), extension_id=None)
    assert (counter.frames, counter.unstamped) == (1, 0)
