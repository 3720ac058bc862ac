"""A signed recording verifies, and whatever is done to it afterwards is named."""

import random
import zlib
from collections.abc import Callable
from io import BytesIO
from pathlib import Path

import msgspec
import pytest
import zstandard
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Attachment, Channel, Chunk, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import breakup_chunk

from lockstep.server.evidence.signer import Signer
from lockstep.server.recording.errors import RecordingError
from lockstep.server.recording.format.records import SignatureRecord
from lockstep.server.recording.format.signature import RecordingSigning, Signatures
from lockstep.server.recording.format.topics import SIGNATURE
from lockstep.server.recording.reading.bookmarks import Mark
from lockstep.server.recording.reading.raw_records import MAGIC, RawRecord, raw_records
from lockstep.server.recording.reading.reader import RecordingReader
from lockstep.server.recording.reading.scan import complete_file
from lockstep.server.recording.verify.promises import Verdict
from lockstep.server.recording.verify.verify_file import verify_file
from tests.server.recording.makers import INFO, Story
from tests.server.recording.verify.forging import remade

EVENTS = 150
KEY = Signer(Ed25519PrivateKey.generate())
OTHER = Signer(Ed25519PrivateKey.generate())
Block = list[RawRecord]  # a chunk with its message indexes


def signing(signer: Signer = KEY) -> RecordingSigning:
    return RecordingSigning(signer, lambda: "")


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """Of a signed recording."""
    path = tmp_path_factory.mktemp("recordings") / "a.mcap"
    Story(events=EVENTS).write(path, signing=signing())
    return path.read_bytes()


@pytest.fixture
def path(whole: bytes, tmp_path: Path) -> Path:
    path = tmp_path / "a.mcap"
    path.write_bytes(whole)
    return path


def faults(verdict: Verdict) -> str:
    return "\n".join(each.text for each in verdict.checks["signed"].violations)


def rebuilt(path: Path, change: Callable[[list[Block]], list[Block]]) -> None:
    """Other chunks; index, summary and checksums are made to fit by who has no key."""
    with path.open("rb") as file:
        file.seek(len(MAGIC))
        records = list(raw_records(file))
    front = [raw for raw in records if raw.opcode in (Opcode.HEADER, Opcode.METADATA)]
    blocks: list[Block] = []
    for raw in records:
        if raw.opcode == Opcode.CHUNK:
            blocks.append([raw])
        elif raw.opcode == Opcode.MESSAGE_INDEX:
            blocks[-1].append(raw)
        elif raw.opcode == Opcode.DATA_END:
            break
    parts = [*front, *(raw for block in change(blocks) for raw in block)]
    path.write_bytes(
        MAGIC + b"".join(bytes([raw.opcode]) + len(raw.content).to_bytes(8, "little") + raw.content for raw in parts)
    )
    complete_file(path, INFO)


def with_messages(block: Block, change: Callable[[list[Message]], list[Message]], schema_end: bytes = b"") -> Block:
    """The same chunk with other messages or schemas, a checksum that fits, and no message indexes."""
    chunk = Chunk.read(ReadDataStream(BytesIO(block[0].content)))
    parts = breakup_chunk(chunk)
    builder = RecordBuilder()
    messages = [part for part in parts if isinstance(part, Message)]
    for part in parts:
        if isinstance(part, Schema):
            part.data += schema_end
    for part in [*(each for each in parts if not isinstance(each, Message)), *change(messages)]:
        part.write(builder)
    data = builder.end()
    changed = Chunk(
        compression="zstd",
        data=zstandard.compress(data),
        message_start_time=chunk.message_start_time,
        message_end_time=chunk.message_end_time,
        uncompressed_crc=0,
        uncompressed_size=len(data),
    )
    record = RecordBuilder()
    changed.write(record)
    return [RawRecord(Opcode.CHUNK, 0, record.end()[9:])]


def test_a_signed_recording_verifies_names_its_signer_and_is_signed_to_its_end(path: Path) -> None:
    verdict = verify_file(path, KEY.public_key)
    assert verdict.ok, faults(verdict)
    with RecordingReader(path) as reader:
        chunks, ended, last = len(reader.index.chunks), reader.index.ended, reader.index.last_event
    found = verdict.signature
    assert (found.state, found.signer, found.signatures) == ("signed", KEY.public_key, chunks)
    assert (found.until_event, found.until_time) == (last, ended)


