"""Outgoing and incoming streams with a network of exact losses between them."""

from collections.abc import Callable
from random import Random

from lockstep.rtc.rtp.feedback import PictureLoss
from lockstep.rtc.rtp.history import RepairStream
from lockstep.rtc.rtp.incoming import IncomingParameters, IncomingStream
from lockstep.rtc.rtp.outgoing import OutgoingParameters, OutgoingStream, PathShare
from lockstep.rtc.rtp.stage import BandwidthEstimate, KeyframeRequested, PacketsGone, RoundTrip
from lockstep.rtc.rtp.streams import Identity, NegotiatedMedia, Streams
from lockstep.rtc.rtp.wire.extensions import ABS_SEND_TIME_URI
from lockstep.rtc.rtp.wire.packet import RtpPacket
from lockstep.rtc.rtp.wire.rtcp import ReceiverReport, SenderReport, SourceDescription, pack_rtcp, parse_rtcp
from lockstep.rtc.sdp import Codec, MediaSection

STAMP = "urn:stamp"
IDS = {STAMP: 1, ABS_SEND_TIME_URI: 2}
DELAY = 0.05  # s, one way


class Path:
    """One stream from its sender to its receiver and back, on a clock of its own."""

    def __init__(self, *, rtx: bool = True, lost: Callable[[int], bool] = lambda number: False) -> None:
        repair = RepairStream(8, 97, 65_530) if rtx else None
        parameters = OutgoingParameters(7, 96, 90_000, "cname", 65_500, 0xFFFFFF00, IDS, repair=repair)
        self.share = PathShare(epoch=1_700_000_000.0)
        self.sender = OutgoingStream(parameters, self.share, paced=True)
        incoming = IncomingParameters(1, {96: 90_000}, IDS, {97: 96} if rtx else {})
        self.receiver = IncomingStream(incoming, RoundTrip(2 * DELAY))
        self.lost = lost
        self.now = 100.0
        self.number = 0
        self.flying: list[tuple[float, bool, bytes]] = []  # when, whether to the receiver, what
        self.received: list[RtpPacket] = []

    def run_until(self, end: float) -> None:
        while True:
            self._collect()
            times = [self.sender.timer(), self.receiver.timer(), *(each[0] for each in self.flying)]
            due = min((each for each in times if each is not None), default=None)
            if due is None or due > end:
                break
            self.now = max(self.now, due)
            self._deliver()
            self.sender.handle_timer(self.now)
            self.receiver.handle_timer(self.now)
        self.now = end

    def _collect(self) -> None:
        for data in self.sender.packets_to_send():
            if not self.lost(self.number):
                self.flying.append((self.now + DELAY, True, b"\x00" + data))
            self.number += 1
        for controls, there in ((self.sender.controls_to_send(), True), (self.receiver.controls_to_send(), False)):
            if controls:
                self.flying.append((self.now + DELAY, there, b"\x01" + pack_rtcp(controls)))
        self.received += self.receiver.packets()

    def _deliver(self) -> None:
        due = [each for each in self.flying if each[0] <= self.now]
        self.flying = [each for each in self.flying if each[0] > self.now]
        for _, there, data in due:
            end: OutgoingStream | IncomingStream = self.receiver if there else self.sender
            if data[0]:
                for packet in parse_rtcp(data[1:]):
                    end.rtcp(packet, self.now)
            else:
                self.receiver.rtp(RtpPacket.parse(data[1:]), self.now)


def play(path: Path, frames: int) -> None:
    for frame in range(frames):
        start = path.now
        values = {STAMP: frame.to_bytes(4, "big")}
        path.sender.send([b"%d.%d" % (frame, part) for part in range(3)], frame * 3000, start, values=values)
        path.run_until(start + 1 / 30)
    path.run_until(path.now + 2)


def everything(frames: int) -> set[bytes]:
    return {b"%d.%d" % (frame, part) for frame in range(frames) for part in range(3)}


