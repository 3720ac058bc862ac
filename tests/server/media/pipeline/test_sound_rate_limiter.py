"""The bound of how much sound may come."""

import pytest

from lockstep.server.media.pipeline.sound_rate_limiter import SoundRateLimiter
from tests.server.media.pipeline.collecting import Collector, Counted, arrive
from tests.server.media.viewer import sound


def test_two_seconds_may_come_at_once_and_then_a_quarter_more_than_time_passes() -> None:
    counted, end = Counted(), Collector()
    stage = SoundRateLimiter(end, counted.dropped)
    arrive(stage, *[sound(1, 0.0)] * 150)  # 20 ms each
    assert 99 <= len(end.sources) <= 100
    assert counted.drops("too_often") == 150 - len(end.sources)
    before = len(end.sources)
    arrive(stage, *[sound(1, 0.8)] * 150)
    assert 49 <= len(end.sources) - before <= 51


def test_sound_that_claims_an_impossible_rate_has_no_more_room() -> None:
    counted, end = Counted(), Collector()
    arrive(SoundRateLimiter(end, counted.dropped), sound(1, 0.0, payload=bytes(64_001), sample_rate=1, channels=0))
    assert end.sources == []
    assert counted.drops("too_often") == 1


@pytest.mark.parametrize(
    ("packet", "seconds"),
    [
        (b"\x1b\x02", 0.12),  # two frames of 60 ms
        (b"\x18", 0.06),
        (b"\x78", 0.02),
        (b"\xe0", 0.02),  # 2.5 ms, which cost the loop as much as 20 ms
    ],
)
def test_opus_counts_as_long_as_it_sounds(packet: bytes, seconds: float) -> None:
    counted, end = Counted(), Collector()
    arrive(SoundRateLimiter(end, counted.dropped), *[sound(1, 0.0, codec="opus", payload=packet)] * 150)
    assert 2.0 / seconds - 1 <= len(end.sources) <= 2.0 / seconds
    assert counted.drops("too_often") == 150 - len(end.sources)


def test_what_is_no_opus_packet_is_counted_and_goes_no_further() -> None:
    counted, end = Counted(), Collector()
    arrive(SoundRateLimiter(end, counted.dropped), sound(1, 0.0, codec="opus", payload=b""))
    assert end.sources == []
    assert counted.drops("bad_payload") == 1
