from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import settings as examples
from hypothesis import strategies as st

from lockstep.rtc.addresses import Path
from lockstep.rtc.certificate import Certificate
from lockstep.rtc.channels import ChannelClosed, ChannelMessage, ChannelOpened
from lockstep.rtc.ice.gathering import gather
from lockstep.rtc.peer import OfferedMedia, PeerNotReady, PeerSettings
from lockstep.rtc.peer_events import (
    Connected,
    MediaEvent,
    PacketReceived,
    PathFound,
    PeerEnded,
    PlainRtcp,
    PlainRtp,
    Restarted,
    RestartFailed,
)
from lockstep.rtc.rtp.stage import KeyframeRequested, Reception
from lockstep.rtc.rtp.wire.packet import RtpPacket
from lockstep.rtc.rtp.wire.rtcp import ReceiverReport, ReportBlock, pack_rtcp
from lockstep.rtc.sctp import Closed
from lockstep.rtc.sdp import MID_URI, Codec, Fragment, LocalMedia, SdpError, parse_fragment, write_fragment
from tests.rtc.peer_pair import PeerPair, through_text

STAMP = "urn:stamp"
VP8 = Codec(96, "VP8", 90_000, feedback=("nack", "nack pli"))
RTX = Codec(97, "rtx", 90_000, parameters={"apt": "96"})
OPUS = Codec(111, "opus", 48_000, 2)
CAMERA = LocalMedia((VP8, RTX), "sendonly", (MID_URI, STAMP), msid="camera track")
SCREEN = LocalMedia((VP8, RTX), "recvonly", (MID_URI, STAMP))
TALK = LocalMedia((OPUS,), "sendrecv", (MID_URI,))
SECTIONS = [OfferedMedia("camera", "video", CAMERA), OfferedMedia("talk", "audio", TALK)]


def negotiate(pair: PeerPair) -> None:
    offer = pair.peers[0].negotiation.offer(SECTIONS)
    answer = pair.peers[1].answer(through_text(offer), {"camera": SCREEN, "talk": TALK}, pair.now)
    pair.peers[0].accept(through_text(answer), pair.now)


def connected(seed: int = 1) -> PeerPair:
    pair = PeerPair(seed=seed)
    negotiate(pair)
    pair.run(2)
    for side in (0, 1):
        assert len(pair.of(side, Connected)) == 1, pair.events
    return pair


def test_both_find_a_path_and_connect() -> None:
    pair = connected()
    for side in (0, 1):
        assert isinstance(pair.events[side][0], PathFound)
        assert pair.of(side, Connected) == [Connected("SRTP_AEAD_AES_256_GCM")]


def test_messages_go_both_ways_on_channels_of_either() -> None:
    pair = connected()
    for side in (0, 1):
        channel = pair.open_channel(side, f"of {side}")
        pair.send(side, channel, "text")
        pair.send(side, channel, b"bytes")
        pair.run(1)
        [opened] = [each for each in pair.of(1 - side, ChannelOpened) if each.by_peer]  # type: ignore[union-attr]
        assert isinstance(opened, ChannelOpened)
        assert opened.label == f"of {side}"
        messages = pair.of(1 - side, ChannelMessage)
        assert messages[-2:] == [ChannelMessage(channel, "text"), ChannelMessage(channel, b"bytes")]
        pair.send(1 - side, channel, "back")
        pair.run(1)
        assert pair.of(side, ChannelMessage)[-1] == ChannelMessage(channel, "back")
        pair.peers[side].need_channels(pair.now).close(channel, pair.now)


