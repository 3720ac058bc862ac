import asyncio

from lockstep.protocol.messages import LinkMessage, Ping, Pong, Stop
from lockstep.robot_bridge.conformance.heartbeat import Heartbeat


def test_pings_are_counted_and_answered_until_it_falls_silent() -> None:
    sent: list[LinkMessage] = []
    heartbeat = Heartbeat(sent.append)
    assert heartbeat.take(Ping(id=7))
    heartbeat.beats = False
    assert heartbeat.take(Ping(id=8))
    assert heartbeat.pings == 2
    assert sent == [Pong(id=7)]


async def test_it_begins_once_and_only_pongs_to_its_own_pings_are_heartbeats() -> None:
    sent: list[LinkMessage] = []
    heartbeat = Heartbeat(sent.append)
    heartbeat.begin()
    heartbeat.begin()
    assert sent == [Ping(id=1)]
    assert heartbeat.take(Pong(id=1))
    assert not heartbeat.take(Pong(id=2))
    assert not heartbeat.take(Stop())
    heartbeat.stop()
    heartbeat.stop()
    await asyncio.sleep(0)
