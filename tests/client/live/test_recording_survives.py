"""A console that is killed in the middle of a recording: the file opens, and at most its last second is missing."""

import os
import signal
import time
from pathlib import Path

from lockstep.bench.harness.driving import drive_on
from lockstep.client import Console
from lockstep.server.recording.reading.reader import RecordingReader
from lockstep.server.recording.recording_store import RecordingStore
from lockstep.server.recording.settings import RecordingSettings
from lockstep.server.recording.verify.verify_file import verify_file
from tests.support.stack import running_stack

EVENTS = 200  # some seconds: a file that is younger than `LOST` may be empty
LOST = 1.0  # s, at most
SLOW = 2.0  # s that a busy machine may be late with writing


async def test_a_killed_consoles_recording_opens_and_is_completed(tmp_path: Path) -> None:
    directory = tmp_path / "recordings"
    async with running_stack(tmp_path, extra=("--record", str(directory))) as stack:
        async with Console(stack.operator, codec="H264", name="Ada") as console:
            await console.take_seat()
            for _ in range(EVENTS):
                await drive_on(console, [0.3, 0.0, 0.2])
            os.kill(stack.process.pid, signal.SIGKILL)
            killed = time.time()
            await stack.process.wait()
        log = await stack.records()
    (path,) = directory.glob("*.mcap")
    with RecordingReader(path) as reader:
        assert reader.interrupted
        assert killed - reader.index.ended / 1e6 < LOST + SLOW
        before = reader.index
    executed = {each["event"]: each["time"] for each in log if each["kind"] == "executed"}
    latest = max(executed.values())
    assert before.last_event >= max(event for event, at in executed.items() if at < latest - LOST - SLOW or event == 2)
    assert RecordingStore(directory, RecordingSettings()).recover() == 1
    verdict = verify_file(path)
    assert [name for name, check in verdict.checks.items() if not check.ok] == ["signed"], "it has no closing signature"
    assert verdict.signature.state == "open"
    assert verdict.signature.until_event == before.last_event
