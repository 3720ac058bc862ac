from lockstep.rtc.sctp import SctpSettings
from lockstep.rtc.sctp.sending.outgoing import Outgoing
from lockstep.rtc.sctp.sending.send_queue import Message
from lockstep.rtc.sctp.sending.send_window import SendWindow

SETTINGS = SctpSettings(max_packet=1000, newest_wins_floor=2, window_floor=2, max_burst=3)


def chunk(size: int, *, newest: bool = False) -> Outgoing:
    message = Message(0, 51, bytes(size), ordered=not newest, max_retransmits=0 if newest else None)
    return Outgoing(0, 0, message, 0, message.payload, newest)


def test_one_chunk_may_always_be_in_flight_also_into_a_closed_window() -> None:
    window = SendWindow(SETTINGS)
    assert window.admits(1000)
    sent = chunk(1000)
    window.left(sent)
    window.begin_burst()
    assert not window.admits(1)
    window.landed(sent)
    assert window.admits(1000)


def test_a_burst_ends_until_something_happens() -> None:
    window = SendWindow(SETTINGS)
    window.peer_window = 1_000_000
    window.begin_burst()
    for _ in range(3):
        assert window.admits(1000)
        window.left(chunk(1000))
    assert not window.admits(1000)
    window.begin_burst()
    assert window.admits(1000)


def test_each_kind_has_its_floor_where_the_congestion_window_is_full() -> None:
    window = SendWindow(SETTINGS)
    window.peer_window = 1_000_000
    window.congestion.size = 0
    window.begin_burst()
    for _ in range(2):
        assert window.admits_newest(1000)
        window.left(chunk(1000, newest=True))
    assert not window.admits_newest(1000)
    for _ in range(2):
        assert window.admits(1000)
        window.left(chunk(1000))
    assert not window.admits(1000)
