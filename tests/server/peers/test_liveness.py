"""When a peer is told to end, on a loop whose time is real: in hundredths of a second."""

import asyncio

from lockstep.server.peers.liveness import Liveness
from tests.waiting import PATIENCE

SOON, LATE = 0.02, 60.0  # s


async def _watched(liveness: Liveness) -> str:
    async with asyncio.timeout(PATIENCE):
        return await liveness.watch()


async def test_a_peer_that_never_connects_has_to_end() -> None:
    liveness = Liveness(SOON, LATE)
    assert await _watched(liveness) == "never connected"
    assert not liveness.connected


async def test_a_peer_that_could_speak_and_does_not_has_to_end() -> None:
    liveness = Liveness(LATE, SOON)
    liveness.connect()
    liveness.speaks = True
    assert await _watched(liveness) == "silent"


async def test_a_peer_without_a_channel_and_one_that_speaks_live_on_until_their_end() -> None:
    for speaks in (False, True):
        liveness = Liveness(LATE, SOON)
        liveness.connect()
        liveness.speaks = speaks
        async with asyncio.TaskGroup() as tasks:
            watching = tasks.create_task(_watched(liveness))
            if speaks:
                liveness.heard(asyncio.get_running_loop().time() + LATE)
            await asyncio.sleep(3 * SOON)
            assert not watching.done()
            liveness.end()
            await liveness.until_ended()
            assert await watching == ""


async def test_a_peer_that_has_ended_is_waited_for_no_longer_even_if_it_never_connected() -> None:
    liveness = Liveness(LATE, LATE)
    liveness.end()
    assert await _watched(liveness) == ""
    assert liveness.connected