def test_pictures_and_sound_arrive_in_their_sections_with_their_stamps() -> None:
    pair = connected()
    offerer, answerer = pair.peers
    for frame in range(30):
        stamp = {STAMP: frame.to_bytes(2, "big")}
        pair.send_frame(0, "camera", [b"a" * 1000, b"b" * 100], frame * 3000, values=stamp)
        pair.send_frame(0, "talk", [b"hello"], frame * 960, marker=False)
        pair.send_frame(1, "talk", [b"and back"], frame * 960, marker=False)
        pair.run(1 / 30)
    pair.run(1)
    got = [each for each in pair.of(1, PacketReceived) if isinstance(each, PacketReceived)]
    pictures = [each.packet for each in got if each.mid == "camera"]
    assert [len(each.payload) for each in pictures] == [1000, 100] * 30
    assert [each.values[STAMP] for each in pictures[::2]] == [frame.to_bytes(2, "big") for frame in range(30)]
    assert [each.packet.payload for each in got if each.mid == "talk"] == [b"hello"] * 30
    back = [each for each in pair.of(0, PacketReceived) if isinstance(each, PacketReceived)]
    assert [each.packet.payload for each in back] == [b"and back"] * 30
    told = [each.event for each in pair.of(0, MediaEvent) if isinstance(each, MediaEvent)]
    assert any(isinstance(each, Reception) and each.round_trip is not None for each in told)


def test_lost_pictures_are_repaired_and_a_keyframe_can_be_asked_for() -> None:
    pair = connected()
    lost = iter([False, True, False, True] * 4 + [False] * 10_000)
    pair.lost = lambda side, data: side == 0 and len(data) > 900 and next(lost)
    for frame in range(30):
        pair.send_frame(0, "camera", [b"%04d" % frame + bytes(900)], frame * 3000)
        pair.run(1 / 30)
    pair.run(1)
    got = [each.packet for each in pair.of(1, PacketReceived) if isinstance(each, PacketReceived)]
    assert sorted(each.payload[:4] for each in got) == [b"%04d" % frame for frame in range(30)]
    assert any(each.is_repair for each in got)
    pair.peers[1].media.request_keyframe("camera", pair.now)
    pair.run(1)
    told = [each.event for each in pair.of(0, MediaEvent) if isinstance(each, MediaEvent)]
    assert any(isinstance(each, KeyframeRequested) for each in told)


def test_what_was_not_negotiated_cannot_be_used() -> None:
    pair = PeerPair()
    offerer, answerer = pair.peers
    with pytest.raises(PeerNotReady):
        offerer.media.frame_to_send("camera", [b""], 0, 0)
    with pytest.raises(PeerNotReady):
        offerer.need_channels(0)
    with pytest.raises(RuntimeError, match="no offer"):
        offerer.accept(PeerPair().peers[0].negotiation.offer(SECTIONS), 0)
    pair = PeerPair()
    offerer, answerer = pair.peers
    answer = answerer.answer(through_text(offerer.negotiation.offer(SECTIONS, data=False)), {"talk": TALK}, pair.now)
    offerer.accept(through_text(answer), pair.now)
    pair.run(2)
    for peer in pair.peers:
        with pytest.raises(PeerNotReady):
            peer.media.frame_to_send("camera", [b""], 0, pair.now)
        with pytest.raises(PeerNotReady):
            peer.media.request_keyframe("camera", pair.now)
        with pytest.raises(PeerNotReady):
            peer.need_channels(pair.now)
    with pytest.raises(ValueError, match="1200"):
        pair.send_frame(0, "talk", [bytes(1201)], 0)


def test_an_offer_that_cannot_be_answered_leaves_the_peer_as_it_was() -> None:
    pair = PeerPair()
    with pytest.raises(SdpError):
        pair.peers[1].answer(pair.peers[0].negotiation.offer(SECTIONS, data=False), {}, pair.now)
    negotiate(pair)
    pair.run(2)
    assert pair.of(1, Connected)


def test_who_closes_says_so_and_the_other_ends_as_well() -> None:
    pair = connected()
    pair.send_frame(0, "camera", [b"x"], 0)
    pair.peers[0].close(pair.now)
    pair.peers[0].close(pair.now)
    pair.run(1)
    assert pair.of(0, PeerEnded) == [PeerEnded("closed")]
    assert pair.of(1, PeerEnded) == [PeerEnded("peer_closed")]
    assert isinstance(pair.events[1][-1], PeerEnded)
    for peer in pair.peers:
        assert peer.timer() is None
        with pytest.raises(PeerNotReady):
            peer.need_channels(pair.now)
        peer.receive_datagram(b"\x16", Path(("192.0.2.1", 1), ("192.0.2.2", 1)), pair.now)
        peer.handle_timer(pair.now)
        assert peer.events() == []
        assert peer.datagrams_to_send() == []


