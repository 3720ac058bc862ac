"""How long media waited, told from the one that waited least."""

import pytest

from lockstep.server.media.uplink.least_age import BASE_SECONDS, LeastAge


@pytest.mark.parametrize("offset", [0.0, 50_000.0, -50_000.0])
def test_a_medium_waited_for_what_it_is_older_than_the_youngest_whatever_the_clocks_say(offset: float) -> None:
    base = LeastAge()
    assert [base.wait(offset + age, 0.0) for age in (0.05, 0.15, 0.04, 0.05)] == pytest.approx([0.0, 0.1, 0.0, 0.01])


def test_a_path_that_became_longer_counts_as_the_paths_own_delay_when_two_windows_have_gone() -> None:
    base = LeastAge()
    base.wait(0.05, 0.0)
    assert base.wait(0.15, BASE_SECONDS + 1) == pytest.approx(0.1)
    assert base.wait(0.15, 2 * BASE_SECONDS + 2) == pytest.approx(0.0)