def test_packets_arrive_with_their_stamps_over_the_wrap_of_their_numbers() -> None:
    path = Path()
    play(path, 60)
    assert [each.payload for each in path.received] == [b"%d.%d" % (x // 3, x % 3) for x in range(180)]
    assert all(each.values[STAMP] == (int(each.payload.split(b".")[0])).to_bytes(4, "big") for each in path.received)
    assert [each.marker for each in path.received[:6]] == [False, False, True] * 2
    assert path.share.round_trip.measured
    assert abs(path.share.round_trip.seconds - 2 * DELAY) < 0.001


def test_every_lost_packet_is_repaired_once_with_and_without_a_repair_stream() -> None:
    for rtx in (True, False):
        random = Random(5)
        path = Path(rtx=rtx, lost=lambda number, random=random: random.random() < 0.1)  # type: ignore[misc]
        play(path, 90)
        payloads = [each.payload for each in path.received]
        assert set(payloads) == everything(90)
        assert len(payloads) == len(set(payloads))
        assert path.sender.history is not None
        assert path.sender.history.retransmitted > 20


def test_a_repair_says_anew_when_it_left() -> None:
    path = Path(lost=lambda number: number == 4)
    play(path, 3)
    [repaired] = [each for each in path.received if each.is_repair]
    first = next(each for each in path.received if each.payload == b"1.0")
    assert repaired.payload == b"1.1"
    assert repaired.values[STAMP] == first.values[STAMP]
    assert repaired.values[ABS_SEND_TIME_URI] > first.values[ABS_SEND_TIME_URI]


def test_when_everything_is_lost_it_is_told_and_a_keyframe_asked_for() -> None:
    path = Path(lost=lambda number: 6 <= number < 600)
    for frame in range(200):
        path.sender.send([b"x"] * 4, frame * 3000, path.now)
        path.run_until(path.now + 1 / 30)
    assert PacketsGone(7, "too_many") in path.receiver.events()
    path.receiver.request_keyframe(path.now)
    path.receiver.request_keyframe(path.now)
    path.run_until(path.now + 1)
    assert path.sender.requests.keyframes == 1
    assert KeyframeRequested(7) in path.sender.events()


def test_a_stream_that_begins_anew_has_a_new_chain() -> None:
    stream = IncomingStream(IncomingParameters(1, {96: 90_000}, repair_types={97: 96}), RoundTrip())
    stream.request_keyframe(0)
    assert stream.ssrc is None
    assert stream.reports is None
    assert stream.timer() is None
    stream.rtp(RtpPacket(97, 1, 0, 8, b"\0\1x"), 0)
    stream.rtp(RtpPacket(33, 1, 0, 7), 0)
    assert stream.ignored == 2
    for ssrc in (7, 9):
        stream.rtp(RtpPacket(96, 1, 0, ssrc), 0)
        assert stream.ssrc == ssrc
    assert [each.ssrc for each in stream.packets()] == [7, 9]


def test_a_stream_without_repeats_keeps_nothing_and_still_reports_and_ends() -> None:
    share = PathShare(epoch=0.0)
    parameters = OutgoingParameters(7, 111, 48_000, "cname", 0, 0, repeats=False)
    sound = OutgoingStream(parameters, share, paced=False)
    sound.send([b"x"], 0, 1.0, marker=False)
    assert len(sound.packets_to_send()) == 1
    assert len(sound.controls_to_send()) == 2
    assert sound.history is None
    assert sound.pacer is None
    sound.close(2.0)
    assert len(sound.controls_to_send()) == 3
    stream = IncomingStream(IncomingParameters(1, {111: 48_000}, asks_again=False), RoundTrip())
    for number in (1, 3):
        stream.rtp(RtpPacket(111, number, 0, 7), 0)
    stream.handle_timer(0.5)
    assert stream.controls_to_send() == []


def test_reports_that_fill_more_than_a_datagram_go_in_several_that_each_begin_with_one() -> None:
    codec = Codec(96, "VP8", 90_000, feedback=("nack",))
    media = [
        NegotiatedMedia(MediaSection("video", f"m{number}", codecs=(codec,)), "sendonly", 100 + number, 200 + number)
        for number in range(40)
    ]
    streams = Streams(media, Identity("c" * 24, 1), PathShare(0.0), Random(1))
    for number in range(40):
        streams.outgoing[f"m{number}"].send([b"x"], 0, 0.0)
    compounds = streams.rtcp_to_send()
    assert len(compounds) > 1
    assert max(map(len, compounds)) <= 1200
    parsed = [parse_rtcp(each) for each in compounds]
    assert all(isinstance(each[0], SenderReport | ReceiverReport) for each in parsed)
    assert sum(isinstance(x, SenderReport) for each in parsed for x in each) == 40


def test_feedback_alone_goes_behind_an_empty_report_and_a_name() -> None:
    codec = Codec(96, "VP8", 90_000, feedback=("nack",))
    media = [NegotiatedMedia(MediaSection("video", "m", codecs=(codec,)), "recvonly", 100, 200)]
    streams = Streams(media, Identity("name", 1), PathShare(0.0), Random(1))
    streams.receive_rtp(RtpPacket(96, 1, 0, 7).pack(), 0.0)
    streams.incoming["m"].request_keyframe(0.0)
    [compound] = streams.rtcp_to_send()
    assert parse_rtcp(compound) == [ReceiverReport(1), SourceDescription(((1, "name"),)), PictureLoss(1, 7)]
    assert [mid for mid, _ in streams.packets()] == ["m"]


def test_with_each_report_the_sender_is_told_how_much_it_may_send_at_most() -> None:
    path = Path()
    path.receiver.limit = 1_000_000
    path.sender.send([b"x" * 100], 0, path.now)
    path.run_until(path.now + 3 * DELAY)
    assert path.sender.events() == [], "there was no report yet"
    path.run_until(path.now + 1.5)
    told = [each for each in path.sender.events() if isinstance(each, BandwidthEstimate)]
    assert told
    assert all(each.bitrate <= 1_000_000 < 1.01 * each.bitrate and each.ssrcs == {7} for each in told)


def test_streams_of_one_peer_report_together_and_as_often_as_they_are_asked_to() -> None:
    codec = Codec(96, "VP8", 90_000, feedback=("nack",))
    media = [
        NegotiatedMedia(MediaSection("video", f"m{number}", codecs=(codec,)), "sendonly", 100 + number, 200 + number)
        for number in range(3)
    ]
    streams = Streams(media, Identity("name", 1), PathShare(0.0), Random(1))
    for number in range(3):  # each begins at another time
        streams.outgoing[f"m{number}"].send([b"x"], 0, number / 10)
        streams.outgoing[f"m{number}"].reports.interval = 2.0
    streams.rtcp_to_send()
    streams.handle_timer(1.0)
    [compound] = streams.rtcp_to_send()
    assert sum(isinstance(each, SenderReport) for each in parse_rtcp(compound)) == 3
    assert streams.timer() == 3.0
