"""Handshake, end and rules of one association."""

import pytest

from lockstep.rtc.sctp import (
    Association,
    AssociationClosed,
    Closed,
    Established,
    MessageReceived,
    MessageTooLarge,
    OutgoingStreamsReset,
    SctpSettings,
    SendQueueFull,
    State,
    StreamsReset,
)
from lockstep.rtc.sctp.wire.chunks import (
    BEGIN,
    END,
    IMMEDIATE,
    UNORDERED,
    Abort,
    CookieEcho,
    Data,
    Error,
    ForwardTsn,
    Heartbeat,
    HeartbeatAck,
    Init,
    InitAck,
    InterleavedData,
    Reconfig,
    Sack,
    Skip,
    Unknown,
)
from lockstep.rtc.sctp.wire.packet import decode_packet, encode_packet
from lockstep.rtc.sctp.wire.parameters import (
    OUTGOING_RESET_REQUEST,
    RECONFIG_RESPONSE,
    STATE_COOKIE,
    UNRECOGNIZED_PARAMETER,
)
from tests.rtc.sctp.hostile import Victim
from tests.rtc.sctp.internals import Internals
from tests.rtc.sctp.network import Link, World, associated, seeded

WHOLE = BEGIN | END


def pair(settings: SctpSettings | None = None) -> World[Association]:
    settings = settings or SctpSettings()
    return World(Association(settings, seeded(1)), Association(settings, seeded(2)))


def kinds(packets: list[tuple[float, bytes]]) -> list[list[str]]:
    return [[type(chunk).__name__ for chunk in decode_packet(packet).chunks] for _, packet in packets]


# Handshake


def test_one_end_alone_may_begin() -> None:
    world = pair()
    world.ends[0].start(0.0)
    world.run(0.5)
    assert [end.state for end in world.ends] == [State.ESTABLISHED] * 2
    assert [end.events() for end in world.ends] == [[Established(1024, True)]] * 2
    assert kinds(world.packets[0]) == [["Init"], ["CookieEcho"], ["HeartbeatAck"]]
    assert kinds(world.packets[1]) == [["InitAck"], ["CookieAck", "Heartbeat"]]


def test_colliding_inits_make_one_association() -> None:
    world = pair()
    for end in world.ends:
        end.start(0.0)
    world.run(2.0)
    assert [end.events() for end in world.ends] == [[Established(1024, True)]] * 2


def test_messages_travel_with_the_cookie() -> None:
    world = pair()
    world.ends[0].start(0.0)
    world.ends[0].send(0, 51, b"early", 0.0)
    world.run(0.1501)  # three one-way times
    assert world.ends[1].events() == [Established(1024, True), MessageReceived(0, 51, b"early")]


def test_the_handshake_goes_on_until_somebody_answers() -> None:
    world = pair()
    world.links[1].cuts.append((0.0, 3600.0))
    world.ends[0].start(0.0)
    world.run(3600.0)
    assert world.ends[0].state is State.COOKIE_WAIT
    assert 1200 <= len(world.packets[0]) <= 1300  # every three seconds
    world.run(3606.0)
    assert Established(1024, True) in world.ends[0].events()


def test_an_answer_to_a_repeated_init_is_no_round_trip() -> None:
    """The first answer comes after the second INIT."""
    world = pair()
    world.links = (Link(delay=0.4), Link(delay=0.4))
    world.ends[0].start(0.0)
    world.run(10.0)
    assert world.ends[0].round_trip.smoothed == pytest.approx(0.8)


def test_the_wait_for_a_lost_init_is_no_round_trip() -> None:
    world = pair()
    world.links[0].lose = lambda number, packet: number == 0
    world.ends[0].start(0.0)
    world.run(3.0)
    assert world.ends[0].round_trip.smoothed == pytest.approx(0.1)


def test_a_repeated_init_and_cookie_are_answered_again_without_effect() -> None:
    world = pair()
    world.links[0].duplication = world.links[1].duplication = 1.0
    world.ends[0].start(0.0)
    world.ends[0].send(0, 51, b"once", 0.0)
    world.run(5.0)
    assert world.ends[1].events() == [Established(1024, True), MessageReceived(0, 51, b"once")]


def test_a_restart_of_the_peer_ends_the_association_by_name() -> None:
    victim = Victim()
    packets = victim.say(Init(99, 100_000, 10, 10, 5))
    assert victim.events[-1] == Closed("peer_restarted")
    assert isinstance(decode_packet(packets[-1]).chunks[0], Abort)