def test_what_came_before_the_end_is_told_before_it_and_nothing_after() -> None:
    pair = connected()
    sender, receiver = pair.peers
    assert receiver.ice.path is not None
    for data in sender.media.frame_to_send("camera", [b"x"], 0, pair.now):
        receiver.receive_datagram(data, receiver.ice.path, pair.now)
    receiver.close(pair.now)
    told = receiver.events()
    assert [type(each) for each in told if not isinstance(each, ChannelClosed | Closed)] == [PacketReceived, PeerEnded]
    assert isinstance(told[-1], PeerEnded)
    assert receiver.events() == []


def test_another_certificate_than_the_announced_one_ends_it_by_name() -> None:
    pair = PeerPair()
    offer = pair.peers[0].negotiation.offer(SECTIONS)
    stranger = Certificate.generate().fingerprint
    forged = replace(offer, transport=replace(offer.transport, fingerprints=(stranger,)))
    answer = pair.peers[1].answer(through_text(forged), {"camera": SCREEN}, pair.now)
    pair.peers[0].accept(through_text(answer), pair.now)
    pair.run(2)
    [ended] = pair.of(1, PeerEnded)
    assert isinstance(ended, PeerEnded)
    assert ended.reason == "dtls_fingerprint"
    assert not pair.of(1, Connected)
    assert not pair.of(1, ChannelOpened)


def test_silence_ends_it_by_name() -> None:
    pair = connected()
    pair.lost = lambda side, data: True
    pair.run(60)
    assert pair.of(0, PeerEnded) == pair.of(1, PeerEnded) == [PeerEnded("consent_expired")]


def test_a_peer_that_never_comes_ends_it_by_name() -> None:
    pair = PeerPair()
    pair.lost = lambda side, data: True
    negotiate(pair)
    pair.run(120)
    assert pair.of(0, PeerEnded) == [PeerEnded("no_path")]


def test_a_restart_of_ice_changes_nothing_else() -> None:
    pair = connected()
    channel = pair.open_channel(0, "x")
    credentials = [peer.ice.restart(pair.now) for peer in pair.peers]
    candidates = [[each.candidate for each in peer.ice.local_candidates] for peer in pair.peers]
    for side in (0, 1):
        pair.peers[side].ice.set_remote(credentials[1 - side], candidates[1 - side], pair.now)
    pair.run(5)
    pair.send(0, channel, "after")
    pair.run(1)
    assert pair.of(1, ChannelMessage) == [ChannelMessage(channel, "after")]
    assert not pair.of(0, PeerEnded)


def test_a_restart_by_fragments_brings_a_new_path_and_says_so() -> None:
    pair = connected()
    channel = pair.open_channel(0, "x")
    moved = gather(["192.0.2.1"], 5000)
    fragment = fragment_through_text(pair, pair.peers[0].negotiation.restart(pair.now, moved))
    answer = pair.peers[1].negotiation.answer_restart(fragment, pair.now)
    pair.peers[0].negotiation.accept_restart(fragment_through_text(pair, answer), pair.now)
    pair.run(5)
    assert pair.of(0, Restarted) == pair.of(1, Restarted) == [Restarted()]
    assert pair.peers[0].ice.path == Path(("192.0.2.1", 5000), ("192.0.2.2", 4000))
    pair.send(0, channel, "after")
    pair.run(1)
    assert pair.of(1, ChannelMessage) == [ChannelMessage(channel, "after")]


def fragment_through_text(pair: PeerPair, fragment: Fragment) -> Fragment:
    section = pair.peers[0].negotiation.tagged
    return parse_fragment(write_fragment(fragment, section.kind, section.mid), section.mid)


def test_a_restart_that_finds_no_path_says_so_and_leaves_the_one_before() -> None:
    pair = connected()
    before = pair.peers[0].ice.path
    pair.peers[0].negotiation.restart(pair.now)
    pair.peers[0].negotiation.accept_restart(Fragment("nobody", "x" * 22), pair.now)
    pair.run(60)
    assert pair.of(0, RestartFailed) == [RestartFailed()]
    assert not pair.of(0, PeerEnded)
    assert pair.peers[0].ice.path == before


