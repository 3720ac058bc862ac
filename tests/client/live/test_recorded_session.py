"""A session over the emulated Hong Kong network is recorded; every record is what the bridge's own log says."""

import asyncio
import json
import random
from pathlib import Path
from typing import Any, NamedTuple

import av
import pytest

from lockstep.bench.harness.driving import drive_on
from lockstep.client import Console
from lockstep.emulator import Network, load_profile
from lockstep.protocol.traces.trace import known_spans
from lockstep.robot_bridge.robots.event_strip import read_event_strip
from lockstep.server.cli.access.audit import verify_audit
from lockstep.server.evidence.anchors import parse_anchor
from lockstep.server.evidence.signer import evidence_signer
from lockstep.server.recording.format.payload import own_record_of
from lockstep.server.recording.format.records import CommandRecord, FeedbackRecord, TraceRecord
from lockstep.server.recording.reading.reader import Record, RecordingReader
from lockstep.server.recording.verify.verify_file import verify_file
from lockstep.server.util.state_dir import StateDir
from tests.client.live.truth import until_logged
from tests.support.stack import Stack, running_stack

EVENTS = 60
LOOK_AHEAD = 0.0065  # s, of Opus: a packet's stamp is that of what its decoder gives out
SEGMENT = 0.02  # s, of the microphone
SAME = 2e-6  # s; times in the file are rounded
QUICKER = 0.01  # s by which a picture may come sooner than the clocks' mapping allows: its time is that of its arrival


class Session(NamedTuple):
    recording: Path
    state: Path  # the console's directory
    log: list[dict[str, Any]]


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Session:
    """Two cameras and sound, driven to and fro, recorded from the console's start to its end."""
    return asyncio.run(_recorded(tmp_path_factory.mktemp("session")))


async def _recorded(directory: Path) -> Session:
    recordings = directory / "recordings"
    async with running_stack(directory, extra=("--record", str(recordings))) as stack:
        await _drive(stack)
        newest = max(record["event"] for record in await stack.events("executed"))
        await until_logged(stack, "feedback", lambda record: record["event"] >= newest)
        log = await stack.records()
    (path,) = recordings.glob("*.mcap")
    return Session(path, directory / "state", log)


