import pytest

from server.media.sent_history import RETRANSMIT_BURST, RETRANSMIT_RATE, SentFrame, SentHistory


def history(frames: list[int], capacity: int = 8) -> SentHistory:
    """A history of frames with these numbers of packets; each payload is the number of its packet."""
    result, first = SentHistory(capacity), 0
    for size in frames:
        result.append(SentFrame(first, [b"%d" % (first + i) for i in range(size)], b"", 0, True))
        first += size
    return result


def found(past: SentHistory, number: int, origin: int) -> bytes | None:
    hit = past.find((origin + number) & 0xFFFF, origin)
    return hit and hit[0].payloads[hit[1]]


@pytest.mark.parametrize("origin", [0, 1000, 65533, 65535])
def test_every_packet_that_is_kept_is_found_across_the_wrap(origin: int) -> None:
    past = history([1, 3, 2, 1], capacity=8)
    assert [found(past, i, origin) for i in range(7)] == [b"%d" % i for i in range(7)]


@pytest.mark.parametrize("origin", [0, 65533])
def test_older_and_future_packets_are_unknown(origin: int) -> None:
    past = history([3, 3, 3], capacity=6)
    assert found(past, 2, origin) is None
    assert found(past, 3, origin) == b"3"
    assert found(past, 9, origin) is None
    assert found(past, -1, origin) is None


def test_a_number_that_was_used_again_means_the_newest_packet() -> None:
    past = SentHistory(100)
    past.append(SentFrame(65536 * 3 + 5, [b"new"], b"", 0, True))
    assert found(past, 5, 0) == b"new"


def test_a_frame_larger_than_the_capacity_is_kept_whole() -> None:
    assert found(history([20], capacity=8), 0, 0) == b"0"


def test_an_empty_history_knows_nothing() -> None:
    assert SentHistory(8).find(0, 0) is None


def test_retransmissions_are_limited_and_recover() -> None:
    past = SentHistory(8)
    assert sum(past.spend(100.0) for _ in range(1000)) == RETRANSMIT_BURST
    assert sum(past.spend(100.125) for _ in range(1000)) == RETRANSMIT_RATE / 8
