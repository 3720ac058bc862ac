"""`lockstep export --to rerun`: a file for Rerun's viewer, .rrd. Needs rerun-sdk."""

from pathlib import Path

from lockstep.server.recording.errors import RecordingDamaged
from lockstep.server.recording.export.lerobot_rows import episodes_now
from lockstep.server.recording.export.rerun.session_log import Moment, SessionLog, new_stream
from lockstep.server.recording.export.unfinished import unfinished_file
from lockstep.server.recording.format.payload import own_record_of
from lockstep.server.recording.format.topics import CAMERA, OWN_TOPICS, SIGNATURE, WRENCH
from lockstep.server.recording.reading.kept_records import KeptRecords
from lockstep.server.recording.reading.reader import RecordingReader

__all__ = ["export"]

READ = set(OWN_TOPICS.values()) - {SIGNATURE, WRENCH}


def export(path: Path, out: Path | None, task: str, *, kept: bool = False) -> list[Path]:
    """Write and return the file: `out`, or one beside `path`. `kept`: what is of kept episodes alone.

    Raises:
        RecordingError, OSError: it cannot be read or written.
    """
    target = out or path.with_suffix(".rrd")
    with (
        RecordingReader(path) as reader,
        unfinished_file(target) as partial,
        partial.open("wb"),  # an OSError here says what Rerun would only log
    ):
        stream = new_stream(reader.info.recording, reader.info.epoch)
        stream.save(str(partial))
        try:
            _write(reader, SessionLog(stream), KeptRecords(episodes_now(reader)) if kept else None)
            stream.flush()
        except (OverflowError, ValueError) as error:
            raise RecordingDamaged(f"{path.name}: Rerun has no such value: {error}") from error
        finally:
            stream.disconnect()
    return [target]


def _write(reader: RecordingReader, session: SessionLog, kept_records: KeptRecords | None) -> None:
    session.begin(reader.description())
    for record in reader.records():
        if kept_records is not None and not kept_records.takes(record):
            session.leave_out(record.topic)
            continue
        at = Moment(record.event, record.arrived, record.captured)
        if record.topic.startswith(CAMERA):
            picture = record.picture
            if picture is not None:
                camera = record.topic.removeprefix(CAMERA)
                session.picture(camera, picture.format, picture.data, at, keyframe=picture.keyframe)
        elif record.topic in READ:
            own = own_record_of(record.schema, record.data)
            if own is not None:
                session.own(own, at)
    session.flush()
