from lockstep.server.talkback.talkback_arbiter import MAX_PACKET, RATE, SPEAKS_FOR, TalkbackArbiter, VoicePacket


def packet(number: int, size: int = 80) -> VoicePacket:
    return VoicePacket(number & 0xFFFF, bytes(size))


def test_only_who_holds_the_seat_is_heard_and_everyone_is_told_who_that_is() -> None:
    arbiter = TalkbackArbiter(lambda peer: peer == "ann")
    assert arbiter.packet("bob", "Bob", packet(1), 10.0) == "no_seat"
    assert arbiter.state(10.0).peer == ""
    assert arbiter.packet("ann", "Ann", packet(1), 10.0) == "played"
    assert (arbiter.state(10.1).peer, arbiter.state(10.1).name) == ("ann", "Ann")
    assert arbiter.state(10.0 + SPEAKS_FOR).peer == ""


def test_who_loses_the_seat_is_silent_at_once() -> None:
    holder = ["ann"]
    arbiter = TalkbackArbiter(lambda peer: peer in holder)
    arbiter.packet("ann", "Ann", packet(1), 10.0)
    holder[:] = ["bob"]
    assert not arbiter.speaks(10.01)
    assert arbiter.state(10.01).peer == ""
    assert arbiter.packet("ann", "Ann", packet(2), 10.02) == "no_seat"
    assert arbiter.packet("bob", "Bob", packet(7), 10.02) == "played"


def test_packets_are_played_once_and_in_order_over_the_wrap() -> None:
    arbiter = TalkbackArbiter(lambda peer: True)
    outcomes = [arbiter.packet("ann", "Ann", packet(number), 10.0) for number in (65534, 65535, 65535, 0, 65534, 3)]
    assert outcomes == ["played", "played", "late", "played", "late", "played"]
    assert arbiter.packet("ann", "Ann", packet(0), 10.0 + 2 * SPEAKS_FOR) == "played"  # a new beginning may count anew


def test_more_than_speech_needs_and_longer_than_opus_allows_is_left_out() -> None:
    arbiter = TalkbackArbiter(lambda peer: True)
    assert arbiter.packet("ann", "Ann", packet(0, MAX_PACKET + 1), 10.0) == "too_large"
    outcomes = [arbiter.packet("ann", "Ann", packet(i), 10.0 + i / 1000) for i in range(1, 1001)]
    assert outcomes.count("played") <= RATE + 25
    assert set(outcomes) == {"played", "too_often"}


def test_while_the_loudspeaker_does_not_work_nobody_counts_as_heard() -> None:
    arbiter = TalkbackArbiter(lambda peer: True)
    arbiter.packet("ann", "Ann", packet(1), 10.0)
    arbiter.trouble = "it is gone"
    assert (arbiter.state(10.1).peer, arbiter.state(10.1).trouble) == ("", "it is gone")
