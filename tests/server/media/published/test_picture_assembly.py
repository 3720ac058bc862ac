"""Pictures out of packets on a network that does what networks do; every loss, order and repetition is exact."""

import random

import pytest

from lockstep.server.media.codecs.packetise import packetise_h264, packetise_vp8
from lockstep.server.media.published.depacketise import PictureCodec
from lockstep.server.media.published.picture_assembly import (
    CAPACITY,
    MOST_PATIENCE,
    AssembledPicture,
    MediaPacket,
    PictureAssembly,
)

CODE = b"\x00\x00\x00\x01"
STEP = 3000  # of RTP timestamps: 30 pictures a second


def picture(codec: PictureCodec, number: int, *, key: bool, size: int = 3000) -> bytes:
    body = bytes([0x80 + number]) * size  # no start code among it
    if codec == "VP8":
        return (b"\x10" if key else b"\x11") + body
    # Two slices, so that a picture whose beginning is missing still looks like one.
    slice_kind = b"\x65" if key else b"\x41"
    sets = CODE + b"\x67set" + CODE + b"\x68set" if key else b""
    return sets + b"".join(CODE + slice_kind + b"\x80" + part for part in (body, body))


def sent(
    codec: PictureCodec, keys: list[bool], *, first_sequence: int = 65_500, first_timestamp: int = 2**32 - 2 * STEP
) -> list[list[MediaPacket]]:
    """The packets of each picture, across the wraps of both numbers."""
    packetise = packetise_vp8 if codec == "VP8" else packetise_h264
    sequence = first_sequence
    found = []
    for number, key in enumerate(keys):
        payloads = packetise(picture(codec, number, key=key))
        timestamp = (first_timestamp + number * STEP) % 2**32
        packets = []
        for index, payload in enumerate(payloads):
            packets.append(MediaPacket(sequence % 2**16, timestamp, index == len(payloads) - 1, payload))
            sequence += 1
        found.append(packets)
    return found


def numbers(pictures: list[AssembledPicture]) -> list[int]:
    return [each.data[-1] - 0x80 for each in pictures]


CODECS: tuple[PictureCodec, ...] = ("H264", "VP8")
GOP = [True, False, False, True, False, False]


@pytest.mark.parametrize("codec", CODECS)
def test_what_comes_in_order_goes_on_as_it_was_with_the_arrival_of_its_first_packet(codec: PictureCodec) -> None:
    assembly = PictureAssembly(codec)
    found = []
    now = 0.0
    for packets in sent(codec, GOP):
        for packet in packets:
            found += assembly.take(packet, now)
            now += 0.001
    assert [each.data for each in found] == [picture(codec, n, key=key) for n, key in enumerate(GOP)]
    assert [each.keyframe for each in found] == GOP
    spans = [later.media_time - each.media_time for each, later in zip(found, found[1:], strict=False)]
    assert spans == pytest.approx([1 / 30] * 5)
    assert found[0].arrival == 0.0
    assert (assembly.lost, assembly.malformed) == (0, 0)
    assert not assembly.wants_keyframe(now)


@pytest.mark.parametrize("codec", CODECS)
@pytest.mark.parametrize("seed", range(5))
def test_another_order_and_repetitions_change_nothing(codec: PictureCodec, seed: int) -> None:
    chance = random.Random(seed)
    packets = [packet for each in sent(codec, GOP) for packet in each]
    shuffled = [packets[0], *sorted(packets[1:], key=lambda each: packets.index(each) + chance.uniform(0, 8))]
    assembly = PictureAssembly(codec)
    found = []
    for packet in shuffled:
        for _ in range(chance.choice((1, 2))):
            found += assembly.take(packet, 0.0)
    assert numbers(found) == [0, 1, 2, 3, 4, 5]
    assert assembly.lost == 0


@pytest.mark.parametrize("codec", CODECS)
@pytest.mark.parametrize("lost_packet", [0, 1, -1])
def test_after_a_loss_that_is_not_repaired_nothing_goes_on_until_the_next_keyframe(
    codec: PictureCodec, lost_packet: int
) -> None:
    stream = sent(codec, GOP)
    del stream[1][lost_packet]
    assembly = PictureAssembly(codec)
    found = []
    for at, packets in enumerate(stream[:3]):
        for packet in packets:
            found += assembly.take(packet, at / 30)
    assert numbers(found) == [0]
    found += assembly.look(1 / 30 + MOST_PATIENCE + 0.1)
    assert numbers(found) == [0]
    assert assembly.wants_keyframe(1.0)
    assert not assembly.wants_keyframe(1.1)  # asked for already
    assert assembly.wants_keyframe(1.6)
    for packets in stream[3:]:
        for packet in packets:
            found += assembly.take(packet, 2.0)
    assert numbers(found) == [0, 3, 4, 5]
    assert assembly.lost == 1
    assert not assembly.wants_keyframe(9.0)


