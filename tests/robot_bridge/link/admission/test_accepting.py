import asyncio
import os
import socket

from lockstep.robot_bridge.link.admission.accepting import accepted
from tests.waiting import PATIENCE


async def test_a_connection_that_comes_as_its_taker_is_cancelled_waits_for_the_next_one() -> None:
    loop = asyncio.get_running_loop()
    with socket.create_server(("127.0.0.1", 0)) as listener:
        listener.setblocking(False)
        taking = asyncio.create_task(accepted(listener))
        await asyncio.sleep(0)  # it waits
        same = os.dup(listener.fileno())  # so that both are told of the connection in one turn of the loop
        loop.add_reader(same, taking.cancel)
        with socket.create_connection(listener.getsockname()) as client:
            async with asyncio.timeout(PATIENCE):
                await asyncio.wait([taking])
            loop.remove_reader(same)
            os.close(same)
            assert taking.cancelled()
            connection, address = await accepted(listener)
            connection.close()
            assert address == client.getsockname()