def test_a_restart_needs_a_session_and_credentials() -> None:
    pair = PeerPair()
    with pytest.raises(PeerNotReady):
        pair.peers[0].negotiation.restart(pair.now)
    pair = connected()
    pair.peers[0].negotiation.restart(pair.now)
    for lacking in (Fragment(), Fragment("abcd")):
        with pytest.raises(SdpError):
            pair.peers[0].negotiation.accept_restart(lacking, pair.now)
        with pytest.raises(SdpError):
            pair.peers[1].negotiation.answer_restart(lacking, pair.now)
    pair.peers[0].ice.cancel_restart()
    with pytest.raises(RuntimeError):
        pair.peers[0].negotiation.accept_restart(Fragment("abcd", "x" * 22), pair.now)
    pair.peers[0].close(pair.now)
    with pytest.raises(PeerNotReady, match="ended"):
        pair.peers[0].negotiation.restart(pair.now)


def test_plain_packets_come_as_they_are_and_nothing_is_said_about_them() -> None:
    pair = PeerPair()
    pair.peers[1].media.plain = True
    with pytest.raises(PeerNotReady):
        pair.peers[1].media.send_rtcp(b"")
    negotiate(pair)
    pair.run(2)
    pair.send_frame(0, "camera", [b"payload"], 3000, values={STAMP: b"12"})
    pair.run(3)
    [plain] = pair.of(1, PlainRtp)
    assert isinstance(plain, PlainRtp)
    assert RtpPacket.parse(plain.data).payload == b"payload"
    assert pair.of(1, PlainRtcp), "sender reports"
    assert not pair.of(1, PacketReceived)
    assert not pair.of(0, MediaEvent), "no receiver report"
    ssrc = RtpPacket.parse(plain.data).ssrc
    block = ReportBlock(ssrc, 0, 0, RtpPacket.parse(plain.data).sequence_number, 0, 0, 0)
    pair.peers[1].media.send_rtcp(pack_rtcp([ReceiverReport(7, (block,))]))
    pair.run(1)
    [told] = [each.event for each in pair.of(0, MediaEvent) if isinstance(each, MediaEvent)]
    assert isinstance(told, Reception)
    pair.peers[1].close(pair.now)
    with pytest.raises(PeerNotReady):
        pair.peers[1].media.send_rtcp(b"")


def test_a_round_trip_that_the_application_has_measured_is_used() -> None:
    pair = connected()
    pair.peers[1].share.round_trip.measure(0.7)
    assert pair.peers[1].media.streams.share.round_trip.seconds == 0.7


def test_a_session_is_negotiated_once() -> None:
    pair = connected()
    with pytest.raises(RuntimeError, match="negotiated"):
        pair.peers[0].negotiation.offer(SECTIONS)
    with pytest.raises(RuntimeError, match="negotiated"):
        pair.peers[1].answer(PeerPair().peers[0].negotiation.offer(SECTIONS), {}, pair.now)


def test_a_handshake_that_overtakes_the_answer_is_kept_for_it() -> None:
    pair = PeerPair(PeerSettings(setup="active"))
    offerer, answerer = pair.peers
    answer = answerer.answer(through_text(offerer.negotiation.offer(SECTIONS)), {"camera": SCREEN}, pair.now)
    assert answer.transport.setup == "active"
    pair.run(0.5)
    assert offerer.counts == {"dtls_early": 1}
    offerer.accept(through_text(answer), pair.now)
    pair.run(0.5)  # of this clock: nothing is repeated, as OpenSSL's own stands nearly still
    assert pair.of(0, Connected)
    assert pair.of(1, Connected)


def test_what_comes_before_it_can_be_read_is_counted_and_bounded() -> None:
    pair = PeerPair(PeerSettings(setup="active"))
    offerer, answerer = pair.peers
    answerer.answer(through_text(offerer.negotiation.offer(SECTIONS)), {"camera": SCREEN}, pair.now)
    pair.run(0.5)
    path = Path(("192.0.2.1", 4000), ("192.0.2.2", 4000))
    for _ in range(100):
        offerer.receive_datagram(b"\x16" + bytes(20), path, pair.now)
    offerer.receive_datagram(b"\x80" + bytes(20), path, pair.now)
    offerer.receive_datagram(b"\x80" + bytes(20), Path(path.local, ("192.0.2.3", 4000)), pair.now)
    assert offerer.counts == {"dtls_early": 101, "media_early": 1, "unknown_path": 1}
    assert len(offerer._dtls._held) == 32