def test_a_cookie_that_is_not_ours_is_counted() -> None:
    victim = Victim(established=False)
    victim.say(CookieEcho(bytes(60)))
    assert victim.end.counts["bad_cookie"] == 1
    assert victim.end.association.state is State.COOKIE_WAIT


def test_a_stale_cookie_is_answered_with_an_error_and_the_peer_begins_anew() -> None:
    world = pair(SctpSettings(cookie_lifetime=1.0))
    first, second = world.ends
    first.start(0.0)
    second.receive_packet(first.packets_to_send()[0], 0.0)
    (answer,) = second.packets_to_send()
    first.receive_packet(answer, 5.0)
    (echo,) = first.packets_to_send()
    second.receive_packet(echo, 5.0)
    (error,) = second.packets_to_send()
    assert isinstance(decode_packet(error).chunks[0], Error)
    world.now = 6.0
    first.receive_packet(error, 6.0)
    world.run(10.0)
    assert first.state is second.state is State.ESTABLISHED


@pytest.mark.parametrize("init", [Init(0, 9000, 1, 1, 1), Init(1, 9000, 0, 1, 1), Init(1, 100, 1, 1, 1)])
def test_an_init_with_a_forbidden_value_ends_the_association_by_name(init: Init) -> None:
    victim = Victim(established=False)
    victim.say(init)
    assert victim.events[-1] == Closed("init_invalid")


def test_unknown_parameters_are_reported_or_skipped_as_their_type_says() -> None:
    victim = Victim(established=False)
    init = Init(1, 9000, 1, 1, 1, [(0x8001, b"zero"), (0xC123, b"tell"), (0x4001, b"tell and stop"), (0xC124, b"no")])
    answers = [decode_packet(packet).chunks[0] for packet in victim.say(init)]
    (answer,) = [chunk for chunk in answers if isinstance(chunk, InitAck)]
    reported = [value for kind, value in answer.parameters if kind == UNRECOGNIZED_PARAMETER]
    assert [value[4:8] for value in reported] == [b"tell", b"tell"]
    assert STATE_COOKIE in dict(answer.parameters)


# Rules for packets


def test_packets_that_are_not_for_this_association_are_counted() -> None:
    victim = Victim()
    chunk = Heartbeat(b"").encode()
    victim.hear(encode_packet(5000, 5001, victim.tag, chunk))
    victim.hear(encode_packet(5000, 5000, victim.tag ^ 1, chunk))
    victim.hear(encode_packet(5000, 5000, 0, chunk))
    victim.hear(b"no packet")
    assert victim.end.counts == {"wrong_port": 1, "wrong_tag": 2, "malformed": 1}


@pytest.mark.parametrize(("kind", "reports", "goes_on"), [(20, 0, 0), (100, 1, 0), (150, 0, 1), (250, 1, 1)])
def test_unknown_chunks_are_treated_as_their_type_says(kind: int, reports: int, goes_on: int) -> None:
    victim = Victim()
    sent = [decode_packet(packet).chunks for packet in victim.say(Unknown(kind, 0, b"?"), Heartbeat(b"12345678"))]
    answers = [chunk for packet in sent for chunk in packet]
    assert sum(isinstance(chunk, Error) for chunk in answers) == reports
    assert sum(isinstance(chunk, HeartbeatAck) for chunk in answers) == goes_on


def test_data_without_payload_ends_the_association_by_name() -> None:
    victim = Victim()
    victim.say(Data(victim.tsn, WHOLE, 0, 0, 51, b""))
    assert victim.events[-1] == Closed("empty_data")


def test_the_other_kind_of_data_than_agreed_ends_the_association_by_name() -> None:
    victim = Victim()
    victim.say(InterleavedData(victim.tsn, WHOLE, 0, 0, 0, 51, b"x"))
    assert victim.events[-1] == Closed("interleaving_violated")


def test_data_on_a_stream_beyond_the_bound_is_acknowledged_and_reported() -> None:
    victim = Victim()
    sent = victim.say(Data(victim.tsn, WHOLE, 1024, 0, 51, b"x"))
    assert any(isinstance(chunk, Error) for packet in sent for chunk in decode_packet(packet).chunks)
    assert victim.end.counts["invalid_stream"] == 1


