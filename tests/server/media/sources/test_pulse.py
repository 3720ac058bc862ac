"""PulseAudio: what the loudspeaker plays is heard as a microphone."""

import asyncio
import time
from pathlib import Path

import numpy as np
import pytest

from lockstep.bench.browsers.sound_card import running_sound_card, tone_level
from lockstep.server.media.pulse_audio import PulseStream
from lockstep.server.media.sources.attached_source import AttachedSource
from lockstep.server.media.sources.source_url import parse_source
from lockstep.server.media.sources.source_wire import Captured
from tests.server.media.sources.media_files import tone


async def test_a_pulse_source_gives_its_sound_with_a_time_that_is_not_too_late(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with running_sound_card(tmp_path) as card:
        monkeypatch.setenv("PULSE_SERVER", card.environment["PULSE_SERVER"])
        playing = await asyncio.create_subprocess_exec(
            "paplay", "--device=ears", str(tone(tmp_path / "tone.wav", 440.0, 8.0)), env=card.environment
        )
        heard: list[Captured] = []
        enough = asyncio.Event()

        def capture(medium: Captured) -> None:
            assert medium.time + 0.02 <= time.monotonic()
            heard.append(medium)
            if len(heard) == 100:
                enough.set()

        spec = parse_source("audio", "pulse:ears.monitor")
        source = AttachedSource(spec, capture, lambda: None, lambda reason: None)
        task = asyncio.create_task(source.run())
        try:
            async with asyncio.timeout(20):
                await enough.wait()
        finally:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)
            playing.terminate()
            await playing.wait()
        sound = np.frombuffer(b"".join(medium.payload for medium in heard), np.int16)
        assert tone_level(sound, 440.0) > 0.1


def test_without_a_server_it_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PULSE_SERVER", "unix:/nowhere")
    with pytest.raises(OSError, match="Connection refused"):
        PulseStream.recording("", 48_000, 1, 960)
