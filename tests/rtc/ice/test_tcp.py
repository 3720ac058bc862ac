import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.rtc.ice.tcp import MAX_DATAGRAM, FramingError, TcpFraming, frame


@given(st.lists(st.binary(min_size=1, max_size=50)), st.lists(st.integers(1, 30), min_size=1))
def test_datagrams_come_out_whatever_pieces_their_bytes_come_in(datagrams: list[bytes], pieces: list[int]) -> None:
    stream, framing, found = b"".join(map(frame, datagrams)), TcpFraming(), []
    turn = 0
    while stream:
        size = pieces[turn % len(pieces)]
        found += framing.receive_bytes(stream[:size])
        stream, turn = stream[size:], turn + 1
    assert found == datagrams


def test_a_promise_of_too_much_ends_the_connection() -> None:
    framing = TcpFraming(max_datagram=100)
    assert framing.receive_bytes(frame(b"first") + b"\x00\x65" + bytes(101)) == [b"first"]
    assert framing.too_long
    assert framing.receive_bytes(frame(b"second")) == []
    assert framing.counts == {"frame_too_long": 1}


def test_what_is_kept_of_a_slow_peer_is_bounded() -> None:
    framing = TcpFraming(max_datagram=100)
    for _ in range(99):
        framing.receive_bytes(b"\x00\x64"[:1] if _ == 0 else b"\x64" if _ == 1 else b"x")
    assert len(framing._kept) <= 102


def test_empty_frames_are_counted_and_skipped() -> None:
    framing = TcpFraming()
    assert framing.receive_bytes(frame(b"") + frame(b"x")) == [b"x"]
    assert framing.counts == {"empty_frame": 1}


def test_more_than_a_length_field_can_say_is_refused_by_name() -> None:
    assert len(frame(bytes(MAX_DATAGRAM))) == MAX_DATAGRAM + 2
    with pytest.raises(FramingError):
        frame(bytes(MAX_DATAGRAM + 1))
