from lockstep.rtc.sctp import SctpSettings
from lockstep.rtc.sctp.sending.outgoing import ACKNOWLEDGED, IN_FLIGHT, Outgoing
from lockstep.rtc.sctp.sending.retransmission_timer import RetransmissionTimer
from lockstep.rtc.sctp.sending.round_trip import RoundTrip
from lockstep.rtc.sctp.sending.send_queue import Message

PEER_DELAY = 0.2


def timer() -> RetransmissionTimer:
    return RetransmissionTimer(RoundTrip(SctpSettings(initial_timeout=0.5)), PEER_DELAY)


def sent(to: RetransmissionTimer, now: float, *, newest: bool = False) -> Outgoing:
    chunk = Outgoing(0, 0, Message(0, 51, b"x"), 0, b"x", newest)
    chunk.state, chunk.sent_at = IN_FLIGHT, now
    to.left(chunk, now)
    return chunk


def test_each_wait_in_vain_makes_the_next_one_longer() -> None:
    waits = timer()
    chunk = sent(waits, 1.0)
    assert waits.deadline(None) == 1.5
    assert not waits.expires(1.4)
    assert waits.expires(1.5)
    assert list(waits.late(1.5)) == [chunk]
    assert waits.deadline(None) is None
    sent(waits, 2.0)
    assert waits.deadline(None) == 3.0
    waits.expiries = 0
    assert waits.deadline(None) == 2.5


def test_what_was_acknowledged_is_not_waited_for() -> None:
    waits = timer()
    first = sent(waits, 1.0)
    sent(waits, 1.2)
    first.state = ACKNOWLEDGED
    assert waits.deadline(None) == 1.7
    assert waits.deadline(1.6) == 1.6


def test_newest_wins_chunks_wait_for_the_peers_delay_as_well_and_make_no_wait_longer() -> None:
    waits = timer()
    chunk = sent(waits, 1.0, newest=True)
    due = waits.deadline(None)
    assert due == 1.0 + (0.5 + PEER_DELAY)
    assert list(waits.late_newest(due)) == [chunk]
    assert waits.expiries == 0
