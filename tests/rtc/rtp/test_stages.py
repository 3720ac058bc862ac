"""Each stage by itself, on a sink, with the time in the test's hand."""

from lockstep.rtc.rtp.feedback import FullIntraRequest, Nack, PictureLoss, Remb, TransportFeedback
from lockstep.rtc.rtp.history import History, HistorySettings, RepairStream
from lockstep.rtc.rtp.losses import Losses, LossSettings
from lockstep.rtc.rtp.pacer import Pacer, PacerSettings, PathBudget
from lockstep.rtc.rtp.receiver_reports import ReceiverReports
from lockstep.rtc.rtp.repairs import Repairs
from lockstep.rtc.rtp.requests import Requests
from lockstep.rtc.rtp.sender_reports import SenderReports
from lockstep.rtc.rtp.stage import (
    Arrivals,
    BandwidthEstimate,
    KeyframeRequested,
    PacketsGone,
    PacketsLeft,
    Reception,
    RoundTrip,
    Sink,
    Stage,
    StreamEnded,
)
from lockstep.rtc.rtp.wire.extensions import (
    ABS_SEND_TIME_URI,
    TRANSPORT_NUMBER_URI,
    ExtensionReader,
    ExtensionWriter,
    TransportNumbers,
    pack_send_time,
)
from lockstep.rtc.rtp.wire.numbers import Unwrapper, is_after
from lockstep.rtc.rtp.wire.rtcp import Goodbye, ReceiverReport, SenderReport, SourceDescription
from tests.rtc.rtp.packets import SSRC, block, packet

EPOCH = 1_700_000_000.0


def numbers(sink: Sink) -> list[int]:
    return [each.sequence_number for each in sink.drain_packets()]


def test_the_base_hands_everything_on() -> None:
    sink = Sink()
    stage = Stage(Stage(sink))
    stage.rtp(packet(), 0)
    stage.rtcp(PictureLoss(1, 2), 0)
    stage.control(PictureLoss(3, 4), 0)
    stage.event(StreamEnded(5))
    stage.handle_timer(0)
    assert stage.timer() is None
    assert (sink.drain_packets(), sink.drain_controls(), sink.drain_events()) == (
        [packet()],
        [PictureLoss(3, 4)],
        [StreamEnded(5)],
    )
    assert (sink.packets, sink.controls, sink.events) == ([], [], [])


# Extensions


def test_values_are_written_under_the_ids_that_were_negotiated() -> None:
    sink = Sink()
    ids = {"urn:stamp": 2, "urn:mid": 1, ABS_SEND_TIME_URI: 3, TRANSPORT_NUMBER_URI: 4}
    stage = ExtensionWriter(sink, ids, {"urn:mid": b"camera", "urn:unknown": b"x"})
    stage.rtp(packet(values={"urn:stamp": b"\x00\x01", "urn:other": b"y"}), 1.5)
    [written] = sink.drain_packets()
    assert written.extensions == {1: b"camera", 2: b"\x00\x01", 3: pack_send_time(1.5), 4: b"\x00\x00"}
    assert not written.two_byte


def test_one_id_over_14_makes_the_whole_stream_use_the_two_byte_form() -> None:
    sink = Sink()
    stage = ExtensionWriter(sink, {"urn:stamp": 200, "urn:mid": 1}, {"urn:mid": b"camera"})
    stage.rtp(packet(), 0)
    assert sink.packets[0].pack()[12:14] == b"\x10\x00"


def test_transport_numbers_count_the_packets_of_all_streams() -> None:
    shared, sink = TransportNumbers(), Sink()
    stages = [ExtensionWriter(sink, {TRANSPORT_NUMBER_URI: 4}, numbers=shared) for _ in range(2)]
    for turn in range(4):
        stages[turn % 2].rtp(packet(), 0)
    assert [each.extensions[4] for each in sink.packets] == [b"\0\0", b"\0\1", b"\0\2", b"\0\3"]


def test_what_came_is_named_by_uri() -> None:
    sink = Sink()
    ExtensionReader(sink, {"urn:stamp": 2}).rtp(packet(extensions={2: b"stamp", 9: b"x"}), 0)
    assert sink.packets[0].values == {"urn:stamp": b"stamp"}


# History


def history(repair: RepairStream | None = None, **settings: float) -> tuple[History, Sink]:
    sink = Sink()
    stage = History(sink, SSRC, RoundTrip(0.1), repair, HistorySettings(**settings))  # type: ignore[arg-type]
    return stage, sink


