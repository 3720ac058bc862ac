import asyncio
from contextlib import suppress

import pytest
from aiortc import RTCSessionDescription
from hypothesis import given
from hypothesis import strategies as st

from lockstep.protocol.console import Welcome
from lockstep.protocol.messages import Feedback, Ping, Pong
from lockstep.server.errors import BadSdp
from lockstep.server.peers.agreed_channels import AgreedChannel, agreed_channels
from lockstep.server.webrtc.sdp_offer import parse_offer
from tests.server.offers import offer, section
from tests.server.rig import PATIENCE, TestPeer, running_rig

CONTROL = 'a=dcmap:0 label="control";ordered=false;max-retr=0\r\n'
SESSION = 'a=dcmap:1 label="session"\r\n'
STOP = 'a=dcmap:2 label="stop"\r\n'


def _maps(lines: str) -> list[str]:
    offered = parse_offer(offer(section("0"), section("1", "application") + lines))
    return [each for found in offered.sections for each in found.channel_maps]


def test_an_offer_names_its_channels_and_how_it_keeps_them() -> None:
    assert agreed_channels(_maps(CONTROL + SESSION + STOP)) == [
        AgreedChannel(0, "control", False, 0),
        AgreedChannel(1, "session", True, None),
        AgreedChannel(2, "stop", True, None),
    ]
    assert agreed_channels(_maps("")) == []


@pytest.mark.parametrize(
    "lines",
    [
        "a=dcmap:\r\n",
        "a=dcmap:x\r\n",
        "a=dcmap:1\r\n",
        'a=dcmap:1024 label="stop"\r\n',
        'a=dcmap:-1 label="stop"\r\n',
        'a=dcmap:1 label="elsewhere"\r\n',
        "a=dcmap:1 ordered=true\r\n",
        'a=dcmap:1 label="stop";ordered=maybe\r\n',
        'a=dcmap:1 label="stop";max-retr=-1\r\n',
        'a=dcmap:1 label="stop";max-retr=65536\r\n',
        'a=dcmap:1 label="stop";max-time=5\r\n',
        'a=dcmap:1 label="stop";label="session"\r\n',
        CONTROL + CONTROL,
        STOP + STOP.replace("2", "3", 1),
        STOP + SESSION.replace("1", "2", 1),
        CONTROL + SESSION + STOP + STOP.replace("2", "4", 1),
    ],
)
def test_what_cannot_be_agreed_on_is_refused_by_name(lines: str) -> None:
    with pytest.raises(BadSdp):
        agreed_channels(_maps(lines))


@given(st.text(max_size=80))
def test_nothing_but_channels_or_a_refusal_comes_of_any_line(text: str) -> None:
    with suppress(BadSdp):
        agreed_channels([text])


class _Agreeing(TestPeer):
    """Opens its channels without saying so on them."""

    async def offer(self) -> str:
        labels = {"control": CONTROL, "session": SESSION, "stop": STOP}
        for number, label in enumerate(labels):
            lossy = label == "control"
            channel = self.pc.createDataChannel(
                label, ordered=not lossy, maxRetransmits=0 if lossy else None, negotiated=True, id=number
            )
            channel.on("message", self._hear)
            self.channels[label] = channel
        await self.pc.setLocalDescription(await self.pc.createOffer())
        return self.pc.localDescription.sdp + "".join(labels.values())


async def test_an_agreed_channel_is_told_everything_and_is_heard() -> None:
    async with running_rig() as rig:
        peer = _Agreeing()
        try:
            headers = {**rig.token("operator"), "Content-Type": "application/sdp"}
            answer = await rig.http.post("/whep", content=await peer.offer(), headers=headers)
            assert answer.status_code == 201, answer.text
            assert [line for line in answer.text.splitlines() if line.startswith("a=dcmap:")] == [
                line.strip() for line in (CONTROL, SESSION, STOP)
            ]
            await peer.pc.setRemoteDescription(RTCSessionDescription(answer.text, "answer"))
            await peer.until(lambda each: isinstance(each, Welcome))
            await peer.until(lambda each: isinstance(each, Feedback))
            peer.send("control", Ping(id=7))
            assert isinstance(await peer.until(lambda each: isinstance(each, Pong)), Pong)
            served = rig.webrtc_peers[0]
            await peer.close()
            async with asyncio.timeout(PATIENCE):
                await rig.dependencies.console.peers.all_gone()
            assert served.ended
        finally:
            await peer.close()
