"""Data channels between this package and aiortc."""

import asyncio
import os

import pytest
from aiortc import RTCDataChannel, RTCDataChannelParameters

from lockstep.rtc.channels import ChannelClosed, ChannelMessage, ChannelOpened, DataChannels
from lockstep.rtc.dcep import Reliability
from lockstep.rtc.sctp import Closed, Established, SctpSettings, State
from tests.rtc.sctp.aiortc_peer import AiortcPair, aiortc_pair
from tests.rtc.sctp.internals import Internals

SETTINGS = SctpSettings(max_send_message=256 * 1024, max_receive_message=256 * 1024, receive_window=512 * 1024)
KINDS = [
    Reliability(),
    Reliability(ordered=False),
    Reliability(max_retransmits=3),
    Reliability(ordered=False, max_retransmits=0),
    Reliability(lifetime=0.5),
    Reliability(ordered=False, lifetime=0.5),
]
CLIENT = pytest.mark.parametrize("client", [True, False], ids=["dtls client", "dtls server"])


def channels(*, client: bool) -> DataChannels:
    return DataChannels(SETTINGS, os.urandom, client=client)


def listen(channel: RTCDataChannel) -> list[str | bytes]:
    got: list[str | bytes] = []
    channel.on("message", got.append)
    return got


async def opened_by_us(pair: AiortcPair, reliability: Reliability) -> tuple[int, RTCDataChannel]:
    theirs: list[RTCDataChannel] = []
    pair.theirs.on("datachannel", theirs.append)
    number = pair.ours.open("ours", pair.loop.time(), protocol="p", reliability=reliability)
    pair.flush()
    await pair.until(lambda: bool(theirs) and any(isinstance(event, ChannelOpened) for event in pair.events))
    return number, theirs[0]


async def opened_by_them(pair: AiortcPair, reliability: Reliability) -> tuple[int, RTCDataChannel]:
    lifetime = reliability.lifetime
    channel = RTCDataChannel(
        pair.theirs,
        RTCDataChannelParameters(
            label="theirs",
            protocol="p",
            ordered=reliability.ordered,
            maxRetransmits=reliability.max_retransmits,
            maxPacketLifeTime=None if lifetime is None else round(lifetime * 1000),
        ),
    )
    await pair.until(lambda: channel.readyState == "open")
    event = next(event for event in pair.events if isinstance(event, ChannelOpened))
    assert event.by_peer
    assert (event.label, event.protocol, event.reliability) == ("theirs", "p", reliability)
    return event.channel, channel


@CLIENT
@pytest.mark.parametrize("by_us", [True, False])
@pytest.mark.parametrize("reliability", KINDS)
async def test_channels_of_every_kind_open_either_way_and_carry_every_kind_of_message(
    reliability: Reliability, by_us: bool, client: bool
) -> None:
    async with aiortc_pair(channels(client=client)) as pair:
        number, theirs = await (opened_by_us if by_us else opened_by_them)(pair, reliability)
        assert number % 2 == (0 if by_us is client else 1)
        assert theirs.ordered is reliability.ordered
        assert theirs.maxRetransmits == reliability.max_retransmits
        got = listen(theirs)
        said: list[str | bytes] = ["text", b"bytes", "", b"", "ünïcödé", bytes(5000)]
        for data in said:
            pair.ours.send(number, data, pair.loop.time())
            theirs.send(data)
        pair.flush()

        def ours() -> list[str | bytes]:
            return [event.data for event in pair.events if isinstance(event, ChannelMessage)]

        await pair.until(lambda: len(got) == len(ours()) == len(said))
        for arrived in (got, ours()):
            assert sorted(map(repr, arrived)) == sorted(map(repr, said))
            assert not reliability.ordered or arrived == said


