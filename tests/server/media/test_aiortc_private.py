"""Pins what aiortc_private.py relies on. When one fails after an upgrade, that file is where to look."""

import inspect
from typing import Any, cast

import aioice.ice
import aiortc
import pytest
from aiortc import RTCPeerConnection, RTCRtpSender, RTCSessionDescription
from aiortc.rtcdtlstransport import RTCDtlsTransport, State
from aiortc.rtcpeerconnection import create_media_description_for_transceiver

from server.media.aiortc_private import (
    create_peer_connection,
    offered_direction,
    offered_extensions,
    restrict_ice_hosts,
)
from server.media.codec_choice_private import keep_codec
from server.media.receive_guard_private import guard_transports
from tests.server.media.viewer import running_plane, sender_of, viewing

MOVED = "aiortc moved a private part: see server/media/aiortc_private.py"


def test_the_pinned_version_is_installed() -> None:
    assert aiortc.__version__.startswith("1.16."), MOVED


def test_the_answer_is_built_from_the_senders_private_attributes() -> None:
    source = inspect.getsource(create_media_description_for_transceiver)
    for name in ("sender._stream_id", "sender._track_id", "sender._ssrc", "sender._rtx_ssrc", "_codecs"):
        assert name in source, MOVED
    assert "_headerExtensions" in source, MOVED


def test_the_peer_connection_uses_the_sender_as_expected() -> None:
    source = inspect.getsource(RTCPeerConnection)
    assert "await transceiver.sender.send(self.__localRtp(transceiver))" in source, MOVED
    assert "_offerDirection" in source, MOVED


def test_rtcp_reaches_senders_by_their_ssrc() -> None:
    source = inspect.getsource(RTCDtlsTransport)
    assert "_rtp_router.register_sender(sender, ssrc=sender._ssrc)" in source, MOVED
    assert "await recipient._handle_rtcp_packet(packet)" in source, MOVED
    assert inspect.iscoroutinefunction(RTCRtpSender._handle_rtcp_packet), MOVED


def test_datagrams_pass_the_methods_that_are_guarded() -> None:
    assert "await self._recv_next()" in inspect.getsource(RTCDtlsTransport), MOVED
    source = inspect.getsource(aioice.ice.Connection)
    assert "self._queue.put_nowait((data, component))" in source, MOVED
    assert "self._queue.put_nowait(None)" in source, MOVED


async def test_a_connected_transport_has_the_parts_that_are_used() -> None:
    async with running_plane() as plane, viewing(plane, ["video"]) as viewer:
        transceiver = viewer.server.getTransceivers()[0]
        dtls: Any = transceiver.receiver.transport
        assert dtls._state is State.CONNECTED, MOVED
        assert callable(dtls._tx_srtp.protect), MOVED
        assert callable(dtls._tx_srtp.protect_rtcp), MOVED
        pair = dtls.transport._connection._nominated[1]
        assert callable(pair.protocol.transport.sendto), MOVED
        assert pair.remote_addr[0] == "127.0.0.1"
        assert transceiver.sender is sender_of(viewer), MOVED
        assert cast(Any, transceiver.receiver)._RTCRtpReceiver__rtcp_ssrc == transceiver.sender._ssrc, MOVED


@pytest.mark.parametrize("hosts", [["127.0.0.1"], ["127.0.0.1", "::1"]])
async def test_ice_gathers_exactly_the_configured_addresses(hosts: list[str]) -> None:
    restrict_ice_hosts(hosts)
    pc = create_peer_connection()
    try:
        pc.createDataChannel("any")
        await pc.setLocalDescription(await pc.createOffer())
        candidates = [line.split() for line in pc.localDescription.sdp.splitlines() if line.startswith("a=candidate")]
        assert sorted(c[4] for c in candidates) == sorted(hosts)
        assert {c[7] for c in candidates} == {"host"}
    finally:
        await pc.close()


def test_host_addresses_respect_the_address_family() -> None:
    restrict_ice_hosts(["10.0.0.1", "fe80::1"])
    assert aioice.ice.get_host_addresses(use_ipv4=True, use_ipv6=False) == ["10.0.0.1"]
    assert aioice.ice.get_host_addresses(use_ipv4=False, use_ipv6=True) == ["fe80::1"]


async def test_no_stun_server_is_ever_configured() -> None:
    pc: Any = create_peer_connection()
    pc.createDataChannel("any")
    connection = pc.sctp.transport.transport._connection
    assert connection.stun_server is None
    assert connection.turn_server is None
    await pc.close()


async def test_an_offer_is_read() -> None:
    client, server = RTCPeerConnection(), create_peer_connection()
    try:
        client.addTransceiver("video", direction="recvonly")
        client.createDataChannel("any")
        await client.setLocalDescription(await client.createOffer())
        offer = client.localDescription.sdp
        extensions = offered_extensions(offer)
        assert extensions["0"]["urn:ietf:params:rtp-hdrext:sdes:mid"] == 1
        await server.setRemoteDescription(RTCSessionDescription(offer, "offer"))
        transceiver = server.getTransceivers()[0]
        assert offered_direction(transceiver) == "sendonly", MOVED
        assert keep_codec(transceiver, ["opus"]) is None
        assert keep_codec(transceiver, ["H264", "VP8"]) == "VP8"
        assert [codec.name for codec in transceiver._codecs] == ["VP8", "rtx"], MOVED
        guard_transports(server, lambda kind: None)
        guarded = cast(Any, transceiver.receiver.transport)._recv_next
        guard_transports(server, lambda kind: None)
        assert cast(Any, transceiver.receiver.transport)._recv_next is guarded
    finally:
        await server.close()
        await client.close()
