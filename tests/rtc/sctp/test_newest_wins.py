"""Newest-wins messages wait for nothing else."""

import pytest

from lockstep.rtc.sctp import MessageReceived, SctpSettings
from lockstep.rtc.sctp.wire.chunks import Data, InterleavedData
from lockstep.rtc.sctp.wire.packet import decode_packet
from tests.rtc.sctp.internals import Internals
from tests.rtc.sctp.network import Link, associated

BULK, STATE = 1, 2
BOTH = pytest.mark.parametrize("interleaving", [False, True])


def streams(packets: list[bytes]) -> list[int]:
    chunks = (chunk for packet in packets for chunk in decode_packet(packet).chunks)
    return [chunk.stream for chunk in chunks if isinstance(chunk, Data | InterleavedData)]


@BOTH
def test_they_leave_before_everything_that_was_queued_earlier(interleaving: bool) -> None:
    world, first, _ = associated(SctpSettings(interleaving=interleaving))
    for _ in range(10):
        first.send(BULK, 53, bytes(16_000), world.now)
    first.send(STATE, 53, b"now", world.now, ordered=False, max_retransmits=0)
    assert streams(first.packets_to_send())[0] == STATE


@BOTH
def test_they_leave_in_the_middle_of_a_message_that_fills_the_window(interleaving: bool) -> None:
    world, first, second = associated(SctpSettings(interleaving=interleaving))
    for _ in range(10):
        first.send(BULK, 53, bytes(16_000), world.now)
    assert set(streams(first.packets_to_send())) == {BULK}
    assert first.packets_to_send() == []  # the window is full
    first.send(STATE, 53, b"now", world.now, ordered=False, max_retransmits=0)
    (packet,) = first.packets_to_send()
    assert streams([packet]) == [STATE]
    second.receive_packet(packet, world.now)
    assert second.events() == [MessageReceived(STATE, 53, b"now")]


@BOTH
def test_those_due_during_bulk_and_losses_arrive_after_one_way_time(interleaving: bool) -> None:
    there, back = Link(delay=0.1, loss=0.05), Link(delay=0.1, loss=0.05)
    world, first, second = associated(SctpSettings(interleaving=interleaving), there, back)
    sent: dict[bytes, float] = {}
    late = arrived = 0
    for number in range(1000):
        if number % 10 == 0 and first.buffered(BULK) < 100_000:
            first.send(BULK, 53, bytes(16_000), world.now)
        name = str(number).encode()
        sent[name] = world.now
        first.send(STATE, 53, name + bytes(200), world.now, ordered=False, max_retransmits=0)
        world.run(world.now + 0.01)
        for event in second.events():
            if isinstance(event, MessageReceived) and event.stream == STATE:
                arrived += 1
                late += world.now - sent[event.payload[:-200]] > 0.1 + 0.0101
    assert late == 0
    assert arrived > 900


@BOTH
def test_a_constant_flow_of_them_does_not_starve_the_others(interleaving: bool) -> None:
    there, back = Link(delay=0.3, loss=0.05), Link(delay=0.3, loss=0.05)
    world, first, second = associated(SctpSettings(interleaving=interleaving), there, back, seconds=3.0)
    for number in range(1500):
        first.send(STATE, 53, bytes(900), world.now, ordered=False, max_retransmits=0)
        if number % 50 == 0:
            first.send(BULK, 53, bytes(2000), world.now)
        world.run(world.now + 0.01)
    bulk = [event for event in second.events() if isinstance(event, MessageReceived) and event.stream == BULK]
    assert len(bulk) >= 27


def test_the_floor_is_what_is_unacknowledged_at_most_when_nothing_comes_back() -> None:
    settings = SctpSettings()
    world, first, _ = associated(settings)
    world.links[1].cuts.append((world.now, world.now + 100.0))
    floor = settings.newest_wins_floor * settings.max_packet
    for _ in range(2000):
        first.send(STATE, 53, bytes(1000), world.now, ordered=False, max_retransmits=0)
        world.run(world.now + 0.005)
        assert Internals(first).newest_flight <= floor + 1000


def test_the_oldest_make_room_for_the_newest_where_none_can_leave() -> None:
    world, first, second = associated(SctpSettings(newest_wins_queue=5000))
    for number in range(100):
        first.send(STATE, 53, number.to_bytes(4, "big") + bytes(996), world.now, ordered=False, max_retransmits=0)
    assert Internals(first).dropped == 95
    world.run(world.now + 1.0)
    arrived = [event.payload[3] for event in second.events() if isinstance(event, MessageReceived)]
    assert arrived == [95, 96, 97, 98, 99]


def test_one_a_second_asks_for_the_round_trip() -> None:
    world, first, _ = associated(SctpSettings(acknowledgement_delay=0.2))
    for _ in range(600):
        first.send(STATE, 53, b"state", world.now, ordered=False, max_retransmits=0)
        world.run(world.now + 0.02)
    assert first.round_trip.smoothed == pytest.approx(0.1)
    assert world.now - first.round_trip.sampled_at < 1.2