@pytest.mark.parametrize("codec", CODECS)
def test_a_keyframe_without_its_beginning_is_none(codec: PictureCodec) -> None:
    stream = sent(codec, [True, False, True, False, True])
    del stream[2][0]
    assembly = PictureAssembly(codec)
    found = []
    for at, packets in enumerate(stream):
        for packet in packets:
            found += assembly.take(packet, at * 1.0)
    assert numbers(found) == [0, 1, 4]


@pytest.mark.parametrize("codec", CODECS)
def test_who_joins_in_the_middle_waits_for_a_whole_keyframe(codec: PictureCodec) -> None:
    stream = sent(codec, [True, False, True])
    assembly = PictureAssembly(codec)
    found = []
    for packet in [*stream[0][1:], *stream[1], *stream[2]]:
        found += assembly.take(packet, 0.0)
    assert numbers(found) == [2]


@pytest.mark.parametrize("codec", CODECS)
def test_a_missing_packet_that_comes_late_repairs_the_picture_that_waits_for_it(
    codec: PictureCodec,
) -> None:
    stream = sent(codec, [True, False])
    missing = stream[1].pop(1)
    assembly = PictureAssembly(codec)
    found = []
    for packet in [*stream[0], *stream[1]]:
        found += assembly.take(packet, 0.0)
    assert numbers(found) == [0]
    repaired = assembly.take(missing, 0.25)
    assert numbers(repaired) == [1]
    assert repaired[0].arrival == 0.0  # of its first packet, not of its last


def test_a_picture_ends_with_its_timestamp_where_its_sender_sets_no_marker() -> None:
    assembly = PictureAssembly("VP8")
    found = []
    for packets in sent("VP8", [True, False, False]):
        for packet in packets:
            found += assembly.take(packet._replace(marker=False), 0.0)
    assert numbers(found) == [0, 1]


def test_a_long_gap_is_given_up_at_once_and_its_packets_are_not_kept() -> None:
    assembly = PictureAssembly("VP8")
    before, after = sent("VP8", [True])[0], sent("VP8", [True], first_sequence=65_500 + 5000)[0]
    found = []
    for packet in [*before[:-1], *after]:
        found += assembly.take(packet, 0.0)
    assert numbers(found) == [0]
    assert found[0].media_time == pytest.approx((2**32 - 2 * STEP) / 90_000)


def test_what_waits_is_bounded_whatever_comes() -> None:
    chance = random.Random(3)
    assembly = PictureAssembly("H264")
    for at in range(20_000):
        packet = MediaPacket(chance.randrange(2**16), chance.randrange(2**32), chance.random() < 0.1, b"\x41x")
        assembly.take(packet, at / 1000)
        assert len(assembly._kept) <= CAPACITY
        assert len(assembly._missing) <= CAPACITY


def test_padding_alone_is_no_picture_and_breaks_nothing() -> None:
    stream = sent("VP8", [True, False])
    padding = MediaPacket((stream[0][-1].sequence + 1) % 2**16, stream[0][0].timestamp, False, b"")
    later = [packet._replace(sequence=(packet.sequence + 1) % 2**16) for packet in stream[1]]
    assembly = PictureAssembly("VP8")
    found = []
    for packet in [*stream[0], padding, *later]:
        found += assembly.take(packet, 0.0)
    assert numbers(found) == [0, 1]


def test_a_picture_that_is_none_of_its_codec_is_counted_and_a_keyframe_is_asked_for() -> None:
    stream = sent("VP8", [True, False, True])
    assembly = PictureAssembly("VP8")
    broken = [stream[1][0]._replace(payload=b"\x90"), *stream[1][1:]]
    found = []
    for packet in [*stream[0], *broken]:
        found += assembly.take(packet, 0.0)
    assert numbers(found) == [0]
    assert assembly.malformed == 1
    assert assembly.wants_keyframe(0.0)
    for packet in stream[2]:
        found += assembly.take(packet, 0.0)
    assert numbers(found) == [0, 2]


def test_after_a_picture_that_could_not_be_used_a_keyframe_is_asked_for() -> None:
    stream = sent("VP8", [True, False, True])
    assembly = PictureAssembly("VP8")
    for packet in stream[0]:
        assembly.take(packet, 0.0)
    assembly.lost_picture()
    assert assembly.wants_keyframe(0.0)
    assert [each for packet in stream[1] for each in assembly.take(packet, 0.0)] == []
    assert numbers([each for packet in stream[2] for each in assembly.take(packet, 0.0)]) == [2]