def test_what_is_missing_is_sent_again_in_the_repair_stream() -> None:
    stage, sink = history(RepairStream(8, 97, 65535))
    for number in (65534, 65535, 0):
        stage.rtp(packet(number, bytes((number & 0xFF,)), marker=True), 0)
    sink.drain_packets()
    stage.rtcp(Nack(1, SSRC, (65535, 0)), 1)
    first, second = sink.drain_packets()
    assert (first.ssrc, first.payload_type, first.sequence_number, first.payload) == (8, 97, 65535, b"\xff\xff\xff")
    assert (second.sequence_number, second.payload) == (0, b"\x00\x00\x00")
    assert first.is_repair
    assert first.marker
    assert stage.retransmitted == 2


def test_without_a_repair_stream_the_packet_itself_is_sent_again() -> None:
    stage, sink = history()
    stage.rtp(packet(5), 0)
    stage.rtcp(Nack(1, SSRC, (5,)), 1)
    assert [each.pack() for each in sink.packets] == [packet(5).pack()] * 2


def test_a_packet_is_kept_as_it_was_before_later_stages_changed_it() -> None:
    stage, sink = history()
    stage.rtp(packet(5), 0)
    sink.packets[0].extensions = {1: b"changed"}
    stage.rtcp(Nack(1, SSRC, (5,)), 1)
    assert sink.packets[1].extensions == {}


def test_a_packet_that_is_on_its_way_again_is_not_sent_once_more() -> None:
    stage, sink = history()
    stage.rtp(packet(5), 0)
    for now in (1, 1.05, 1.2):
        stage.rtcp(Nack(1, SSRC, (5,)), now)
    assert numbers(sink) == [5, 5, 5]
    assert stage.on_their_way == 1


def test_what_is_too_old_or_too_much_is_forgotten() -> None:
    for settings, left in (({"seconds": 2.5}, [2, 3]), ({"packets": 1}, [3]), ({"octets": 14}, [2, 3])):
        stage, sink = history(**settings)
        for number in range(1, 4):
            stage.rtp(packet(number), number * 1.5)
        sink.drain_packets()
        stage.rtcp(Nack(1, SSRC, (0, 1, 2, 3)), 5)
        assert numbers(sink) == left
        assert stage.refused == 4 - len(left)


def test_numbers_that_come_round_again_replace_what_they_had() -> None:
    stage, sink = history(packets=70_000, seconds=1e9)
    for number in range(65536 + 2):
        stage.rtp(packet(number, b"%d" % number), 0)
    sink.drain_packets()
    stage.rtcp(Nack(1, SSRC, (0, 1, 2)), 1)
    assert [each.payload for each in sink.packets] == [b"65536", b"65537", b"2"]


def test_a_peer_cannot_make_us_flood_it() -> None:
    stage, sink = history(burst=10, rate=100)
    for number in range(100):
        stage.rtp(packet(number), 0)
    sink.drain_packets()
    stage.rtcp(Nack(1, SSRC, tuple(range(100))), 0.5)
    assert len(numbers(sink)) == 10
    stage.rtcp(Nack(1, SSRC, tuple(range(50, 100))), 0.55)
    assert len(numbers(sink)) == 5


def test_a_nack_of_another_stream_does_nothing() -> None:
    stage, sink = history()
    stage.rtp(packet(5), 0)
    stage.rtcp(Nack(1, SSRC + 1, (5,)), 1)
    assert numbers(sink) == [5]


# Pacer


def pacer(**settings: float) -> tuple[Pacer, Sink, PathBudget]:
    sink, budget = Sink(), PathBudget(PacerSettings(**settings))  # type: ignore[arg-type]
    return Pacer(sink, budget), sink, budget


def test_a_burst_leaves_at_once_and_the_rest_by_and_by_in_order() -> None:
    stage, sink, budget = pacer(burst=1000, headroom=1.0)
    budget.limit(80_000)  # 10,000 bytes a second
    for number in range(6):
        stage.rtp(packet(number, bytes(500)), 0)
    assert numbers(sink) == [0, 1]
    now = 0.0
    left: list[int] = []
    while (due := stage.timer()) is not None:
        assert due > now
        now = due
        stage.handle_timer(now)
        left += numbers(sink)
    assert left == [2, 3, 4, 5]
    assert 0.1 <= now < 0.2


