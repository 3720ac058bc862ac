"""Datasets with a rate of their own: each row is one event as a whole, at its moment."""

from hypothesis import example, given
from hypothesis import strategies as st

from lockstep.server.recording.export.lerobot_sampling import LONGEST, ROUNDING, sampled

INTERVALS = st.lists(st.floats(0.001, 3.0), max_size=60)


def times_of(intervals: list[float]) -> list[float]:
    times = [100.0]
    for each in intervals:
        times.append(times[-1] + each)
    return times


def test_an_event_per_interval_gives_each_event_once() -> None:
    times = [100.0 + number * 0.04 for number in range(50)]
    assert [sample.place for sample in sampled(times, 25)] == list(range(50))


def test_faster_events_are_left_out_and_slower_ones_repeated() -> None:
    assert [sample.place for sample in sampled([0.0, 0.02, 0.04, 0.06, 0.1], 10)] == [0, 4]
    assert [sample.place for sample in sampled([0.0, 0.3], 10)] == [0, 0, 0, 1]


def test_a_pause_has_no_rows() -> None:
    found = sampled([0.0, 10.0, 10.1], 10)
    assert [sample.place for sample in found] == [0] * 11 + [1, 2]


def test_no_events_give_no_rows() -> None:
    assert sampled([], 10) == []


@given(INTERVALS, st.integers(1, 100))
@example([1.0000019268615024], 1)
@example([1.0000009], 1)
def test_every_row_is_the_newest_event_of_its_moment_and_never_an_old_one(intervals: list[float], rate: int) -> None:
    times = times_of(intervals)
    found = sampled(times, rate)
    assert found[0].place == 0
    assert found[-1].place == len(times) - 1
    moments = [times[sample.place] + sample.age for sample in found]
    for sample, moment in zip(found, moments, strict=True):
        assert 0.0 <= sample.age <= LONGEST
        # `moment` is that of the event itself where this came up to ROUNDING after the row's.
        newest, within = (
            max(place for place, time in enumerate(times) if time <= moment + more) for more in (0.0, 1.001 * ROUNDING)
        )
        assert newest <= sample.place <= within
        assert abs((moment - times[0]) * rate - round((moment - times[0]) * rate)) < 1e-3
    assert all(later > earlier for earlier, later in zip(moments, moments[1:], strict=False))
