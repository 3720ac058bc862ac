"""What viewers want, told to the loop once between two looks."""

from lockstep.server.foxglove.subscriptions import Subscribers, Subscriptions

NOTHING = Subscribers(any=False, media=False, newcomer=False, media_newcomer=False)


class Woken:
    def __init__(self) -> None:
        self.times = 0

    def __call__(self) -> None:
        self.times += 1


def test_a_newcomer_is_told_once_and_what_is_wanted_as_long_as_it_is() -> None:
    subscriptions = Subscriptions(Woken())
    assert subscriptions.look() == NOTHING
    subscriptions.change("/tf", 1)
    assert subscriptions.look() == Subscribers(any=True, media=False, newcomer=True, media_newcomer=False)
    subscriptions.change("/camera/front", 1)
    assert subscriptions.look() == Subscribers(any=True, media=True, newcomer=True, media_newcomer=True)
    assert subscriptions.look() == Subscribers(any=True, media=True, newcomer=False, media_newcomer=False)
    subscriptions.change("/camera/front", -1)
    assert subscriptions.look() == Subscribers(any=True, media=False, newcomer=False, media_newcomer=False)
    subscriptions.change("/tf", -1)
    assert subscriptions.look() == NOTHING


def test_two_viewers_of_one_topic_are_two() -> None:
    subscriptions = Subscriptions(Woken())
    for change in (1, 1, -1):
        subscriptions.change("/microphone/ear", change)
    assert subscriptions.look().media


def test_whoever_subscribes_without_end_wakes_the_loop_once_between_two_looks() -> None:
    woken = Woken()
    subscriptions = Subscriptions(woken)
    for _ in range(1000):
        subscriptions.change("/tf", 1)
        subscriptions.change("/tf", -1)
    assert woken.times == 1
    assert subscriptions.look() == NOTHING
    subscriptions.change("/tf", 1)
    assert woken.times == 2
