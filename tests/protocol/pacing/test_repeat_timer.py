from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lockstep.protocol.pacing.repeat_timer import CAP, FLOOR, RepeatTimer
from tests.client.control.vectors import load_vectors

TABLE: dict[str, Any] = load_vectors("repeat.json")


def test_the_interval_before_the_first_sample_is_that_of_the_table() -> None:
    assert RepeatTimer().interval * 1000 == TABLE["initial_ms"]
    assert RepeatTimer().round_trip is None


@pytest.mark.parametrize("case", TABLE["intervals"], ids=[case["name"] for case in TABLE["intervals"]])
def test_the_interval_follows_the_shared_table(case: dict[str, Any]) -> None:
    timer = RepeatTimer()
    for step in case["steps"]:
        timer.sample(step["sample_ms"] / 1000)
        assert timer.interval * 1000 == pytest.approx(step["interval_ms"], abs=1e-3)


@pytest.mark.parametrize("case", TABLE["backoff"], ids=[case["name"] for case in TABLE["backoff"]])
def test_the_waits_follow_the_shared_table(case: dict[str, Any]) -> None:
    timer = RepeatTimer()
    timer.sample(case["sample_ms"] / 1000)
    waits = [timer.wait(sends) * 1000 for sends in case["after_sends"]]
    assert waits == pytest.approx(case["waits_ms"])


@given(st.lists(st.floats(0, 1e6), max_size=50), st.integers(1, 10_000))
def test_every_wait_is_between_floor_and_cap(samples: list[float], sends: int) -> None:
    timer = RepeatTimer()
    for sample in samples:
        timer.sample(sample)
    assert FLOOR <= timer.wait(sends) <= CAP
