"""Where the headless client can watch."""

import msgspec
import pytest

from client.errors import ConnectFailed
from client.relay import RelayMedia, RelayTicket


async def test_a_relay_that_is_no_janus_is_refused_by_name() -> None:
    told = {"engine": "livekit", "relay": "0", "url": "wss://host", "feed": 7, "token": "a.b.c", "streams": []}
    ticket = msgspec.convert(told, RelayTicket)
    with pytest.raises(ConnectFailed, match="not through a livekit"):
        RelayMedia(ticket, lambda _: None)
