"""What viewers want, and who is new, from the topics that somebody is subscribed to."""

from lockstep.server.foxglove.subscriptions import Subscribers, Subscriptions

NOTHING = Subscribers(any=False, media=False, newcomer=False, media_newcomer=False)


def test_a_newcomer_is_told_once_and_what_is_wanted_as_long_as_it_is() -> None:
    subscriptions = Subscriptions()
    assert subscriptions.look(frozenset()) == NOTHING
    tf, both = frozenset({"/tf"}), frozenset({"/tf", "/camera/front"})
    assert subscriptions.look(tf) == Subscribers(any=True, media=False, newcomer=True, media_newcomer=False)
    assert subscriptions.look(both) == Subscribers(any=True, media=True, newcomer=True, media_newcomer=True)
    assert subscriptions.look(both) == Subscribers(any=True, media=True, newcomer=False, media_newcomer=False)
    assert subscriptions.look(tf) == Subscribers(any=True, media=False, newcomer=False, media_newcomer=False)
    assert subscriptions.look(frozenset()) == NOTHING