def test_what_the_peer_sends_that_is_nothing_is_counted() -> None:
    pair = connected()
    sender, receiver = pair.peers
    assert sender.media._protect is not None
    path = receiver.ice.path
    assert path is not None
    protect, protect_rtcp = sender.media._protect.protect, sender.media._protect.protect_rtcp
    malformed = b"\xb0" + bytes(3) + bytes(4) + b"\x00\x00\x00\x09" + b"\xbe\xde\x00\x01\x1f\x00\x00\x00" + b"\xff"
    for data in (
        protect(b"\x80\x21" + bytes(10)),
        protect(malformed),
        protect_rtcp(b"\x81\xc9\x00\x01\x00\x00\x00\x09"),
        b"\x50zrtp",
        b"\x80\x60" + bytes(30),
    ):
        receiver.receive_datagram(data, path, pair.now)
    assert receiver.counts == {"unknown_protocol": 1}
    assert receiver.media.streams.counts == {"rtp_unknown": 1, "rtp_malformed": 1, "rtcp_malformed": 1}
    assert not pair.of(1, PeerEnded)


def test_data_without_channels_and_packets_that_are_too_long_are_counted() -> None:
    pair = PeerPair()
    offerer, answerer = pair.peers
    camera = replace(CAMERA, extensions=(*CAMERA.extensions, "urn:long"))
    offer = offerer.negotiation.offer([OfferedMedia("camera", "video", camera)], data=False)
    answer = answerer.answer(through_text(offer), {"camera": replace(SCREEN, extensions=camera.extensions)}, pair.now)
    offerer.accept(through_text(answer), pair.now)
    pair.run(2)
    pair.send_frame(0, "camera", [bytes(1200)], 0, values={"urn:long": bytes(200)})
    pair.run(0.1)
    assert offerer.counts == {"packet_too_long": 1}
    assert offerer._dtls.connection is not None
    offerer._dtls.connection.send(b"data", pair.now)
    pair.run(0.1)
    assert answerer.counts == {"data_without_channels": 1}


def test_candidates_that_nobody_understands_are_counted() -> None:
    peer = PeerPair().peers[0]
    peer.negotiation.add_candidate("candidate:nonsense")
    assert peer.counts == {"candidate_malformed": 1}


@pytest.fixture(scope="module")
def attacked() -> PeerPair:
    return connected()


@examples(deadline=None)
@given(st.binary(max_size=300), st.booleans())
def test_nothing_that_comes_from_anywhere_raises_or_ends_a_session(
    attacked: PeerPair, data: bytes, from_the_peer: bool
) -> None:
    peer = attacked.peers[0]
    path = peer.ice.path
    assert path is not None
    if not from_the_peer:
        path = Path(path.local, ("203.0.113.5", 9))
    peer.receive_datagram(data, path, attacked.now)
    assert not [each for each in peer.events() if isinstance(each, PeerEnded)]
    peer.datagrams_to_send()


def test_a_frame_that_is_sent_by_itself_needs_nothing_else_to_be_drained() -> None:
    pair = connected()
    offerer, answerer = pair.peers
    for frame in range(3):
        assert answerer.ice.path is not None
        for data in offerer.media.frame_to_send("camera", [b"%d" % frame], frame * 3000, pair.now):
            answerer.receive_datagram(data, answerer.ice.path, pair.now)
        assert offerer.media.due is not None
    pair.run(0.1)
    packets = [each.packet.payload for each in pair.of(1, PacketReceived) if isinstance(each, PacketReceived)]
    assert packets == [b"0", b"1", b"2"]
    pair.run(2.0)
    assert any(isinstance(each, MediaEvent) for each in pair.of(0, MediaEvent)), "reports go out by their timer"
    offerer.close(pair.now)
    with pytest.raises(PeerNotReady):
        offerer.media.frame_to_send("camera", [b"x"], 0, pair.now)
