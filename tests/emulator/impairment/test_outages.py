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
