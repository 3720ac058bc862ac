import pytest

from lockstep.emulator.impairment.outages import Outages, PlannedOutage, Silence


def test_a_schedule_begins_when_it_is_started_and_can_begin_again() -> None:
    outages = Outages((PlannedOutage(at=8, lasts=2),))
    assert not outages.started
    assert outages.at(9) is None
    outages.start(100)
    assert [outages.at(now) for now in (107.9, 108, 109.9, 110)] == [
        None,
        Silence(110, False),
        Silence(110, False),
        None,
    ]
    outages.start(200)
    assert outages.at(208) == Silence(210, False)


def test_a_repeated_outage_comes_every_time() -> None:
    outages = Outages((PlannedOutage(at=5, lasts=1, every=10, hold=True),))
    outages.start(0)
    assert [outages.at(now) for now in (4.5, 5.5, 9, 15, 25.9, 26)] == [
        None,
        Silence(6, True),
        None,
        Silence(16, True),
        Silence(26, True),
        None,
    ]


def test_one_on_demand_holds_now_and_of_several_the_longest_counts() -> None:
    outages = Outages((PlannedOutage(at=0, lasts=3),))
    outages.start(10)
    outages.demand(10, 5, hold=True)
    assert outages.at(11) == Silence(15, True)
    outages.demand(11, 1)
    assert outages.at(10.9) == Silence(13, False), "the new one is not on yet"
    assert outages.at(11.5) == Silence(13, False)
    assert outages.at(13) is None


@pytest.mark.parametrize(
    ("began", "ended", "seconds"),
    [(100.0, 114.9, 0.0), (114.0, 115.2, 0.2), (115.2, 116.0, 0.3), (110.0, 160.0, 1.5), (135.1, 135.3, 0.2)],
)
def test_the_seconds_of_planned_outages_between_two_times_are_known(began: float, ended: float, seconds: float) -> None:
    outages = Outages((PlannedOutage(at=15.0, lasts=0.5, every=20.0),))
    assert outages.planned_seconds(began, ended) == 0.0, "the schedule has not begun"
    outages.start(100.0)
    assert outages.planned_seconds(began, ended) == pytest.approx(seconds)


def test_an_outage_that_comes_once_counts_once() -> None:
    outages = Outages((PlannedOutage(at=1.0, lasts=2.0),))
    outages.start(0.0)
    assert outages.planned_seconds(0.0, 100.0) == pytest.approx(2.0)
    outages.demand(10.0, 5.0)
    assert outages.planned_seconds(10.0, 15.0) == 0.0, "it was demanded, not planned"