def test_the_pacer_says_when_the_last_packet_that_it_held_back_has_left() -> None:
    stage, sink, _ = pacer(burst=1, free_rate=8_000)
    held = []
    for number in (1, 2):
        stage.rtp(packet(number, bytes(500)), 0)
        held.append(stage.holds)
    assert sink.drain_events() == []
    due = stage.timer()
    assert due is not None
    stage.handle_timer(due + 0.001)
    assert [*held, stage.holds] == [False, True, False]
    assert sink.drain_events() == [PacketsLeft()]


def test_a_retransmission_overtakes_what_waits() -> None:
    stage, sink, _ = pacer(burst=400, free_rate=8_000)
    for number in range(3):
        stage.rtp(packet(number, bytes(500)), 0)
    stage.rtp(packet(9, bytes(500), is_repair=True), 0)
    assert numbers(sink) == [0]
    stage.handle_timer(0.2)
    assert numbers(sink) == [9]


def test_what_waits_is_bounded() -> None:
    stage, sink, _ = pacer(burst=1, free_rate=8, waiting=10)
    for number in range(20):
        stage.rtp(packet(number, bytes(500)), 0)
    assert stage.dropped == 9
    assert numbers(sink) == [0]


def test_a_timer_that_comes_too_early_lets_nothing_out() -> None:
    stage, sink, _ = pacer(burst=1, free_rate=8_000)
    stage.rtp(packet(1, bytes(500)), 0)
    stage.rtp(packet(2, bytes(500)), 0)
    due = stage.timer()
    assert due is not None
    stage.handle_timer(due - 0.01)
    assert numbers(sink) == [1]
    stage.handle_timer(due + 0.001)
    assert numbers(sink) == [2]
    assert stage.timer() is None


# Sender reports


def sender_reports() -> tuple[SenderReports, Sink, RoundTrip]:
    sink, round_trip = Sink(), RoundTrip()
    return SenderReports(sink, SSRC, 90_000, "cname", EPOCH, round_trip), sink, round_trip


def test_the_first_packet_is_reported_at_once_and_then_every_second() -> None:
    stage, sink, _ = sender_reports()
    assert stage.timer() is None
    stage.rtp(packet(1, captured_at=9.5), 10)
    stage.rtp(packet(2, captured_at=9.5), 10)
    first, names = sink.drain_controls()
    assert isinstance(first, SenderReport)
    assert (first.ssrc, first.packets, first.octets) == (SSRC, 1, 7)
    assert first.rtp_timestamp == 1000 + 45_000  # half a second after its capture
    assert first.ntp_time >> 32 == 2_208_988_800 + 1_700_000_010
    assert names == SourceDescription(((SSRC, "cname"),))
    assert stage.timer() == 11
    stage.handle_timer(10.9)
    assert sink.drain_controls() == []
    stage.handle_timer(11)
    second = sink.drain_controls()[0]
    assert isinstance(second, SenderReport)
    assert second.packets == 2


def test_a_report_of_the_peer_tells_round_trip_and_loss() -> None:
    stage, sink, round_trip = sender_reports()
    stage.rtp(packet(), 10)
    report = sink.drain_controls()[0]
    assert isinstance(report, SenderReport)
    middle = report.ntp_time >> 16 & 0xFFFFFFFF
    stage.rtcp(ReceiverReport(1, (block(10, 0, middle, 32768),)), 10.75)
    stage.rtcp(ReceiverReport(1, (block(30, 4),)), 11.75)
    stage.rtcp(SenderReport(1, 0, 0, 0, 0, (block(20, 4),)), 12)  # overtaken
    receptions = [each for each in sink.drain_events() if isinstance(each, Reception)]
    assert [(each.expected, each.lost, each.round_trip) for each in receptions] == [
        (0, 0, 0.25),
        (20, 4, None),
        (0, 0, None),
    ]
    assert (round_trip.seconds, round_trip.measured) == (0.25, True)


def test_reports_of_other_streams_and_unknown_times_tell_nothing() -> None:
    stage, sink, round_trip = sender_reports()
    stage.rtp(packet(), 10)
    other = ReceiverReport(1, (block(), block(last_report=5)))
    stage.rtcp(ReceiverReport(1, tuple(x for x in other.blocks if x.ssrc != SSRC)), 11)
    assert sink.events == []
    stage.rtcp(other, 11)
    assert not round_trip.measured