@pytest.mark.parametrize("named", [17, 19])
def test_a_signature_names_the_event_of_the_last_feedback_whatever_the_records_behind_it_name(named: int) -> None:
    """A command names the event that it asks for, a report one that a peer has heard of."""
    signatures = Signatures(signing(), INFO, [], "")
    signatures.add("/lockstep/feedback", 18, 1, 1, b"{}", feedback=True)
    signatures.add("/lockstep/command", named, 2, 2, b"{}", feedback=False)
    assert signatures.sign(final=False).event == 18


def test_the_file_stays_one_that_the_mcap_library_reads_with_a_schema_for_the_signatures(path: Path) -> None:
    with path.open("rb") as stream:
        found = [message.data for _, _, message in make_reader(stream, validate_crcs=True).iter_messages([SIGNATURE])]
    records = [msgspec.json.decode(data, type=SignatureRecord) for data in found]
    assert [record.number for record in records] == list(range(1, len(records) + 1))
    assert [record.final for record in records] == [False] * (len(records) - 1) + [True]


def content(path: Path) -> list[tuple[str, int, int, bytes]]:
    with path.open("rb") as stream:
        found = make_reader(stream).iter_messages(log_time_order=False)
        return [(channel.topic, each.log_time, each.publish_time, each.data) for _, channel, each in found]


def test_any_flipped_byte_is_named_wherever_it_lies(whole: bytes, path: Path) -> None:
    """Behind the header, which says who wrote the library. Bits that the compression does not use change nothing."""
    meant = content(path)
    places = random.Random(7)
    start = whole.index(b"lockstep") + 8 + 16
    for _ in range(60):
        at = places.randrange(start, len(whole))
        flipped = bytearray(whole)
        flipped[at] ^= 1 << places.randrange(8)
        path.write_bytes(flipped)
        try:
            verdict = verify_file(path)
        except RecordingError:
            continue
        assert not verdict.ok or content(path) == meant, f"byte {at} of {len(whole)}"


def test_a_byte_that_changed_in_the_part_that_other_readers_begin_with_is_named(whole: bytes, path: Path) -> None:
    start, end = int.from_bytes(whole[-20:-12], "little"), len(whole) - len(MAGIC) - 4  # of the summary's offsets
    for at in range(start, end, 3):
        flipped = bytearray(whole)
        flipped[at] ^= 0x10
        path.write_bytes(flipped)
        try:
            verdict = verify_file(path)
        except RecordingError:
            continue
        assert not verdict.ok, f"byte {at - start} of {end - start}"


def test_a_chunk_that_cannot_be_read_is_named_and_those_behind_it_are_judged(whole: bytes, path: Path) -> None:
    """Its compression has a name longer than the chunk."""
    with path.open("rb") as file:
        file.seek(len(MAGIC))
        offset = [raw.offset for raw in raw_records(file) if raw.opcode == Opcode.CHUNK][3]
    changed = bytearray(whole)
    changed[offset + 9 + 28 : offset + 9 + 32] = b"\xff\xff\xff\x7f"
    path.write_bytes(changed)
    named = faults(verify_file(path))
    assert f"the record at byte {offset} cannot be read" in named
    assert "another time" not in named


def test_an_index_that_shows_what_nobody_recorded_or_hides_it_is_named(path: Path) -> None:
    path.unlink()
    writer = Story(events=EVENTS).write(path, close=False, signing=signing())
    mark = Mark(50, 0, "stop", "Mallory")
    writer._builder.index = msgspec.structs.replace(writer._builder.index, marks=[mark], first_event=3)
    writer.close()
    assert faults(verify_file(path)).splitlines() == [
        "the index has other first event than the records",
        "the index has other marks than the records",
    ]


def _hidden_from(raw: RawRecord, at: int) -> RawRecord:
    """The same, with the time of its first message (at byte `at`) behind that of its last."""
    content = bytearray(raw.content)
    content[at : at + 8] = (2**62).to_bytes(8, "little")
    return RawRecord(raw.opcode, raw.offset, bytes(content))


def test_a_chunk_that_hides_from_who_looks_for_its_time_is_named(path: Path) -> None:
    rebuilt(path, lambda blocks: [[_hidden_from(blocks[0][0], 0), *blocks[0][1:]], *blocks[1:]])
    assert "chunk 0 gives another time than its messages have" in faults(verify_file(path))


