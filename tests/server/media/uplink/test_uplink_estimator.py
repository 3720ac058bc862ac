"""What a robot's uplink carries, told from the ages of its media, on simulated paths."""

from collections.abc import Callable
from dataclasses import dataclass, field

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.server.media.uplink.uplink_estimator import HEADER, UplinkEstimator

PICTURE = 1 / 30  # s


@dataclass
class Run:
    uplink: UplinkEstimator
    waits: list[float] = field(default_factory=list)  # s, of each picture that was sent
    rates: list[float] = field(default_factory=list)
    left_out: int = 0  # pictures that the bridge did not encode


def run(
    capacity: Callable[[float], float],
    seconds: float,
    *,
    offset: float = 0.0,
    room: float = 0.25,
    demand: float = 10_000_000,
    other: float = 0.0,
) -> Run:
    """A path of `capacity` bit/s behind a queue of `room` s, in front of which the bridge leaves pictures out.

    `offset`: of the robot's clock. `other`: bit/s of feedback and sound on the same path.
    """
    found = Run(UplinkEstimator(300_000, 80_000, 1_600_000))
    queue, decided = 0.0, 0.0
    for number in range(round(seconds / PICTURE)):
        now = number * PICTURE
        carried = capacity(now)
        queue = max(0.0, queue - (carried - other) * PICTURE)
        wait = queue / carried
        if wait > room:
            found.left_out += 1
        else:
            bits = min(found.uplink.rate, demand) * PICTURE
            queue += bits
            wait += bits / carried
            found.waits.append(wait)
            found.uplink.arrived(now + offset, now + 0.05 + wait, round(bits / 8))
        while decided < now:
            decided += 0.1
            found.uplink.decide(now)
        found.rates.append(found.uplink.rate)
    return found


