"""The time that a published picture gets is never later than its capture, whatever the network does."""

import random

import pytest

from lockstep.server.media.published.incoming_pictures import MAX_BURST, MOST_LAG, IncomingPictures
from lockstep.server.media.published.path_bound import PathBound
from lockstep.server.media.published.picture_assembly import MediaPacket
from lockstep.server.media.sources.capture_timeline import DRIFT

KEYFRAME = b"\x10\x00"  # VP8, in one packet; the picture's number follows
AT_PUBLISHER = 0.12  # s from capture until the quickest leaves
LATENCY = 0.15  # s, what the console was told


def packet(number: int, captured: float) -> MediaPacket:
    return MediaPacket(number % 2**16, round(captured * 90_000) % 2**32, True, KEYFRAME + number.to_bytes(4, "big"))


class Network:
    """One way takes `forth` s and the other `back`, and queues add to both."""

    def __init__(self, seed: int) -> None:
        self.chance = random.Random(seed)
        self.forth = self.back = 0.01

    def delay(self, way: float) -> float:
        return way + self.chance.expovariate(100) + (0.3 if self.chance.random() < 0.02 else 0.0)


@pytest.mark.parametrize("seed", range(20))
def test_no_picture_is_taken_for_newer_than_it_is_on_paths_that_change(seed: int) -> None:
    network = Network(seed)
    incoming = IncomingPictures("VP8", LATENCY)
    clock_ahead = network.chance.uniform(-5, 5)  # of the publisher's clock, which says nothing
    drift = network.chance.uniform(-1, 1) * DRIFT / 2
    arrivals: list[tuple[float, int, float]] = []
    checks: list[tuple[float, float]] = []
    at = 100.0
    for number in range(9000):  # ten minutes at 15 a second
        at += 1 / 15
        if network.chance.random() < 0.003:  # another network, another way for each direction
            network.forth, network.back = (network.chance.choice((0.003, 0.04, 0.15, 0.4)) for _ in range(2))
        arrivals.append((at + AT_PUBLISHER + network.delay(network.forth), number, at))
        if number % 75 == 0:
            took = network.delay(network.forth) + network.delay(network.back)
            checks.append((at + took, took))
    captured = [each for _, _, each in arrivals]
    timeline = sorted([*((when, 0, one, two) for when, one, two in arrivals), *((when, 1, 0, t) for when, t in checks)])
    placed = 0
    for when, is_check, number, value in timeline:
        if is_check:
            incoming.path.observe(value, when)
            continue
        own = (value + clock_ahead) * (1 + drift)
        for found in incoming.take(packet(number, own), when):
            if found.time is not None:
                placed += 1
                assert found.time <= captured[int.from_bytes(found.data[-4:], "big")]
    assert placed > 8000


def test_a_picture_has_no_time_before_a_round_trip_was_measured_and_the_timeline_has_settled() -> None:
    incoming = IncomingPictures("VP8", 0.1)
    times = [incoming.take(packet(n, 5 + n / 10), 100 + n / 10)[0].time for n in range(10)]
    assert times == [None] * 10
    incoming.path.observe(0.05, 101.0)
    found = incoming.take(packet(10, 6.0), 101.0)
    assert found[0].time == pytest.approx(101.0 - 0.1 - 0.05)


def test_the_shortest_round_trip_counts_and_is_forgotten_no_faster_than_clocks_may_drift() -> None:
    bound = PathBound()
    assert bound.seconds(0.0) is None
    bound.observe(0.2, 0.0)
    bound.observe(0.05, 5.0)
    bound.observe(0.4, 10.0)
    assert bound.seconds(10.0) == pytest.approx(0.05 + 5 * DRIFT)
    assert bound.newest == 0.4
    bound.observe(0.4, 10_000.0)
    assert bound.seconds(10_000.0) == pytest.approx(0.4)
    bound.observe(0.01, 10_001.0)
    assert bound.seconds(10_001.0) == pytest.approx(0.01)
    bound.observe(-1.0, 10_002.0)  # a clock that lies gives nothing away
    assert bound.seconds(10_002.0) == 0.0


def test_more_packets_than_anybody_needs_are_counted_and_cost_nothing() -> None:
    incoming = IncomingPictures("VP8", 0.1)
    made = [len(incoming.take(packet(n, n / 30), 0.0)) for n in range(int(MAX_BURST) + 500)]
    assert sum(made) == MAX_BURST
    assert incoming.flooded == 500
    assert incoming.heard_at == 0.0


def test_a_publisher_that_falls_behind_for_good_is_late() -> None:
    incoming = IncomingPictures("VP8", 0.1)
    for n in range(20):
        incoming.take(packet(n, n / 10), n / 10)
    assert not incoming.late
    incoming.take(packet(20, 2.0), 2.0 + MOST_LAG + 0.5)
    assert incoming.late