def test_only_the_newest_reports_are_remembered() -> None:
    stage, sink, round_trip = sender_reports()
    stage.rtp(packet(), 0)
    first = sink.drain_controls()[0]
    assert isinstance(first, SenderReport)
    for second in range(1, 20):
        stage.handle_timer(second)
    stage.rtcp(ReceiverReport(1, (block(last_report=first.ntp_time >> 16 & 0xFFFFFFFF),)), 20)
    assert not round_trip.measured


def test_a_stream_that_began_says_goodbye() -> None:
    stage, sink, _ = sender_reports()
    stage.goodbye(1)
    assert sink.controls == []
    stage.rtp(packet(), 2)
    sink.drain_controls()
    stage.goodbye(3)
    assert sink.controls[-1] == Goodbye((SSRC,))
    assert stage.timer() is None


# Requests


def requests() -> tuple[Requests, Sink]:
    sink = Sink()
    return Requests(sink, SSRC, RoundTrip(0.1)), sink


def test_a_request_for_a_keyframe_is_told() -> None:
    stage, sink = requests()
    stage.rtcp(PictureLoss(1, SSRC), 0)
    stage.rtcp(PictureLoss(1, SSRC + 1), 0)
    stage.rtcp(FullIntraRequest(1, ((SSRC + 1, 1),)), 0)
    stage.rtcp(FullIntraRequest(1, ((SSRC, 1),)), 0)
    stage.rtcp(FullIntraRequest(1, ((SSRC, 1),)), 0)  # a repetition
    stage.rtcp(FullIntraRequest(1, ((SSRC, 2),)), 0)
    assert sink.drain_events() == [KeyframeRequested(SSRC)] * 3


def test_a_request_waits_while_what_is_missing_is_on_its_way() -> None:
    stage, sink = requests()
    stage.rtp(packet(is_repair=True), 10)
    stage.rtcp(PictureLoss(1, SSRC), 10.03)
    stage.rtcp(PictureLoss(1, SSRC), 10.04)
    assert sink.drain_events() == []
    due = stage.timer()
    assert due is not None
    assert abs(due - 10.1) < 1e-9
    stage.handle_timer(10.05)
    assert sink.drain_events() == []
    stage.handle_timer(due)
    assert sink.drain_events() == [KeyframeRequested(SSRC)]
    assert stage.timer() is None
    assert stage.keyframes == 2


def test_estimates_and_arrivals_are_told() -> None:
    stage, sink = requests()
    stage.rtcp(Remb(1, 5000, (SSRC, 9)), 0)
    stage.rtcp(Remb(1, 5000, (9,)), 0)
    stage.rtcp(TransportFeedback(1, SSRC, 0, 65535, (0.5, None)), 0)
    stage.rtcp(TransportFeedback(1, SSRC + 1, 0, 0, (0.5,)), 0)
    assert sink.drain_events() == [
        BandwidthEstimate(5000, frozenset((SSRC, 9))),
        Arrivals(((65535, 0.5), (0, None))),
    ]


# The way in


def test_a_retransmission_becomes_the_packet_that_it_repeats() -> None:
    sink = Sink()
    stage = Repairs(sink, SSRC, {97: 96})
    stage.rtp(packet(40, b"\x00\x05payload", payload_type=97, ssrc=8), 0)
    stage.rtp(packet(41, b"\x00", payload_type=97, ssrc=8), 0)
    stage.rtp(packet(6), 0)
    repaired, other = sink.drain_packets()
    assert (repaired.ssrc, repaired.payload_type, repaired.sequence_number) == (SSRC, 96, 5)
    assert (repaired.payload, repaired.is_repair) == (b"payload", True)
    assert other == packet(6)
    assert (stage.repaired, stage.empty) == (1, 1)


def losses(**settings: float) -> tuple[Losses, Sink]:
    sink = Sink()
    return Losses(sink, 1, SSRC, RoundTrip(0.1), LossSettings(**settings)), sink  # type: ignore[arg-type]


def test_what_is_missing_is_asked_for_until_it_comes() -> None:
    stage, sink = losses()
    for number in (65533, 65534, 1):
        stage.rtp(packet(number), 0)
    assert stage.timer() == 0.01
    stage.rtp(packet(0), 0.005)  # only late
    stage.handle_timer(0.01)
    assert sink.drain_controls() == [Nack(1, SSRC, (65535,))]
    stage.handle_timer(0.05)
    assert sink.drain_controls() == []
    stage.handle_timer(0.13)
    assert sink.drain_controls() == [Nack(1, SSRC, (65535,))]
    stage.rtp(packet(65535), 0.15)
    assert stage.timer() is None
    assert numbers(sink) == [65533, 65534, 1, 0, 65535]
    assert stage.lost == 0


