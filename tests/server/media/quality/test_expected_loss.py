from hypothesis import given, settings
from hypothesis import strategies as st

from lockstep.server.media.quality.expected_loss import PATIENCE, STEPS, ExpectedLoss


def test_more_loss_is_expected_at_once() -> None:
    expected = ExpectedLoss(10)
    assert expected.update(0.01, 0.0) == 10
    assert expected.update(0.12, 1.0) == 20
    assert expected.update(0.9, 2.0) == 30


def test_less_loss_is_expected_a_step_at_a_time() -> None:
    expected = ExpectedLoss(10)
    expected.update(0.3, 0.0)
    assert expected.update(0.0, PATIENCE - 1) == 30
    assert expected.update(0.0, PATIENCE) == 20
    assert expected.update(0.0, PATIENCE + 1) == 20
    assert expected.update(0.0, 2 * PATIENCE) == 10
    assert expected.update(0.0, 3 * PATIENCE) == 5
    assert expected.update(0.0, 9 * PATIENCE) == 5


@settings(deadline=None)
@given(st.lists(st.tuples(st.floats(0, 1), st.floats(0, 100)), max_size=50))
def test_it_is_always_one_of_the_steps(reports: list[tuple[float, float]]) -> None:
    expected, now = ExpectedLoss(10), 0.0
    for loss, passed in reports:
        now += passed
        assert expected.update(loss, now) in STEPS
        assert expected.percent >= min(30, 100 * loss) or expected.percent == 30
