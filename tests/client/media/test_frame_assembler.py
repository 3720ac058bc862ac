from collections.abc import Iterable

from hypothesis import given
from hypothesis import strategies as st

from lockstep.client.media.frame_assembler import (
    KEYFRAME_RETRY,
    PATIENCE,
    SEQUENCES,
    WINDOW,
    AudioAssembler,
    EncodedFrame,
    MediaPacket,
    VideoAssembler,
)


def packets_of(sizes: Iterable[int], first: int = 0) -> list[MediaPacket]:
    """Frames of so many packets; the first is a keyframe, every packet says which frame and part it is."""
    packets: list[MediaPacket] = []
    for number, size in enumerate(sizes):
        for part in range(size):
            data = (b"K" if number == 0 else b"D") + bytes([number % 256, part])
            sequence = (first + len(packets)) % SEQUENCES
            packets.append(MediaPacket(sequence, number * 3000, part == size - 1, data, number + 1))
    return packets


def is_keyframe(data: bytes) -> bool:
    return data.startswith(b"K")


def add_all(assembler: VideoAssembler, packets: Iterable[MediaPacket], now: float = 0.0) -> list[EncodedFrame]:
    return [frame for packet in packets for frame in assembler.add(packet, now)]


sizes = st.lists(st.integers(1, 6), min_size=1, max_size=30)


@given(sizes, st.integers(0, SEQUENCES - 1))
def test_every_frame_comes_out_with_its_last_packet(frame_sizes: list[int], first: int) -> None:
    assembler = VideoAssembler(is_keyframe)
    packets = packets_of(frame_sizes, first)
    done = 0
    for packet in packets:
        frames = assembler.add(packet, 0.0)
        assert len(frames) == int(packet.marker)
        for frame in frames:
            assert frame.stamp == done + 1
            assert len(frame.data) == 3 * frame_sizes[done]
            done += 1
    assert done == len(frame_sizes)


@given(sizes, st.integers(0, SEQUENCES - 1), st.data())
def test_packets_out_of_order_or_doubled_give_the_same_frames(
    frame_sizes: list[int], first: int, data: st.DataObject
) -> None:
    packets = packets_of(frame_sizes, first)
    expected = add_all(VideoAssembler(is_keyframe), packets)
    rest = data.draw(st.permutations(packets[1:]))
    doubled = [packet for packet in rest for _ in range(data.draw(st.integers(1, 2)))]
    assert add_all(VideoAssembler(is_keyframe), [packets[0], *doubled]) == expected


@given(sizes, st.integers(0, SEQUENCES - 1), st.sets(st.integers(1, 60)))
def test_what_comes_late_completes_the_frames(frame_sizes: list[int], first: int, absent: set[int]) -> None:
    packets = packets_of(frame_sizes, first)
    lost = {packets[index].sequence for index in absent if index < len(packets) - 1}
    assembler = VideoAssembler(is_keyframe)
    frames = add_all(assembler, [packet for packet in packets if packet.sequence not in lost])
    frames += add_all(assembler, [packet for packet in packets if packet.sequence in lost], PATIENCE)
    assert frames == add_all(VideoAssembler(is_keyframe), packets)


def test_after_a_frame_that_never_completes_nothing_comes_before_a_keyframe() -> None:
    assembler = VideoAssembler(is_keyframe)
    packets = packets_of([1, 2, 1, 1])
    assert len(add_all(assembler, [packets[0], packets[2], packets[3]], 0.0)) == 1
    assert assembler.add(packets[4], PATIENCE + 0.1) == []
    assert assembler.wants_keyframe(PATIENCE + 0.1)
    later = [MediaPacket(5, 20, True, b"D", 9), MediaPacket(6, 21, True, b"K", 10), MediaPacket(7, 22, True, b"D", 11)]
    assert [frame.stamp for frame in add_all(assembler, later, PATIENCE + 0.2)] == [10, 11]
    assert assembler.lost > 0
    assert assembler.undecodable == 2


def test_a_jump_beyond_the_window_starts_over() -> None:
    assembler = VideoAssembler(is_keyframe)
    add_all(assembler, packets_of([1]))
    far = MediaPacket(WINDOW + 1, 50, True, b"K", 7)
    assert [frame.stamp for frame in assembler.add(far, 0.1)] == [7]


def test_a_keyframe_is_asked_for_only_when_the_first_one_does_not_come() -> None:
    assembler = VideoAssembler(is_keyframe)
    assembler.add(MediaPacket(1, 1, True, b"D", 1), 0.0)
    assert not assembler.wants_keyframe(0.1)
    assert assembler.wants_keyframe(KEYFRAME_RETRY)
    assert not assembler.wants_keyframe(KEYFRAME_RETRY + 0.1)
    assert assembler.wants_keyframe(2 * KEYFRAME_RETRY)
    assembler.add(MediaPacket(2, 2, True, b"K", 2), 1.0)
    assert not assembler.wants_keyframe(9.0)


def test_a_decoder_that_failed_gets_a_keyframe_next() -> None:
    assembler = VideoAssembler(is_keyframe)
    add_all(assembler, packets_of([1]))
    assembler.broken()
    assert assembler.wants_keyframe(KEYFRAME_RETRY)
    assert assembler.add(MediaPacket(1, 1, True, b"D", 1), 0.0) == []


def test_a_packet_of_the_past_is_left_out() -> None:
    assembler = VideoAssembler(is_keyframe)
    packets = packets_of([1, 1])
    add_all(assembler, packets)
    assert add_all(assembler, packets) == []


def test_sound_comes_out_packet_by_packet_and_never_backwards() -> None:
    assembler = AudioAssembler()
    stamps = []
    for sequence in (65534, 65535, 1, 0, 1, 2):
        frames = assembler.add(MediaPacket(sequence, sequence, False, b"x", sequence + 1), 0.0)
        stamps += [frame.stamp for frame in frames]
    assert stamps == [65535, 65536, 2, 3]
    assert assembler.lost == 1
    assert not assembler.wants_keyframe(9.0)
    assembler.broken()


def test_over_a_satellite_a_lost_packet_is_waited_for() -> None:
    assembler = VideoAssembler(is_keyframe)
    assembler.round_trip = 0.6
    packets = packets_of([1, 3, 1])
    add_all(assembler, [packet for packet in packets if packet.sequence != 2], 10.0)
    lost = next(packet for packet in packets if packet.sequence == 2)
    assert len(assembler.add(lost, 11.25)) == 2
    assert assembler.lost == 0
    assert not assembler.wants_keyframe(11.3)


def test_gaps_that_follow_one_another_over_a_long_path_are_not_one_long_gap() -> None:
    assembler = VideoAssembler(is_keyframe)
    assembler.round_trip = 0.6
    packets = packets_of([1] * 120)  # 4 s at 30 Hz, of which every tenth comes a round trip late
    arrivals = [(i / 30 + (0.6 if i % 10 == 9 else 0.0), packet) for i, packet in enumerate(packets)]
    frames = [frame for at, packet in sorted(arrivals, key=lambda each: each[0]) for frame in assembler.add(packet, at)]
    assert len(frames) == 120
    assert assembler.lost == 0
