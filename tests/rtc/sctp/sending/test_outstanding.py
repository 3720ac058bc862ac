from lockstep.rtc.sctp import SctpSettings
from lockstep.rtc.sctp.sending.outgoing import ACKNOWLEDGED, IN_FLIGHT, Outgoing
from lockstep.rtc.sctp.sending.outstanding import Outstanding
from lockstep.rtc.sctp.sending.send_queue import Message
from lockstep.rtc.sctp.sending.send_window import SendWindow
from lockstep.rtc.sctp.wire.chunks import Sack


def in_flight(count: int) -> tuple[Outstanding, SendWindow]:
    """Chunks of 10 bytes with the TSNs from 1 on, all of them on their way since 0.0."""
    window = SendWindow(SctpSettings())
    outstanding = Outstanding(1, window)
    for tsn in range(1, count + 1):
        chunk = Outgoing(tsn, 0, Message(0, 51, bytes(10)), 0, bytes(10), False)
        chunk.state, chunk.sent_count = IN_FLIGHT, 1
        outstanding.chunks.append(chunk)
        window.left(chunk)
    return outstanding, window


def test_what_has_arrived_is_told_once_also_where_gaps_overlap() -> None:
    outstanding, window = in_flight(6)
    arrived = outstanding.take(Sack(1, 0, [(2, 3), (3, 4), (4, 9)]), 1)
    assert [chunk.tsn for chunk in arrived] == [1, 3, 4, 5, 6]
    assert window.flight == 10
    assert outstanding.take(Sack(1, 0, [(2, 3)]), 1) == []


def test_a_chunk_is_lost_when_it_was_missed_three_times_and_is_not_only_late() -> None:
    outstanding, _ = in_flight(5)
    for offset in (2, 3):
        assert outstanding.missed(outstanding.take(Sack(0, 0, [(offset, offset)]), 0), 1.0, 0.5) == []
    arrived = outstanding.take(Sack(0, 0, [(4, 4)]), 0)
    first = outstanding.chunks[0]
    assert outstanding.missed(arrived, 0.4, 0.5) == []
    assert outstanding.missed(arrived, 1.0, 0.5) == [first]


def test_a_peer_that_names_an_acknowledged_chunk_no_more_has_dropped_it() -> None:
    outstanding, _ = in_flight(3)
    outstanding.take(Sack(0, 0, [(2, 2)]), 0)
    second = outstanding.chunks[1]
    assert second.state is ACKNOWLEDGED
    assert not outstanding.was_dropped(second)
    outstanding.take(Sack(0, 0, [(3, 3)]), 0)
    assert outstanding.was_dropped(second)