def test_a_sack_of_what_was_never_sent_is_counted() -> None:
    victim = Victim()
    victim.say(Sack((victim.theirs + 5) & 0xFFFFFFFF, 10_000))
    assert victim.end.counts["sack_of_unsent"] == 1


# Acknowledgements


def sacks(packets: list[bytes]) -> list[Sack]:
    return [chunk for packet in packets for chunk in decode_packet(packet).chunks if isinstance(chunk, Sack)]


def test_one_packet_is_acknowledged_after_a_while_and_two_at_once() -> None:
    victim = Victim()
    assert not sacks(victim.say(Data(victim.tsn, WHOLE | UNORDERED, 0, 0, 51, b"x")))
    assert not sacks(victim.wait(0.149))
    assert len(sacks(victim.wait(0.002))) == 1
    victim.say(Data(victim.tsn + 1, WHOLE | UNORDERED, 0, 0, 51, b"x"))
    assert len(sacks(victim.say(Data(victim.tsn + 2, WHOLE | UNORDERED, 0, 0, 51, b"x")))) == 1


@pytest.mark.parametrize("flag", [IMMEDIATE, 0])
def test_the_i_bit_and_a_hole_are_acknowledged_at_once(flag: int) -> None:
    victim = Victim()
    tsn = victim.tsn + (0 if flag else 3)
    (sack,) = sacks(victim.say(Data(tsn, WHOLE | UNORDERED | flag, 0, 0, 51, b"x")))
    assert list(sack.gaps) == ([] if flag else [(4, 4)])


def test_a_duplicate_is_acknowledged_at_once_and_reported_once() -> None:
    victim = Victim()
    chunk = Data(victim.tsn, WHOLE | UNORDERED | IMMEDIATE, 0, 0, 51, b"x")
    victim.say(chunk)
    (sack,) = sacks(victim.say(chunk))
    assert list(sack.duplicates) == [victim.tsn]
    (sack,) = sacks(victim.say(Data(victim.tsn + 1, WHOLE | UNORDERED | IMMEDIATE, 0, 0, 51, b"x")))
    assert not sack.duplicates


def test_an_acknowledgement_travels_with_data() -> None:
    world, first, second = associated()
    first.send(1, 51, b"question", world.now, ordered=False, max_retransmits=0)
    world.links[1].delay = 0.02
    world.run(world.now + 0.06)
    before = len(world.packets[1])
    second.send(1, 51, b"answer", world.now, ordered=False, max_retransmits=0)
    world.run(world.now + 1.0)
    assert kinds(world.packets[1][before:]) == [["Sack", "InterleavedData"]]


def test_each_packet_is_acknowledged_at_once_where_the_delay_is_0() -> None:
    world, first, _ = associated(SctpSettings(acknowledgement_delay=0.0))
    before = len(world.packets[1])
    for _ in range(10):
        first.send(1, 51, b"x", world.now, ordered=False, max_retransmits=0)
        world.run(world.now + 0.05)
    world.run(world.now + 0.05)
    assert len(world.packets[1]) - before == 10


# Bounds


def test_a_message_that_never_ends_ends_the_association_by_name() -> None:
    victim = Victim()
    for index in range(10):
        victim.say(Data(victim.tsn + index, BEGIN if index == 0 else 0, 0, 0, 51, bytes(1000)))
    assert victim.events[-1] == Closed("message_too_large")


def test_messages_that_never_end_on_many_streams_end_the_association_by_name() -> None:
    victim = Victim()
    for index in range(40):
        victim.say(Data(victim.tsn + index, BEGIN, index, 0, 51, bytes(1000)))
    assert victim.events[-1] == Closed("receive_window_exceeded")


def test_what_exceeds_the_window_is_dropped_and_taken_when_it_comes_again() -> None:
    victim = Victim()
    for index in range(1, 12):
        victim.say(Data(victim.tsn + index, WHOLE, 0, index + 1, 51, bytes(1000)))
    assert victim.end.counts["window_full"] > 0
    victim.say(Data(victim.tsn, WHOLE, 0, 1, 51, bytes(1000)))  # 0 was the OPEN
    for index in range(1, 12):
        victim.say(Data(victim.tsn + index, WHOLE, 0, index + 1, 51, bytes(1000)))
    assert Internals(victim.end.association).cumulative == victim.tsn + 11


