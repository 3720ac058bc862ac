from lockstep.server.fleet.event_rate import Pulse


def test_without_two_looks_there_is_no_rate() -> None:
    pulse = Pulse()
    assert pulse.event_rate == 0
    pulse.look(1.0, up=True, epoch="e", event=5)
    assert pulse.event_rate == 0


def test_the_rate_is_that_of_the_last_seconds() -> None:
    pulse = Pulse()
    for second in range(10):
        pulse.look(float(second), up=True, epoch="e", event=1 + 20 * second)
    assert pulse.event_rate == 20
    for second in range(10, 20):
        pulse.look(float(second), up=True, epoch="e", event=181)
    assert pulse.event_rate == 0


def test_another_epoch_begins_anew() -> None:
    pulse = Pulse()
    pulse.look(1.0, up=True, epoch="old", event=500)
    pulse.look(2.0, up=True, epoch="new", event=1)
    assert pulse.event_rate == 0
    pulse.look(3.0, up=True, epoch="new", event=11)
    assert pulse.event_rate == 10


def test_a_link_is_as_it_is_since_it_changed() -> None:
    pulse, since = Pulse(), []
    for now, up in ((1.0, False), (2.0, True), (3.0, True), (4.0, False)):
        pulse.look(now, up=up, epoch="e", event=1)
        since.append(pulse.link_since)
    assert since == [None, 2.0, 2.0, 4.0]
