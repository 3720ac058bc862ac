import asyncio

import pytest

from lockstep.protocol.messages import EventNotice, LinkMessage, Media
from lockstep.robot_bridge.link.link_inbox import MAX_INBOX, LinkInbox


def notice(event: int) -> EventNotice:
    return EventNotice(event=event, time=0.0)


def picture(stamp: int) -> Media:
    return Media(stream="a", codec="mjpeg", stamp=stamp, time=0.0, payload=b"")


def test_messages_come_in_order_and_media_last_the_newest_picture_alone() -> None:
    inbox = LinkInbox()
    for message in (picture(1), notice(1), picture(2), notice(2)):
        inbox.put(message)
    assert [inbox.pop() for _ in range(4)] == [notice(1), notice(2), picture(2), None]
    assert inbox.media_drops == {"a": 1}


def test_of_too_many_the_oldest_is_dropped_and_counted() -> None:
    inbox = LinkInbox()
    for event in range(1, MAX_INBOX + 3):
        inbox.put(notice(event))
    assert inbox.pop() == notice(3)
    assert inbox.drops == {"event": 2}


def test_a_receiver_gets_what_waits_and_then_what_comes_until_messages_are_to_wait_again() -> None:
    inbox = LinkInbox()
    got: list[LinkMessage] = []
    inbox.put(notice(1))
    inbox.hand_over(got.append)
    inbox.put(picture(1))
    inbox.keep()
    inbox.put(notice(2))
    assert got == [notice(1), picture(1)]
    assert inbox.pop() == notice(2)


def test_nothing_is_handed_over_after_the_receiver_raised() -> None:
    inbox = LinkInbox()
    got: list[LinkMessage] = []

    def take(message: LinkMessage) -> None:
        got.append(message)
        raise ValueError("enough")

    for event in (1, 2):
        inbox.put(notice(event))
    inbox.hand_over(take)
    inbox.put(notice(3))
    assert got == [notice(1)]
    assert str(inbox.failure) == "enough"
    assert [inbox.pop(), inbox.pop()] == [notice(2), notice(3)]


@pytest.mark.parametrize("cause", ["message", "wake", "failure"])
async def test_a_waiting_reader_hears_of_messages_ends_and_failures(cause: str) -> None:
    inbox = LinkInbox()

    def fail(message: LinkMessage) -> None:
        raise ValueError(message)

    if cause == "failure":
        inbox.hand_over(fail)
    waiting = asyncio.ensure_future(inbox.changed())
    await asyncio.sleep(0)
    assert not waiting.done()
    if cause == "wake":
        inbox.wake()
    else:
        inbox.put(notice(1))
    async with asyncio.timeout(5):
        await waiting
