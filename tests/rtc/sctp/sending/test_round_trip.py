from lockstep.rtc.sctp.sending.round_trip import RoundTrip
from lockstep.rtc.sctp.settings import SctpSettings


def test_an_acknowledgement_that_a_clock_puts_before_its_chunk_counts_as_no_time_at_all() -> None:
    path = RoundTrip(SctpSettings())
    for number in range(20):
        path.sample(-0.004, number / 10)
    assert path.smoothed == 0.0
    assert path.reordering >= 0.0
    assert path.timeout(0) > 0.0