@CLIENT
@pytest.mark.parametrize("loss", [0.0, 0.05])
async def test_many_and_large_messages_arrive_once_and_in_order(loss: float, client: bool) -> None:
    async with aiortc_pair(channels(client=client), loss) as pair:
        number, theirs = await opened_by_us(pair, Reliability())
        got = listen(theirs)
        said = [bytes([index % 256]) * (200_000 if index == 10 else 300) for index in range(150)]
        for data in said:
            pair.ours.send(number, data, pair.loop.time())
            theirs.send(data)
            pair.flush()
        await pair.until(lambda: len(got) == len(said))
        await pair.until(lambda: sum(isinstance(event, ChannelMessage) for event in pair.events) == len(said))
        assert got == said
        assert [event.data for event in pair.events if isinstance(event, ChannelMessage)] == said


@CLIENT
async def test_newest_wins_messages_flow_both_ways_past_losses(client: bool) -> None:
    async with aiortc_pair(channels(client=client)) as pair:
        number, theirs = await opened_by_us(pair, Reliability(ordered=False, max_retransmits=0))
        got = listen(theirs)
        pair.loss = 0.1
        for index in range(300):
            pair.ours.send(number, str(index), pair.loop.time())
            theirs.send(str(index))
            pair.flush()
            await asyncio.sleep(0)
        pair.loss = 0.0
        pair.ours.send(number, "last", pair.loop.time())
        theirs.send("last")
        pair.flush()
        await pair.until(lambda: "last" in got and ChannelMessage(number, "last") in pair.events)
        assert len(got) > 200
        await pair.until(lambda: Internals(pair.ours.association).is_idle)


@CLIENT
@pytest.mark.parametrize("by_us", [True, False])
async def test_a_channel_closes_at_both_ends_and_its_number_is_used_again(by_us: bool, client: bool) -> None:
    async with aiortc_pair(channels(client=client)) as pair:
        number, theirs = await opened_by_us(pair, Reliability())
        pair.ours.send(number, "before", pair.loop.time())
        got = listen(theirs)
        if by_us:
            pair.ours.close(number, pair.loop.time())
        else:
            theirs.close()
        pair.flush()
        await pair.until(lambda: theirs.readyState == "closed" and ChannelClosed(number) in pair.events)
        assert got == ["before"] or not by_us
        pair.events.clear()
        again, second = await opened_by_us(pair, Reliability())
        assert again == number
        got = listen(second)
        pair.ours.send(again, "once more", pair.loop.time())
        pair.flush()
        await pair.until(lambda: got == ["once more"])


@CLIENT
async def test_a_negotiated_channel_needs_no_message(client: bool) -> None:
    async with aiortc_pair(channels(client=client)) as pair:
        theirs = RTCDataChannel(pair.theirs, RTCDataChannelParameters(label="n", negotiated=True, id=7))
        pair.ours.open_negotiated(7, "n")
        await pair.until(lambda: theirs.readyState == "open" and pair.ours.association.state is State.ESTABLISHED)
        got = listen(theirs)
        pair.ours.send(7, "there", pair.loop.time())
        theirs.send("back")
        pair.flush()
        await pair.until(lambda: got == ["there"] and ChannelMessage(7, "back") in pair.events)


@CLIENT
async def test_aiortc_that_stops_ends_the_association_by_name(client: bool) -> None:
    async with aiortc_pair(channels(client=client)) as pair:
        await pair.until(lambda: any(isinstance(event, Established) for event in pair.events))
        await pair.theirs.stop()
        await pair.until(lambda: bool(pair.events) and isinstance(pair.events[-1], Closed))
        assert pair.events[-1] == Closed("peer_aborted")


@CLIENT
async def test_an_abort_ends_aiortc(client: bool) -> None:
    async with aiortc_pair(channels(client=client)) as pair:
        await pair.until(lambda: pair.theirs.state == "connected")
        pair.ours.abort(pair.loop.time())
        pair.flush()
        await pair.until(lambda: pair.theirs.state == "closed")