async def _drive(stack: Stack) -> None:
    async with (
        Network(load_profile("hong-kong"), console_url=stack.console, seed=4) as network,
        Console(network.link(stack.operator), codec="H264", name="Ada") as console,
    ):
        await console.take_seat()
        for number in range(EVENTS):
            await drive_on(console, [0.3 if number // 15 % 2 == 0 else -0.3, 0.0, 0.2])


def test_the_recording_keeps_every_promise(session: Session) -> None:
    verdict = verify_file(session.recording)
    assert verdict.ok, json.dumps({name: str(check.violations) for name, check in verdict.checks.items()}, indent=1)
    assert verdict.events >= EVENTS
    assert verdict.checks["stamps"].looked > EVENTS


def test_it_is_signed_with_the_consoles_key_to_its_end_and_a_flipped_byte_is_named(
    session: Session, tmp_path: Path
) -> None:
    signer = evidence_signer(StateDir(session.state))
    found = verify_file(session.recording, signer.public_key).signature
    assert found.state == "signed"
    anchor = parse_anchor(found.audit)
    assert anchor is not None
    assert (anchor.log, anchor.key) == ("audit", signer.public_key)
    data = bytearray(session.recording.read_bytes())
    data[len(data) // 2] ^= 1
    flipped = tmp_path / "flipped.mcap"
    flipped.write_bytes(data)
    verdict = verify_file(flipped)
    assert verdict.signature.state == "broken"
    assert "chunk" in verdict.checks["signed"].violations[0].text


def test_the_audit_is_held_against_the_signed_heads_in_the_recording(session: Session, tmp_path: Path) -> None:
    key = evidence_signer(StateDir(session.state)).public_key
    good = verify_audit(session.state / "audit.jsonl", "", session.recording, key)
    assert good.ok
    assert good.anchors.fitting
    cut = tmp_path / "audit.jsonl"
    cut.write_bytes(b"")
    found = verify_audit(cut, "", session.recording, key)
    assert {fault.kind for fault in found.own.faults} == {"cut"}


def test_at_ten_random_events_command_feedback_pictures_and_sound_are_those_with_that_reference(
    session: Session,
) -> None:
    with RecordingReader(session.recording) as reader:
        records = list(reader.records())
    executed = {each["event"]: each for each in session.log if each["kind"] == "executed"}
    answered = {(each["event"], each["issue"]) for each in session.log if each["kind"] == "feedback"}
    times = _bridge_times(records)
    drawn = _drawn_events(records)
    events = random.Random(1).sample(sorted(executed), 10)
    pictures = 0
    for event in events:
        found = [(index, record) for index, record in enumerate(records) if record.event == event]
        own = [own_record_of(record.schema, record.data) for _, record in found]
        command = next(each for each in own if isinstance(each, CommandRecord) and each.outcome == "forwarded")
        feedback = next(each for each in own if isinstance(each, FeedbackRecord))
        assert (command.values, command.issue) == (executed[event]["values"], executed[event]["issue"])
        assert (feedback.event, feedback.issue) in answered
        for index, record in found:
            if record.topic.startswith("/camera/"):
                pictures += 1
                assert drawn[index] in (event, None)  # unreadable where the path left few bits
                early = QUICKER if record.captured == record.arrived else 0.0
                assert _is_logged(session, record.topic.removeprefix("/camera/"), event, times[index], early)
            elif record.topic.startswith("/microphone/"):
                assert _is_heard(session, record.topic.removeprefix("/microphone/"), event, times[index])
    assert pictures >= 10


def test_every_picture_shows_the_event_that_it_is_stamped_with(session: Session) -> None:
    with RecordingReader(session.recording) as reader:
        assert set(reader.index.keyframes) == {"/camera/overview", "/camera/front"}
        records = list(reader.records())
    drawn = _drawn_events(records)
    assert len(drawn) > EVENTS
    readable = {index: event for index, event in drawn.items() if event is not None}  # few bits draw it badly
    assert len(readable) > 0.9 * len(drawn)
    assert {index: records[index].event for index in readable} == readable


def _drawn_events(records: list[Record]) -> dict[int, int | None]:
    """Read from the pixels, by index of the record."""
    decoders: dict[str, av.VideoCodecContext] = {}
    found: dict[int, int | None] = {}
    for index, record in enumerate(records):
        if record.topic.startswith("/camera/"):
            if record.topic not in decoders:
                decoders[record.topic] = av.CodecContext.create("h264", "r")
            for frame in decoders[record.topic].decode(av.Packet(record.payload)):
                found[index] = read_event_strip(frame.to_ndarray(format="gray"))
    return found


def _bridge_times(records: list[Record]) -> dict[int, float]:
    """When each was captured, in s on the bridge's own clock: by the feedback before it."""
    found: dict[int, float] = {}
    offset: float | None = None
    for index, record in enumerate(records):
        own = own_record_of(record.schema, record.data)
        if isinstance(own, FeedbackRecord):
            offset = record.captured - own.time * 1e9
        elif offset is not None:
            found[index] = (record.captured - offset) / 1e9
    return found


def _is_logged(session: Session, stream: str, event: int, captured: float, early: float) -> bool:
    return any(
        each["kind"] == "media"
        and each["stream"] == stream
        and each["event"] == event
        and -SAME < each["captured"] - captured < SAME + early
        for each in session.log
    )


def _is_heard(session: Session, stream: str, event: int, captured: float) -> bool:
    """Whether the sound at `captured` lies in a segment that the bridge stamped so."""
    return any(
        each["kind"] == "media"
        and each["stream"] == stream
        and each["event"] == event
        and -SAME <= captured - each["captured"] <= SEGMENT + LOOK_AHEAD
        for each in session.log
    )


def test_every_executed_event_says_where_its_time_went(session: Session) -> None:
    commands: set[int] = set()
    pictures: set[int] = set()
    with RecordingReader(session.recording) as reader:
        for record in reader.records():
            match own_record_of(record.schema, record.data):
                case TraceRecord(stream="") as trace:
                    assert {"forward_ms", "link_ms", "tick_wait_ms", "measure_ms"} <= known_spans(trace.command).keys()
                    commands.add(trace.event)
                case TraceRecord() as trace:
                    assert {"capture_ms", "link_wait_ms", "encode_ms"} <= known_spans(trace.picture).keys()
                    pictures.add(trace.event)
    executed = {line["event"] for line in session.log if line["kind"] == "executed"}
    assert commands == executed
    assert len(pictures & executed) > EVENTS / 2