def test_a_full_queue_is_said_and_loses_nothing() -> None:
    world, first, second = associated(SctpSettings(send_queue=10_000))
    world.links[0].cuts.append((0.0, world.now + 1.0))
    taken = 10
    for _ in range(taken):
        first.send(0, 51, bytes(1000), world.now)
    with pytest.raises(SendQueueFull):
        first.send(0, 51, bytes(1000), world.now)
    first.send(1, 51, b"another stream", world.now)
    assert first.buffered(0) == 10_000
    world.run(world.now + 10.0)
    arrived = [event.stream for event in second.events() if isinstance(event, MessageReceived)]
    assert (arrived.count(0), arrived.count(1)) == (taken, 1)


def test_no_more_than_a_burst_leaves_before_something_comes_back() -> None:
    settings = SctpSettings(send_queue=1_000_000)
    world, first, _ = associated(settings)
    for _ in range(30):
        first.send(0, 53, bytes(16_000), world.now)
    world.run(world.now + 10.0)
    assert Internals(first).congestion_window > 20 * settings.max_packet
    for _ in range(10):
        first.send(0, 53, bytes(16_000), world.now)
    leaving = first.packets_to_send() + first.packets_to_send()
    assert settings.max_burst <= len(leaving) <= settings.max_burst + 2  # it counts payload


def test_messages_are_refused_by_size_and_after_the_end() -> None:
    end = Association(SctpSettings(), seeded(1), peer_max_message=1000)
    with pytest.raises(MessageTooLarge):
        end.send(0, 51, bytes(1001), 0.0)
    with pytest.raises(ValueError, match="at least one byte"):
        end.send(0, 51, b"", 0.0)
    end.abort(0.0)
    with pytest.raises(AssociationClosed):
        end.send(0, 51, b"x", 0.0)


def test_a_closed_receive_window_is_probed_with_one_packet_at_a_time() -> None:
    victim = Victim()
    victim.say(Sack(victim.theirs - 1, 0))
    for _ in range(20):
        victim.end.association.send(1, 53, bytes(1000), victim.now)
        victim.end.association.send(1, 53, bytes(1000), victim.now, ordered=False, max_retransmits=0)
    assert len(victim.wait(0.0)) == 1
    assert len(victim.wait(0.6)) == 1


def test_a_path_that_becomes_slower_than_every_timeout_is_measured_again() -> None:
    """Each message is repeated before it can be acknowledged, which leaves no sample by Karn's rule."""
    world, first, second = associated(seconds=3.0)
    world.links = (Link(delay=1.5), Link(delay=1.5))
    for _ in range(120):
        first.send(0, 51, b"x", world.now)
        world.run(world.now + 1.0)
    assert first.round_trip.smoothed == pytest.approx(3.0, rel=0.1)
    repeats = first.counts["repeats"]
    for _ in range(20):
        first.send(0, 51, b"x", world.now)
        world.run(world.now + 1.0)
    assert first.counts["repeats"] == repeats
    world.run(world.now + 10.0)
    assert len(second.events()) == 140


def test_what_a_peer_had_acknowledged_and_dropped_is_sent_again() -> None:
    """RFC 9260 6.2.1 D iii."""
    victim = Victim()
    for _ in range(3):
        victim.end.association.send(1, 53, bytes(1000), victim.now)
    assert len(victim.wait(0.0)) == 3
    victim.say(Sack(victim.theirs - 1, 100_000, [(2, 3)]))
    victim.say(Sack(victim.theirs - 1, 100_000))
    again = [packet for _ in range(4) for packet in victim.wait(1.6)]
    sent = {chunk.tsn for packet in again for chunk in decode_packet(packet).chunks if isinstance(chunk, Data)}
    assert sent == {victim.theirs, victim.theirs + 1, victim.theirs + 2}


def test_streams_take_turns() -> None:
    world, first, second = associated(SctpSettings(interleaving=False))
    for _ in range(10):
        first.send(0, 53, bytes(16_000), world.now)
    first.send(1, 53, b"short", world.now)
    world.run(world.now + 10.0)
    assert [event.stream for event in second.events() if isinstance(event, MessageReceived)][:2] == [0, 1]


def test_two_messages_with_one_number_are_one() -> None:
    victim = Victim()
    victim.say(Data(victim.tsn + 1, WHOLE, 0, 2, 51, b"two"))
    victim.say(Data(victim.tsn + 2, WHOLE, 0, 2, 51, b"another two"))
    victim.say(Data(victim.tsn, WHOLE, 0, 1, 51, b"one"))
    assert [getattr(event, "data", None) for event in victim.events][-2:] == ["one", "two"]
    assert Internals(victim.end.association).held == 0


