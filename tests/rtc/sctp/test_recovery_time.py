"""How soon a lone lost message is repeated, and that nothing is repeated for nothing."""

import pytest

from lockstep.rtc.sctp import Association, MessageReceived, SctpSettings
from tests.rtc.sctp.network import Link, World, associated

ROUND_TRIPS = (0.005, 0.1, 0.3, 0.6)


def lose_the_next(world: World[Association], index: int) -> None:
    """The next packet with data from this end is lost."""
    lost: list[int] = []

    def lose(number: int, packet: bytes) -> bool:
        if lost or packet[12] not in (0, 64):
            return False
        lost.append(number)
        return True

    world.links[index].lose = lose


def repeated_after(round_trip: float, settings: SctpSettings | None = None, warm_up: int = 0) -> float:
    """The seconds between the first transmission of a lone message that is lost, and its repeat."""
    link = Link(delay=round_trip / 2)
    world, first, second = associated(settings, link, Link(delay=round_trip / 2), seconds=3.0)
    for _ in range(warm_up):
        first.send(0, 51, b"before", world.now)
        world.run(world.now + 1.0)
    second.events()
    lose_the_next(world, 0)
    begun, sent = world.now, len(world.packets[0])
    first.send(0, 51, b"lone", begun)
    world.run(begun + 5.0, stop=lambda: any(isinstance(event, MessageReceived) for event in second.events()))
    leaving = [at for at, packet in world.packets[0][sent:] if packet[12] in (0, 64)]
    assert len(leaving) == 2, leaving
    return leaving[1] - leaving[0]


@pytest.mark.parametrize("warm_up", [0, 1, 20])
@pytest.mark.parametrize("round_trip", ROUND_TRIPS)
def test_a_lone_lost_message_is_repeated_within_one_and_a_half_round_trips_and_50_ms(
    round_trip: float, warm_up: int
) -> None:
    assert repeated_after(round_trip, warm_up=warm_up) <= 1.5 * round_trip + 0.05


@pytest.mark.parametrize("round_trip", ROUND_TRIPS)
def test_the_same_after_the_handshake_lost_packets(round_trip: float) -> None:
    lost = [0, 2]
    there = Link(delay=round_trip / 2, lose=lambda number, packet: number in lost)
    world, first, second = associated(None, there, Link(delay=round_trip / 2), seconds=8.0)
    for _ in range(3):
        first.send(0, 51, b"before", world.now)
        world.run(world.now + 2.0)
    second.events()
    lose_the_next(world, 0)
    begun = world.now
    first.send(0, 51, b"lone", begun)
    world.run(begun + 5.0, stop=lambda: any(isinstance(event, MessageReceived) for event in second.events()))
    assert world.now - begun <= 1.5 * round_trip + 0.05 + round_trip / 2 + 1e-6


@pytest.mark.parametrize("round_trip", ROUND_TRIPS)
def test_a_lone_lost_message_does_not_wait_for_a_flow_of_newest_wins_messages(round_trip: float) -> None:
    world, first, second = associated(None, Link(delay=round_trip / 2), Link(delay=round_trip / 2), seconds=3.0)
    target: list[int] = []

    def lose(number: int, packet: bytes) -> bool:
        is_target = not target and b"lone" in packet
        if is_target:
            target.append(number)
        return is_target

    world.links[0].lose = lose
    begun = 0.0
    for step in range(400):
        first.send(1, 51, b"state", world.now, ordered=False, max_retransmits=0)
        if step == 200:
            begun = world.now
            first.send(0, 51, b"lone", begun)
        world.run(world.now + 0.08)
    leaving = [at for at, packet in world.packets[0] if b"lone" in packet]
    assert len(leaving) == 2
    assert leaving[1] - begun <= 1.5 * round_trip + 0.05


def needless(link: Link, back: Link, interval: float, messages: int = 600) -> tuple[int, int]:
    """Repeats that the receiver had already, and messages, on a path that loses nothing."""
    world, first, second = associated(None, link, back, seconds=3.0)
    for number in range(messages):
        first.send(0, 51, number.to_bytes(4, "big"), world.now)
        first.send(1, 51, b"state", world.now, ordered=False, max_retransmits=0)
        world.run(world.now + interval)
    world.run(world.now + 5.0)
    assert first.counts["repeats"] == second.counts["duplicate"]
    return first.counts["repeats"], messages


@pytest.mark.parametrize("interval", [0.02, 0.1, 1.0])
@pytest.mark.parametrize(("round_trip", "jitter"), [(0.005, 0.02), (0.02, 0.03), (0.1, 0.04), (0.3, 0.08), (0.6, 0.15)])
def test_jitter_within_the_margin_causes_at_most_one_needless_repeat_in_five_hundred(
    round_trip: float, jitter: float, interval: float
) -> None:
    repeats, messages = needless(
        Link(delay=round_trip / 2, jitter=jitter), Link(delay=round_trip / 2, jitter=jitter), interval
    )
    assert repeats <= messages // 500


def test_needless_repeats_become_rare_where_the_jitter_is_larger_than_the_margin() -> None:
    repeats, messages = needless(Link(delay=0.01, jitter=0.2), Link(delay=0.01, jitter=0.2), 0.5)
    assert repeats <= 0.03 * messages


def test_acknowledgements_that_the_peer_delays_cause_no_repeat() -> None:
    settings = SctpSettings(acknowledgement_delay=0.2)
    world, first, second = associated(settings, seconds=3.0)
    for _ in range(100):
        first.send(1, 51, b"state", world.now, ordered=False, max_retransmits=0)
        world.run(world.now + 0.3)
    assert first.counts["abandoned"] == first.counts["repeats"] == second.counts["duplicate"] == 0