def test_what_comes_twice_is_dropped() -> None:
    stage, sink = losses()
    for number in (5, 6, 6, 5, 4):
        stage.rtp(packet(number), 0)
    assert numbers(sink) == [5, 6]
    assert stage.repeated == 3


def test_what_does_not_come_is_given_up_and_told() -> None:
    stage, sink = losses(tries=2)
    stage.rtp(packet(1), 0)
    stage.rtp(packet(3), 0)
    for now in (0.01, 0.2, 0.4):
        stage.handle_timer(now)
    assert len(sink.drain_controls()) == 2
    assert sink.drain_events() == [PacketsGone(SSRC, "late")]
    assert stage.lost == 1
    assert stage.timer() is None


def test_a_gap_that_is_too_large_is_not_asked_for() -> None:
    stage, sink = losses(missing=10)
    for number in (1, 5, 20):
        stage.rtp(packet(number), 0)
    assert sink.drain_events() == [PacketsGone(SSRC, "too_many")]
    assert stage.lost == 17
    assert stage.timer() is None
    stage.handle_timer(1)
    assert sink.controls == []


def receiver_reports() -> tuple[ReceiverReports, Sink]:
    sink = Sink()
    return ReceiverReports(sink, 1, SSRC, 90_000), sink


def test_what_came_is_reported_every_second() -> None:
    stage, sink = receiver_reports()
    assert stage.timer() is None
    for number in (65534, 65535, 1, 2):
        stage.rtp(packet(number), 10)
    stage.rtp(packet(9, ssrc=8), 10)  # a retransmission hides no loss
    assert len(sink.drain_packets()) == 5
    assert stage.timer() == 11
    stage.handle_timer(10.5)
    assert sink.controls == []
    stage.handle_timer(11)
    [report] = sink.drain_controls()
    assert isinstance(report, ReceiverReport)
    [told] = report.blocks
    assert (report.ssrc, told.ssrc) == (1, SSRC)
    assert (told.packets_lost, told.fraction_lost, told.highest_sequence) == (1, 256 // 5, 65536 + 2)
    assert (told.last_report, told.delay) == (0, 0)
    stage.handle_timer(12)
    [report] = sink.drain_controls()
    assert isinstance(report, ReceiverReport)
    assert (report.blocks[0].packets_lost, report.blocks[0].fraction_lost) == (1, 0)


def test_a_report_answers_the_senders() -> None:
    stage, sink = receiver_reports()
    stage.rtp(packet(), 10)
    stage.rtcp(SenderReport(SSRC, 0x1234_5678_9ABC_DEF0, 0, 0, 0), 10.5)
    stage.handle_timer(11)
    [report] = sink.drain_controls()
    assert isinstance(report, ReceiverReport)
    assert (report.blocks[0].last_report, report.blocks[0].delay) == (0x5678_9ABC, 32768)


def test_jitter_is_what_arrival_and_timestamp_differ_by() -> None:
    stage, _ = receiver_reports()
    for number in range(200):
        late = 0.01 if number % 2 else 0.0
        stage.rtp(packet(number, timestamp=(2**32 - 100_000 + number * 3000) % 2**32), number / 30 + late)
    assert 0.009 < stage.jitter < 0.011
    stage.rtp(packet(200, timestamp=2**31), 200 / 30)  # its sender began anew
    assert stage.jitter < 0.011


def test_a_goodbye_ends_the_reports() -> None:
    stage, sink = receiver_reports()
    stage.rtp(packet(), 10)
    stage.rtcp(Goodbye((SSRC + 1,)), 10)
    stage.rtcp(Goodbye((SSRC,)), 10)
    assert sink.events == [StreamEnded(SSRC)]
    assert stage.timer() is None


def test_numbers_unwrap_to_the_nearest() -> None:
    unwrapper = Unwrapper()
    assert [unwrapper.unwrap(x) for x in (65535, 0, 65534, 2, 32770, 1)] == [65535, 65536, 65534, 65538, 32770, 65537]
    assert is_after(0, 65535)
    assert not is_after(65535, 0)
    assert not is_after(5, 5)
