from lockstep.server.fleet.event_rate import EventRateMeter


def test_without_two_looks_there_is_no_rate() -> None:
    meter = EventRateMeter()
    assert meter.event_rate == 0
    meter.look(1.0, up=True, epoch="e", event=5)
    assert meter.event_rate == 0


def test_the_rate_is_that_of_the_last_seconds() -> None:
    meter = EventRateMeter()
    for second in range(10):
        meter.look(float(second), up=True, epoch="e", event=1 + 20 * second)
    assert meter.event_rate == 20
    for second in range(10, 20):
        meter.look(float(second), up=True, epoch="e", event=181)
    assert meter.event_rate == 0


def test_another_epoch_begins_anew() -> None:
    meter = EventRateMeter()
    meter.look(1.0, up=True, epoch="old", event=500)
    meter.look(2.0, up=True, epoch="new", event=1)
    assert meter.event_rate == 0
    meter.look(3.0, up=True, epoch="new", event=11)
    assert meter.event_rate == 10


def test_a_link_is_as_it_is_since_it_changed() -> None:
    meter, since = EventRateMeter(), []
    for now, up in ((1.0, False), (2.0, True), (3.0, True), (4.0, False)):
        meter.look(now, up=up, epoch="e", event=1)
        since.append(meter.link_since)
    assert since == [None, 2.0, 2.0, 4.0]
