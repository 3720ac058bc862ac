import pytest

from server.media.sent_history import (
    KEEP_BYTES,
    KEEP_PACKETS,
    KEEP_SECONDS,
    REPEATED,
    RETRANSMIT_BURST,
    RETRANSMIT_RATE,
    SentFrame,
    SentHistory,
)


def history(frames: list[int], interval: float = 0.0) -> SentHistory:
    """A history of frames with these numbers of packets; each payload is the number of its packet."""
    result, first = SentHistory(), 0
    for i, size in enumerate(frames):
        result.append(SentFrame(first, [b"%d" % (first + i) for i in range(size)], b"", 0, True, size, i * interval))
        first += size
    return result


def found(past: SentHistory, number: int, origin: int) -> bytes | None:
    hit = past.find((origin + number) & 0xFFFF, origin)
    return hit and hit[0].payloads[hit[1]]


@pytest.mark.parametrize("origin", [0, 1000, 65533, 65535])
def test_every_packet_that_is_kept_is_found_across_the_wrap(origin: int) -> None:
    past = history([1, 3, 2, 1])
    assert [found(past, i, origin) for i in range(7)] == [b"%d" % i for i in range(7)]


@pytest.mark.parametrize("origin", [0, 65533])
def test_older_and_future_packets_are_unknown(origin: int) -> None:
    past = history([3, 3, 3], interval=KEEP_SECONDS * 0.6)
    assert found(past, 2, origin) is None
    assert found(past, 3, origin) == b"3"
    assert found(past, 9, origin) is None
    assert found(past, -1, origin) is None


def test_a_packet_is_kept_for_three_round_trips_over_a_satellite() -> None:
    assert found(history([1] * 60, interval=0.033), 0, 0) == b"0"
    assert KEEP_SECONDS >= 3 * 0.6


def test_the_history_is_bounded_by_packets() -> None:
    past = history([16] * (KEEP_PACKETS // 16 + 1))
    assert found(past, 0, 0) is None
    assert found(past, 16, 0) == b"16"


def test_the_history_is_bounded_by_bytes() -> None:
    past = SentHistory()
    past.append(SentFrame(0, [bytes(KEEP_BYTES)], b"", 0, True, KEEP_BYTES, 0.0))
    assert past.find(0, 0) is not None
    past.append(SentFrame(1, [b"more"], b"", 0, True, 4, 0.0))
    assert past.find(0, 0) is None


def test_a_number_that_was_used_again_means_the_newest_packet() -> None:
    past = SentHistory()
    past.append(SentFrame(65536 * 3 + 5, [b"new"], b"", 0, True, 3, 0.0))
    assert found(past, 5, 0) == b"new"


def test_a_frame_larger_than_the_bound_is_kept_whole() -> None:
    assert found(history([KEEP_PACKETS + 1]), 0, 0) == b"0"


def test_an_empty_history_knows_nothing() -> None:
    assert SentHistory().find(0, 0) is None


def test_retransmissions_are_limited_and_recover() -> None:
    past = SentHistory()
    assert sum(past.spend(i, 100.0) for i in range(1000)) == RETRANSMIT_BURST
    assert sum(past.spend(i, 100.125) for i in range(1000)) == RETRANSMIT_RATE / 8


def test_what_was_sent_again_is_on_its_way_for_a_round_trip() -> None:
    past = SentHistory()
    assert not past.on_its_way(7, 1.0, 0.6)
    past.spend(7, 1.0)
    assert past.on_its_way(7, 1.59, 0.6)
    assert not past.on_its_way(8, 1.1, 0.6)
    assert not past.on_its_way(7, 1.61, 0.6)


def test_the_memory_of_retransmissions_is_bounded() -> None:
    past = SentHistory()
    for i in range(REPEATED + 1):
        past.spend(i, float(i))
    assert not past.on_its_way(0, float(REPEATED), 1e9)
    assert past.on_its_way(1, float(REPEATED), 1e9)


def test_a_wall_clock_that_is_set_back_does_not_end_repairs() -> None:
    past = history([1] * 40)
    for number in range(int(RETRANSMIT_BURST)):
        assert past.spend(number, 10_000.0)
    assert not past.spend(39, 10_000.0)
    assert not past.on_its_way(0, 6400.0, 0.1), "it was sent again an hour from now"
    past.spend(39, 6400.0)
    assert past.spend(39, 6401.0)
