"""Data channels over two associations and a virtual clock."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.rtc.channels import (
    ChannelClosed,
    ChannelEvent,
    ChannelMessage,
    ChannelNotOpen,
    ChannelOpened,
    ChannelWritable,
    DataChannels,
    TooManyChannels,
)
from lockstep.rtc.dcep import MOST_TEXT, DcepError, Open, Reliability, decode_open
from lockstep.rtc.sctp import AssociationClosed, Closed, Established, SctpSettings, SendQueueFull, State
from lockstep.rtc.sctp.wire.chunks import BEGIN, END, UNORDERED, CookieEcho, Data, Init, InitAck
from lockstep.rtc.sctp.wire.packet import decode_packet
from lockstep.rtc.sctp.wire.parameters import STATE_COOKIE
from tests.rtc.sctp.hostile import Victim
from tests.rtc.sctp.internals import Internals
from tests.rtc.sctp.network import Link, World, seeded

NEWEST_WINS = Reliability(ordered=False, max_retransmits=0)
WHOLE = BEGIN | END


def world(settings: SctpSettings | None = None, link: Link | None = None) -> World[DataChannels]:
    """The client first."""
    settings = settings or SctpSettings()
    client = DataChannels(settings, seeded(1), client=True)
    server = DataChannels(settings, seeded(2), client=False)
    link = link or Link()
    made = World(client, server, link, Link(link.delay, link.jitter, link.loss))
    client.association.start(0.0)
    server.association.start(0.0)
    return made


def data(events: list[ChannelEvent]) -> list[str | bytes]:
    return [event.data for event in events if isinstance(event, ChannelMessage)]


def test_the_client_opens_even_channels_and_the_server_odd_ones() -> None:
    both = world()
    client, server = both.ends
    assert [client.open("a", 0.0), client.open("b", 0.0)] == [0, 2]
    assert [server.open("c", 0.0), server.open("d", 0.0)] == [1, 3]
    both.run(1.0)
    for end in both.ends:
        opened = {event.label: event.channel for event in end.events() if isinstance(event, ChannelOpened)}
        assert opened == {"a": 0, "b": 2, "c": 1, "d": 3}


@pytest.mark.parametrize(
    "reliability",
    [
        Reliability(),
        Reliability(ordered=False),
        Reliability(max_retransmits=65535),
        NEWEST_WINS,
        Reliability(lifetime=0.25),
        Reliability(ordered=False, lifetime=65.535),
    ],
)
def test_label_protocol_and_reliability_reach_the_peer(reliability: Reliability) -> None:
    both = world()
    both.ends[0].open("Größe", 0.0, protocol="json", reliability=reliability)
    both.run(1.0)
    assert ChannelOpened(0, "Größe", "json", reliability, True) in both.ends[1].events()
    assert ChannelOpened(0, "Größe", "json", reliability, False) in both.ends[0].events()


def test_text_bytes_and_empty_messages_arrive_as_they_were() -> None:
    both = world()
    channel = both.ends[0].open("a", 0.0)
    said: list[str | bytes] = ["text", b"bytes", "", b"", "ü", bytes(16_384)]
    for each in said:
        both.ends[0].send(channel, each, 0.0)
    both.run(3.0)
    assert data(both.ends[1].events()) == said


def test_messages_of_a_newest_wins_channel_follow_its_opening_even_when_that_was_lost() -> None:
    both = world()
    both.run(1.0)
    for end in both.ends:
        end.events()
    both.links[0].lose = lambda number, packet: b"state" in packet and both.now < 1.05
    channel = both.ends[0].open("state", both.now, reliability=NEWEST_WINS)
    for number in range(20):
        both.ends[0].send(channel, str(number), both.now)
        both.run(both.now + 0.02)
    both.run(both.now + 1.0)
    events = both.ends[1].events()
    assert isinstance(events[0], ChannelOpened)
    assert data(events)[-1] == "19"
    assert both.ends[1].counts["no_channel"] == 0


def test_an_answer_that_was_overtaken_by_a_message_opens_the_channel() -> None:
    both = world(SctpSettings(), Link(delay=0.05))
    both.run(1.0)
    both.ends[0].events()
    channel = both.ends[0].open("a", both.now, reliability=Reliability(ordered=False))
    both.run(both.now + 0.06)
    both.links[1].lose = lambda number, packet: packet[-4:-3] == b"\x02"  # the answer
    both.ends[1].send(channel, "overtakes", both.now)
    both.run(both.now + 0.06)
    opened, message = both.ends[0].events()
    assert isinstance(opened, ChannelOpened)
    assert message == ChannelMessage(channel, "overtakes")


def test_negotiated_channels_are_open_when_the_association_is() -> None:
    both = world()
    for end in both.ends:
        end.open_negotiated(9, "n", reliability=NEWEST_WINS)
    both.ends[0].send(9, "at once", 0.0)
    both.run(1.0)
    events = both.ends[1].events()
    assert events == [
        Established(1024, True),
        ChannelOpened(9, "n", "", NEWEST_WINS, False),
        ChannelMessage(9, "at once"),
    ]
    both.ends[0].open_negotiated(11)
    assert both.ends[0].events()[-1] == ChannelOpened(11, "", "", Reliability(), False)
    with pytest.raises(ValueError, match="taken"):
        both.ends[0].open_negotiated(9)
    with pytest.raises(ValueError, match="out of range"):
        both.ends[0].open_negotiated(1024)


@pytest.mark.parametrize("closer", [0, 1])
@pytest.mark.parametrize("loss", [0.0, 0.3])
def test_a_closed_channel_delivers_what_was_sent_and_its_number_is_free_again(closer: int, loss: float) -> None:
    both = world(link=Link(loss=loss))
    channel = both.ends[0].open("a", 0.0)
    both.run(10.0)
    for number in range(20):
        both.ends[closer].send(channel, str(number), both.now)
    both.ends[closer].close(channel, both.now)
    with pytest.raises(ChannelNotOpen):
        both.ends[closer].send(channel, "late", both.now)
    both.run(both.now + 30.0)
    for index, end in enumerate(both.ends):
        events = end.events()
        assert events[-1] == ChannelClosed(channel)
        assert data(events) == ([] if index == closer else [str(number) for number in range(20)])
    assert both.ends[0].open("b", both.now) == channel
    both.ends[0].send(channel, "anew", both.now)
    both.run(both.now + 10.0)
    assert data(both.ends[1].events()) == ["anew"]


def test_both_ends_may_close_at_once() -> None:
    both = world()
    channel = both.ends[0].open("a", 0.0)
    both.run(1.0)
    for end in both.ends:
        end.close(channel, both.now)
        end.close(channel, both.now)
        end.close(77, both.now)
    both.run(3.0)
    assert [end.events()[-1] for end in both.ends] == [ChannelClosed(channel)] * 2


def test_the_end_of_the_association_closes_every_channel_first() -> None:
    both = world()
    channel = both.ends[0].open("a", 0.0)
    both.run(1.0)
    both.ends[1].abort(both.now, "owner_left")
    both.run(2.0)
    assert both.ends[0].events()[-2:] == [ChannelClosed(channel), Closed("peer_closed", "cause 12")]
    assert both.ends[1].events()[-2:] == [ChannelClosed(channel), Closed("owner_left")]
    with pytest.raises(ChannelNotOpen):
        both.ends[0].send(channel, "x", both.now)
    with pytest.raises(AssociationClosed):
        both.ends[0].open("b", both.now)


def test_a_shutdown_delivers_everything() -> None:
    both = world()
    channel = both.ends[0].open("a", 0.0)
    both.ends[0].send(channel, "x" * 10_000, 0.0)
    both.run(1.0)
    both.ends[0].send(channel, "last", both.now)
    both.ends[0].association.shutdown(both.now)
    both.run(5.0)
    events = both.ends[1].events()
    assert data(events)[-1] == "last"
    assert events[-1] == Closed("peer_closed")


def test_a_full_channel_says_so_and_when_it_has_room() -> None:
    both = world(SctpSettings(send_queue=20_000))
    channel = both.ends[0].open("a", 0.0)
    both.run(1.0)
    both.links[0].cuts.append((1.0, 2.0))
    both.ends[0].send(channel, bytes(16_000), both.now)
    both.run(1.01)
    both.ends[0].send(channel, bytes(16_000), both.now)
    with pytest.raises(SendQueueFull):
        both.ends[0].send(channel, bytes(16_000), both.now)
    assert both.ends[0].association.buffered(channel) > 10_000
    both.run(10.0)
    assert ChannelWritable(channel) in both.ends[0].events()
    assert [len(each) for each in data(both.ends[1].events())] == [16_000] * 2


def test_channels_are_bounded_in_number() -> None:
    both = world()
    for _ in range(64):
        both.ends[0].open("a", 0.0)
    with pytest.raises(TooManyChannels):
        both.ends[0].open("a", 0.0)
    with pytest.raises(TooManyChannels):
        both.ends[0].open_negotiated(999)


def test_a_peer_that_cannot_reset_streams_does_not_keep_a_channel_from_closing() -> None:
    victim = Victim(established=False)
    answers = [decode_packet(packet).chunks[0] for packet in victim.say(Init(77, 9000, 10, 10, 5))]
    (answer,) = [chunk for chunk in answers if isinstance(chunk, InitAck)]
    victim.say(CookieEcho(dict(answer.parameters)[STATE_COOKIE]))
    channel = victim.end.open("a", victim.now)
    victim.end.close(channel, victim.now)
    victim.wait(0.0)
    assert victim.events == [Established(10, False), ChannelClosed(channel)]


# A peer that does what it should not


@pytest.mark.parametrize(
    ("stream", "payload", "count"),
    [
        (2, b"\x03short", "dcep_malformed"),
        (2, b"\x07" + bytes(11), "dcep_malformed"),
        (2, Open("a").encode()[:1] + b"\x03" + Open("a").encode()[2:], "dcep_malformed"),
        (2, Open("a").encode() + b"more", "dcep_malformed"),
        (2, Open("aa").encode()[:-2] + b"\xff\xfe", "dcep_malformed"),
        (3, Open("a").encode(), "channel_parity"),
        (0, Open("a").encode(), "channel_exists"),
    ],
)
def test_an_opening_that_is_wrong_is_counted_and_its_stream_reset(stream: int, payload: bytes, count: str) -> None:
    victim = Victim()
    victim.say(Data(victim.tsn, WHOLE | UNORDERED, stream, 0, 50, payload))
    assert victim.end.counts[count] == 1
    assert Internals(victim.end.association).asks_for_reset
    assert victim.end.association.state is State.ESTABLISHED


def test_a_peer_opens_no_more_than_the_bound() -> None:
    victim = Victim()
    for index in range(100):
        chunk = Data(victim.tsn + index, WHOLE, 2 + 2 * index, 0, 50, Open("a").encode())
        victim.say(chunk)
    assert victim.end.counts["too_many_channels"] == 100 - 62


@pytest.mark.parametrize(
    ("stream", "ppid", "payload", "count"),
    [(9, 51, b"x", "no_channel"), (0, 51, b"\xff", "not_utf8"), (0, 60, b"x", "unknown_ppid")],
)
def test_messages_that_are_wrong_are_counted(stream: int, ppid: int, payload: bytes, count: str) -> None:
    victim = Victim()
    victim.say(Data(victim.tsn, WHOLE | UNORDERED, stream, 0, ppid, payload))
    assert victim.end.counts[count] == 1
    assert not data(victim.events)


# The codec

RELIABILITY = st.one_of(
    st.builds(Reliability, st.booleans()),
    st.builds(Reliability, st.booleans(), st.integers(0, 65535)),
    st.builds(lambda ordered, ms: Reliability(ordered, None, ms / 1000), st.booleans(), st.integers(0, 65535)),
)


@given(st.builds(Open, st.text(max_size=200), st.text(max_size=200), RELIABILITY))
def test_an_open_is_read_as_it_was_written(message: Open) -> None:
    assert decode_open(message.encode()) == message


@given(st.binary(max_size=40))
def test_any_bytes_are_an_open_or_a_named_error(payload: bytes) -> None:
    try:
        message = decode_open(payload)
    except DcepError:
        return
    assert decode_open(message.encode()) == message


def test_limits_are_checked_where_they_are_given() -> None:
    with pytest.raises(ValueError, match="1024"):
        Open("x" * (MOST_TEXT + 1)).encode()
    for wrong in ({"max_retransmits": 1, "lifetime": 1.0}, {"max_retransmits": -1}, {"lifetime": 66.0}):
        with pytest.raises(ValueError, match=r"max_retransmits|lifetime|limit"):
            Reliability(**wrong)


def test_the_owner_is_told_once_when_nothing_waits_on_a_channel_any_more() -> None:
    both = world(SctpSettings(initial_window=1, window_floor=1))
    channel = both.ends[0].open("a", 0.0)
    both.run(1.0)
    both.ends[0].events()
    assert not both.ends[0].association.has_waiting(channel)
    both.ends[0].send(channel, "x" * 10_000, both.now)
    both.ends[0].packets_to_send()
    assert both.ends[0].association.has_waiting(channel)
    both.ends[0].tell_when_empty(channel)
    both.run(both.now + 5.0)
    assert [each for each in both.ends[0].events() if isinstance(each, ChannelWritable)] == [ChannelWritable(channel)]
    assert not both.ends[0].association.has_waiting(channel)


def test_why_the_association_has_ended_is_known_before_its_channels_close() -> None:
    both = world()
    both.ends[0].open("a", 0.0)
    both.run(1.0)
    assert both.ends[1].closed is None
    both.ends[0].abort(both.now, "done")
    both.run(both.now + 1.0)
    assert both.ends[0].closed == Closed("done")
    assert both.ends[1].closed == Closed("peer_closed", "cause 12")
