"""Which addresses a console offers for media, by what it is bound to."""

import re
from typing import Any, cast

import pytest
from aiortc import RTCSessionDescription

from lockstep.protocol.messages import Ping, Pong
from tests.server.rig import TestPeer, running_rig

OWN = "127.0.0.3"  # stands for an address of this machine's network


@pytest.fixture(autouse=True)
def _own_addresses(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("lockstep.server.webrtc.media_addresses.own_addresses", lambda: [OWN])


@pytest.mark.parametrize(
    ("settings", "offered"),
    [
        ({"host": "127.0.0.1"}, {"127.0.0.1", OWN}),
        ({"host": "localhost"}, {"127.0.0.1", OWN}),
        ({"host": "127.0.0.1", "ice_hosts": ("127.0.0.1",)}, {"127.0.0.1"}),
        ({"host": "127.0.0.1", "ice_hosts": (OWN,)}, {OWN}),
        ({"host": "0.0.0.0"}, {OWN}),
    ],
    ids=["loopback", "localhost", "loopback-alone", "one-of-its-own", "everywhere"],
)
async def test_a_console_on_loopback_offers_its_own_addresses_too_unless_it_is_told_which(
    settings: dict[str, object], offered: set[str]
) -> None:
    async with running_rig(**settings) as rig:
        peer = _Listening()
        try:
            await peer.join(rig, rig.token("observer"), ("control",))
            peer.send("control", Ping(id=1))
            await peer.until(lambda each: each == Pong(id=1))
        finally:
            await peer.close()
    assert peer.offered == offered


class _Listening(TestPeer):
    """Remembers the addresses of the answer."""

    def __init__(self) -> None:
        super().__init__()
        self.offered: set[str] = set()
        self._accept = self.pc.setRemoteDescription
        cast(Any, self.pc).setRemoteDescription = self._noted

    async def _noted(self, answer: RTCSessionDescription) -> None:
        self.offered = set(re.findall(r"a=candidate:\S+ 1 udp \d+ (\S+) ", answer.sdp))
        await self._accept(answer)