def test_a_summary_that_hides_a_chunk_from_who_looks_for_its_time_is_named(whole: bytes, path: Path) -> None:
    with path.open("rb") as file:
        file.seek(len(MAGIC))
        records = list(raw_records(file))
    changed, summary = bytearray(whole), bytearray()
    index = next(raw for raw in records if raw.opcode == Opcode.CHUNK_INDEX)
    changed[index.offset + 9 : index.offset + 17] = (2**62).to_bytes(8, "little")
    end = next(raw for raw in records if raw.opcode == Opcode.DATA_END)
    footer = next(raw for raw in records if raw.opcode == Opcode.FOOTER)
    behind = end.offset + 9 + len(end.content)
    at = footer.offset + 9 + len(footer.content) - 4
    summary += changed[behind:at]
    changed[at : at + 4] = zlib.crc32(summary).to_bytes(4, "little")
    path.write_bytes(changed)
    assert faults(verify_file(path)) == "the summary gives chunks another time than their messages have"


def test_a_chunk_that_was_taken_out_is_named(path: Path) -> None:
    rebuilt(path, lambda blocks: [*blocks[:2], *blocks[3:]])
    verdict = verify_file(path)
    assert verdict.signature.state == "broken"
    assert "chunks were removed: signature 4 comes after signature 2" in faults(verdict)


def test_chunks_that_changed_places_are_named(path: Path) -> None:
    rebuilt(path, lambda blocks: [blocks[0], blocks[2], blocks[1], *blocks[3:]])
    assert "chunks were reordered or repeated" in faults(verify_file(path))


def test_a_message_that_was_changed_taken_out_put_in_or_moved_is_named_even_with_a_checksum_that_fits(
    path: Path, whole: bytes
) -> None:
    def edited(messages: list[Message]) -> list[Message]:
        picture = next(each for each in messages if not each.data.startswith(b"{"))
        picture.data = picture.data[:-1] + bytes([picture.data[-1] ^ 1])
        return messages

    def later(messages: list[Message]) -> list[Message]:
        messages[3].publish_time += 1
        return messages

    changes: list[Callable[[list[Message]], list[Message]]] = [
        edited,
        later,
        lambda messages: [*messages[:3], *messages[4:]],
        lambda messages: [*messages[:3], messages[3], *messages[3:]],
        lambda messages: [*messages[:3], messages[4], messages[3], *messages[5:]],
    ]
    for change in changes:
        path.write_bytes(whole)
        rebuilt(path, lambda blocks, change=change: [*blocks[:2], with_messages(blocks[2], change), *blocks[3:]])  # type: ignore[misc]
        assert "are not those that were signed" in faults(verify_file(path))


def test_what_was_put_behind_the_signature_of_a_chunk_is_named(path: Path) -> None:
    rebuilt(path, lambda blocks: [*blocks[:2], with_messages(blocks[2], lambda found: [*found, found[0]]), *blocks[3:]])
    assert "the end of chunk 2 is not signed" in faults(verify_file(path))


def _raw(opcode: Opcode, record: McapRecord) -> RawRecord:
    builder = RecordBuilder()
    record.write(builder)
    return RawRecord(opcode, 0, builder.end()[9:])


def _message(block: Block) -> Message:
    parts = breakup_chunk(Chunk.read(ReadDataStream(BytesIO(block[0].content))))
    return next(each for each in parts if isinstance(each, Message))


@pytest.mark.parametrize(
    ("opcode", "record", "named"),
    [
        (Opcode.MESSAGE, None, "is outside of all chunks and not signed"),
        (Opcode.METADATA, Metadata(name="x", metadata={"a": "b"}), "metadata is not signed"),
        (
            Opcode.ATTACHMENT,
            Attachment(log_time=1, create_time=1, name="x", media_type="text/plain", data=b"x"),
            "an attachment is not signed",
        ),
        (Opcode.SCHEMA, Schema(id=900, name="x", encoding="", data=b""), "the schema x is not signed"),
        (
            Opcode.CHANNEL,
            Channel(id=900, topic="/x", message_encoding="json", metadata={}, schema_id=1),
            "the topic /x is not signed",
        ),
    ],
    ids=lambda value: value.name if isinstance(value, Opcode) else "",
)
def test_what_was_put_outside_of_the_chunks_is_named(
    path: Path, opcode: Opcode, record: McapRecord | None, named: str
) -> None:
    found: list[Block] = []
    rebuilt(path, lambda blocks: found.extend(blocks) or blocks)  # type: ignore[func-returns-value]
    remade(path, [_raw(opcode, record or _message(found[2]))])
    assert named in faults(verify_file(path))


def test_a_topic_and_a_schema_that_were_said_anew_in_another_way_are_named(path: Path) -> None:
    with path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    schema, channel = next(iter(summary.schemas.values())), next(iter(summary.channels.values()))
    schema.data += b" "
    channel.topic += "x"
    others = [_raw(Opcode.SCHEMA, schema), _raw(Opcode.CHANNEL, channel)]
    remade(path, others)
    found = faults(verify_file(path))
    assert f"the schema {schema.name} differs from the signed one" in found
    assert f"the topic {channel.topic} differs from the signed one" in found


