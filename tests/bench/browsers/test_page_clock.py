import random

import pytest

from lockstep.bench.browsers.page_clock import clock_between


def test_many_looks_bound_the_clock_more_narrowly_than_one() -> None:
    offset, waits = 5000.25, random.Random(1)
    looks = []
    for number in range(50):
        page = 10.0 + number / 100
        looks.append((offset + page - waits.random() * 0.002, page, offset + page + waits.random() * 0.002))
    clock = clock_between(looks)
    assert abs(clock.offset - offset) <= clock.uncertainty
    assert clock.uncertainty < 0.0005
    assert clock.monotonic(1500.0) == pytest.approx(offset + 1.5, abs=0.0005)


def test_one_look_is_uncertain_by_half_its_length() -> None:
    clock = clock_between([(100.0, 1.0, 100.5)])
    assert clock.offset == pytest.approx(99.25)
    assert clock.uncertainty == pytest.approx(0.25)