# Partial reliability


def test_a_message_whose_time_has_passed_is_not_repeated() -> None:
    world, first, second = associated()
    world.links[0].cuts.append((world.now, world.now + 1.0))
    first.send(0, 51, b"late", world.now, lifetime=0.2)
    world.run(world.now + 5.0)
    first.send(0, 51, b"next", world.now, lifetime=0.2)
    world.run(world.now + 1.0)
    assert second.events() == [MessageReceived(0, 51, b"next")]
    assert Internals(first).is_idle


def test_many_messages_that_were_given_up_are_told_of_in_one_forward_tsn() -> None:
    world, first, second = associated()
    start = world.now
    world.links[0].cuts.append((start, start + 0.5))
    for number in range(50):
        first.send(number % 5, 51, b"given up", world.now, max_retransmits=0)
        world.run(start + 0.01 * number)
    world.run(start + 20.0)
    assert first.counts["abandoned"] == 50
    for stream in range(5):
        first.send(stream, 51, b"next", world.now)
    world.run(world.now + 1.0)
    assert [event for event in second.events() if isinstance(event, MessageReceived)] == [
        MessageReceived(stream, 51, b"next") for stream in range(5)
    ]
    assert Internals(first).is_idle


def test_what_is_given_up_before_all_of_it_has_left_holds_nothing_up() -> None:
    """The window closes within the message, and what has left of it arrives after it was given up."""
    world, first, second = associated(SctpSettings(max_send_message=60_000), there=Link(delay=2.0), seconds=10.0)
    for _ in range(3):
        first.send(0, 51, bytes(40_000), world.now, max_retransmits=0)
    first.round_trip._probe = 0.5  # a path that has become slow
    world.run(world.now + 30.0)
    first.send(0, 51, b"next", world.now)
    world.run(world.now + 10.0)
    assert [event.payload for event in second.events() if isinstance(event, MessageReceived)][-1] == b"next"
    assert Internals(second).held == 0


def test_one_forward_tsn_passes_every_other_message() -> None:
    world, first, _ = associated()
    start, before = world.now, len(world.packets[0])
    world.links[0].lose = lambda number, packet: b"lost" in packet
    for number in range(60):
        first.send(0, 51, b"lost" if number % 2 else b"kept", world.now, ordered=False, max_retransmits=0)
        world.run(start + 0.01 * number)
    world.run(world.now + 3.0)
    assert Internals(first).is_idle
    forwards = [names for names in kinds(world.packets[0][before:]) if "InterleavedForwardTsn" in names]
    assert len(forwards) <= 35


def test_a_forward_tsn_lets_later_ordered_messages_through() -> None:
    victim = Victim()
    victim.say(Data(victim.tsn + 1, WHOLE, 0, 2, 51, b"later"))
    victim.say(ForwardTsn(victim.tsn, [Skip(0, 1)]))
    assert [getattr(event, "data", None) for event in victim.events][-1] == "later"


def test_an_old_forward_tsn_changes_nothing() -> None:
    victim = Victim()
    victim.say(Data(victim.tsn, WHOLE, 0, 1, 51, b"one"))
    victim.say(ForwardTsn(victim.tsn - 1, [Skip(0, 500)]))
    victim.say(Data(victim.tsn + 1, WHOLE, 0, 2, 51, b"two"))
    assert [getattr(event, "data", None) for event in victim.events][-2:] == ["one", "two"]


def test_holes_of_a_peer_that_gives_up_and_does_not_say_so_are_passed_after_a_while() -> None:
    victim = Victim()
    tsn = victim.tsn
    for index in range(2000):
        if index % 20:
            victim.say(Data((tsn + index) & 0xFFFFFFFF, WHOLE | UNORDERED, 0, 0, 51, b"x"))
        victim.wait(0.05)
    assert victim.end.counts["given_up_by_peer"] > 0
    assert Internals(victim.end.association).runs < 60
    assert victim.end.association.state is State.ESTABLISHED


def test_a_hole_that_an_ordered_message_waits_for_is_never_passed() -> None:
    victim = Victim()
    victim.say(Data(victim.tsn + 1, WHOLE, 0, 2, 51, b"second"))
    for index in range(2, 200):
        victim.say(Data(victim.tsn + index, WHOLE | UNORDERED, 0, 0, 51, b"x"))
        victim.wait(1.0)
    victim.say(Data(victim.tsn, WHOLE, 0, 1, 51, b"first"))
    assert [getattr(event, "data", None) for event in victim.events][-2:] == ["first", "second"]