def test_an_index_that_leads_elsewhere_is_named(path: Path, whole: bytes) -> None:
    for opcode, place, named in [
        (Opcode.MESSAGE_INDEX, -1, "the message index of chunk"),
        (Opcode.CHUNK_INDEX, 16, "the summary names other chunks than the file has"),
    ]:

        def elsewhere(raw: RawRecord, opcode: Opcode = opcode, place: int = place) -> RawRecord:
            if raw.opcode != opcode:
                return raw
            content = bytearray(raw.content)
            content[place] ^= 1
            return raw._replace(content=bytes(content))

        path.write_bytes(whole)
        remade(path, [], elsewhere)
        assert named in faults(verify_file(path))


def test_a_schema_that_was_changed_in_every_chunk_is_not_the_one_that_was_signed(path: Path) -> None:
    rebuilt(path, lambda blocks: [with_messages(block, lambda messages: messages, b" ") for block in blocks])
    assert "are not those that were signed" in faults(verify_file(path))


def test_a_signature_that_was_moved_in_time_is_named(path: Path) -> None:
    def later(messages: list[Message]) -> list[Message]:
        messages[-1].log_time += 1
        return messages

    rebuilt(path, lambda blocks: [*blocks[:2], with_messages(blocks[2], later), *blocks[3:]])
    assert "stands at another event or time than it says" in faults(verify_file(path))


def test_a_tail_that_was_cut_off_is_named_with_the_event_up_to_which_it_is_signed(path: Path) -> None:
    rebuilt(path, lambda blocks: blocks[:-2])
    verdict = verify_file(path)
    assert verdict.signature.state == "open"
    assert not verdict.ok
    assert "the closing signature is missing" in faults(verdict)
    with RecordingReader(path) as reader:
        assert verdict.signature.until_event == reader.index.last_event
        assert verdict.signature.until_time == reader.index.ended


def test_an_interrupted_recording_is_signed_up_to_its_last_chunk(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    writer = Story(events=EVENTS).write(path, close=False, signing=signing())
    writer.abandon()
    complete_file(path, INFO)
    verdict = verify_file(path)
    assert (verdict.signature.state, verdict.signature.signer) == ("open", KEY.public_key)
    assert [name for name, check in verdict.checks.items() if not check.ok] == ["signed"]


def test_another_signer_than_the_one_that_is_asked_for_is_named(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    Story(events=EVENTS).write(path, signing=signing(OTHER))
    assert verify_file(path).signature.signer == OTHER.public_key
    verdict = verify_file(path, KEY.public_key)
    assert f"signed by {OTHER.public_key}, not by {KEY.public_key}" in faults(verdict)


def test_who_makes_all_anew_under_a_name_that_is_not_theirs_has_signed_nothing(tmp_path: Path) -> None:
    liar = Signer(Ed25519PrivateKey.generate())
    liar.public_key = KEY.public_key
    path = tmp_path / "a.mcap"
    Story(events=EVENTS).write(path, signing=signing(liar))
    verdict = verify_file(path, KEY.public_key)
    assert not verdict.ok
    assert f"signature 1 is not one of {KEY.public_key}: it was changed or forged" in faults(verdict)


def test_a_stranger_who_signs_changed_chunks_anew_is_another_key(path: Path, tmp_path: Path) -> None:
    forged = tmp_path / "forged.mcap"
    Story(events=EVENTS, force_at=60).write(forged, signing=signing(OTHER))
    theirs: list[list[Block]] = []
    rebuilt(forged, lambda blocks: theirs.append(blocks) or blocks)  # type: ignore[func-returns-value]
    rebuilt(path, lambda blocks: [*blocks[:2], *theirs[0][2:]])
    assert "is of another key" in faults(verify_file(path))


def test_an_unsigned_recording_is_said_to_be_one_and_fails_only_where_a_key_is_asked_for(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    Story(events=40).write(path)
    verdict = verify_file(path)
    assert (verdict.ok, verdict.signature.state) == (True, "unsigned")
    assert faults(verify_file(path, KEY.public_key)) == "the recording is not signed"


def test_metadata_that_was_changed_is_named(path: Path, whole: bytes) -> None:
    path.write_bytes(whole.replace(b"Ada", b"Bob", 1))
    assert "are not those that were signed" in faults(verify_file(path))
