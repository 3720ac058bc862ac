import asyncio

import pytest

from robot_bridge.link_acceptor import LinkAcceptor, listening_socket


async def test_a_closing_that_is_cancelled_leaves_no_socket_open(monkeypatch: pytest.MonkeyPatch) -> None:
    listener = listening_socket("127.0.0.1", 0)
    acceptor = LinkAcceptor(listener, None, asyncio.Protocol, lambda: None, max_handshakes=1)
    acceptor.start()
    closing = asyncio.create_task(acceptor.close())
    await asyncio.sleep(0)  # it waits for the task that accepts
    closing.cancel()
    with pytest.raises(asyncio.CancelledError):
        await closing
    assert listener.fileno() == -1