# Stream reset


def test_streams_are_reset_after_their_last_message_and_begin_anew() -> None:
    world, first, second = associated(there=Link(loss=0.3), back=Link(loss=0.3), seconds=5.0)
    for _ in range(70_000 // 1000):
        first.send(4, 51, b"x", world.now)
    world.run(world.now + 5.0, stop=lambda: not first.has_waiting(4))
    assert first.reset_streams((4,), world.now)
    world.run(world.now + 30.0)
    events = second.events()
    assert events[-1] == StreamsReset((4,))
    assert len(events) == 71
    assert first.events() == [OutgoingStreamsReset((4,), True)]
    first.send(4, 51, b"anew", world.now)
    world.run(world.now + 5.0)
    assert second.events() == [MessageReceived(4, 51, b"anew")]


def results(packets: list[bytes]) -> list[int]:
    chunks = (chunk for packet in packets for chunk in decode_packet(packet).chunks if isinstance(chunk, Reconfig))
    return [value[7] for chunk in chunks for kind, value in chunk.parameters if kind == RECONFIG_RESPONSE]


def test_a_reset_waits_for_the_messages_before_it() -> None:
    victim = Victim()
    number = Internals(victim.end.association).peer_reset_number
    request = b"".join((value & 0xFFFFFFFF).to_bytes(4, "big") for value in (number, 0, victim.tsn)) + b"\0\0"
    assert results(victim.say(Reconfig([(OUTGOING_RESET_REQUEST, request)]))) == [6]
    assert results(victim.say(Reconfig([(OUTGOING_RESET_REQUEST, request)]))) == [6]
    assert results(victim.say(Data(victim.tsn, WHOLE, 0, 1, 51, b"last"))) == [1]
    assert results(victim.say(Reconfig([(OUTGOING_RESET_REQUEST, request)]))) == [1]
    assert [getattr(event, "data", None) for event in victim.events][-1] == "last"


@pytest.mark.parametrize(("kind", "result"), [(14, 2), (15, 2), (17, 1), (18, 2)])
def test_other_requests_are_answered_once_in_their_turn(kind: int, result: int) -> None:
    victim = Victim()
    number = (Internals(victim.end.association).peer_reset_number & 0xFFFFFFFF).to_bytes(4, "big")
    for _ in range(2):
        assert results(victim.say(Reconfig([(kind, number + bytes(4))]))) == [result]
    assert results(victim.say(Reconfig([(kind, b"\x7f" + number[1:] + bytes(4))]))) == [5]


# The end


def test_a_shutdown_waits_until_everything_has_arrived() -> None:
    world, first, second = associated(there=Link(loss=0.2), back=Link(loss=0.2), seconds=5.0)
    for _ in range(20):
        first.send(0, 51, bytes(3000), world.now)
        second.send(0, 51, bytes(3000), world.now)
    first.shutdown(world.now)
    with pytest.raises(AssociationClosed):
        first.send(0, 51, b"late", world.now)
    world.run(world.now + 60.0)
    for end, reason in ((first, "closed"), (second, "peer_closed")):
        events = end.events()
        assert events[-1] == Closed(reason)
        assert len(events) == 21
        assert end.timer() is None


def test_a_shutdown_at_both_ends_ends_both() -> None:
    world, first, second = associated()
    first.shutdown(world.now)
    second.shutdown(world.now)
    world.run(world.now + 5.0)
    assert {first.events()[-1], second.events()[-1]} <= {Closed("closed"), Closed("peer_closed")}


def test_a_lost_shutdown_complete_is_sent_again() -> None:
    world, first, second = associated()
    world.links[0].lose = lambda number, packet: packet[12] == 14 and world.now < 3.0
    first.shutdown(world.now)
    world.run(10.0)
    assert second.events()[-1] == Closed("peer_closed")


def test_an_abort_names_its_reason_at_both_ends() -> None:
    world, first, second = associated()
    first.abort(world.now, "consent_expired")
    world.run(world.now + 1.0)
    assert first.events() == [Closed("consent_expired")]
    assert second.events() == [Closed("peer_closed", "cause 12")]
    assert first.timer() is None
    assert second.timer() is None