@pytest.mark.parametrize("offset", [0.0, 50_000.0, -50_000.0])
@pytest.mark.parametrize("carried", [300_000.0, 512_000.0, 1_000_000.0])
def test_a_narrow_uplink_is_used_and_keeps_no_queue(carried: float, offset: float) -> None:
    found = run(lambda now: carried, 60, offset=offset)
    later = found.rates[600:]
    assert 0.6 * carried < sum(later) / len(later) < carried
    waits = sorted(found.waits[len(found.waits) // 3 :])
    assert waits[len(waits) // 2] < 0.1
    assert waits[len(waits) * 95 // 100] < 0.3


def test_feedback_and_sound_on_the_same_path_get_their_part() -> None:
    found = run(lambda now: 512_000, 60, other=180_000)
    later = found.rates[600:]
    assert sum(later) / len(later) < 340_000
    assert found.left_out < 0.05 * len(found.rates)


def test_a_path_that_shows_no_limit_gets_all_within_seconds() -> None:
    found = run(lambda now: 20_000_000, 10)
    assert found.rates[-1] == 1_600_000
    assert not found.uplink.limited(10.0)


def test_a_path_that_becomes_narrow_is_followed_down_and_up_again() -> None:
    found = run(lambda now: 300_000 if 20 <= now < 40 else 1_500_000, 90)
    assert sum(found.rates[25 * 30 : 40 * 30]) / (15 * 30) < 320_000
    assert found.rates[-1] > 800_000


def test_pictures_with_little_in_them_leave_the_rate_as_it_is() -> None:
    found = run(lambda now: 20_000_000, 30, demand=50_000)
    assert found.rates[-1] == 300_000


def test_an_outage_ends_with_a_rate_that_is_found_again() -> None:
    """TCP delivers what was under way all at once afterwards."""
    uplink = UplinkEstimator(800_000, 80_000, 800_000)
    for number in range(300):
        now = number * PICTURE
        held = 5.0 <= now < 7.0
        if held and now > 5.2:
            continue  # the bridge leaves out what the link does not take
        uplink.arrived(now, max(now, 7.0) + 0.05 if held else now + 0.05, 3000)
        uplink.decide(max(now, 7.0) if held else now)
    assert uplink.rate >= 400_000


def test_nothing_is_decided_before_two_media_came() -> None:
    uplink = UplinkEstimator(300_000, 80_000, 800_000)
    for now in (0.0, 1.0, 5.0):
        uplink.decide(now)
    uplink.arrived(1e8, 5.0, 5000)
    uplink.decide(5.1)
    assert uplink.rate == 300_000
    assert uplink.waits(5.1) is None


@given(
    st.lists(
        st.tuples(
            st.floats(0, 1e9, allow_nan=False),
            st.floats(0, 2, allow_nan=False),
            st.integers(0, 16_000_000),
            st.booleans(),
        ),
        max_size=200,
    )
)
def test_whatever_a_robot_sends_the_rate_stays_between_its_bounds(
    media: list[tuple[float, float, int, bool]],
) -> None:
    uplink, now = UplinkEstimator(300_000, 80_000, 800_000), 0.0
    for captured, passed, size, decides in media:
        now += passed
        uplink.arrived(captured, now, size)
        if decides:
            uplink.decide(now)
        assert 80_000 <= uplink.rate <= 800_000


def feed(uplink: UplinkEstimator, since: float, seconds: float, bps: float, *, wait: float = 0.0) -> float:
    """Let so many bits arrive for `seconds`; return the time afterwards."""
    count = round(seconds / PICTURE)
    for number in range(count):
        now = since + number * PICTURE
        uplink.arrived(now - wait, now + 0.05, round(bps * PICTURE / 8) - HEADER)
        uplink.decide(now + 0.05)
    return since + count * PICTURE


def test_it_knows_for_a_minute_what_came_without_a_queue() -> None:
    uplink = UplinkEstimator(300_000, 80_000, 1_600_000)
    now = feed(uplink, 0.0, 5.0, 900_000)
    assert 850_000 < uplink.shown(now) < 950_000
    later = feed(uplink, now, 50.0, 200_000)
    assert uplink.shown(later) > 850_000
    later = feed(uplink, later, 15.0, 200_000)
    assert 190_000 < uplink.shown(later) < 210_000


def test_a_limit_makes_it_forget_what_was_carried_before() -> None:
    uplink = UplinkEstimator(300_000, 80_000, 1_600_000)
    now = feed(uplink, 0.0, 5.0, 900_000)
    now = feed(uplink, now, 2.0, 900_000, wait=0.3)
    assert uplink.limited(now)
    assert uplink.shown(now) == 0


def test_a_burst_shows_nothing() -> None:
    uplink = UplinkEstimator(300_000, 80_000, 1_600_000)
    feed(uplink, 0.0, 0.5, 5_000_000)
    assert uplink.shown(0.5) == 0


def test_a_queue_that_comes_and_goes_shows_in_the_operators_pictures_and_not_in_the_least_wait() -> None:
    uplink = UplinkEstimator(300_000, 80_000, 1_600_000)
    for number in range(90):
        now, wait = number * PICTURE, 0.0 if number % 10 < 3 else 0.08
        uplink.arrived(now, now + 0.05 + wait, 3000, "main")
        uplink.arrived(now, now + 0.05 + wait, 3000)
    assert uplink.waits(now) == pytest.approx(0.0)
    assert uplink.pictures_wait(now) == pytest.approx(0.08)


def test_what_a_cameras_own_encoder_takes_is_no_wait_and_no_medium_but_the_operators_pictures_counts() -> None:
    uplink = UplinkEstimator(300_000, 80_000, 1_600_000)
    for number in range(60):
        now = number * PICTURE
        uplink.arrived(now, now + 0.03, 3000, "main")
        uplink.arrived(now, now + 0.09, 3000, "slow")
        uplink.arrived(now, now + 0.2, 3000)
    assert uplink.pictures_wait(now) == pytest.approx(0.0)
    assert uplink.pictures_wait(now + 2.0) is None
