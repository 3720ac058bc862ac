"""A sound card for a test: a separate PulseAudio server with one silent loudspeaker that can be recorded."""

import asyncio
import os
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

__all__ = ["SAMPLE_RATE", "Heard", "SoundCard", "running_sound_card", "tick_times", "tone_level"]

SAMPLE_RATE = 48000
READY_TRIES = 100
WINDOW = SAMPLE_RATE // 20  # samples
CHUNK = 4096  # bytes
LISTENING_MS = 5  # that parec is asked to keep back at most
LOUD = 0.05  # of full scale: a tick, and not what an encoder makes of silence
QUIET_SECONDS = 0.1  # before each tick


class Heard(NamedTuple):
    """Recorded sound, mono, at `SAMPLE_RATE`. `began`: s on the monotonic clock, at its first sample."""

    samples: npt.NDArray[np.int16]
    began: float


class SoundCard:
    """A sound card; `environment` makes a program use it."""

    def __init__(self, socket: Path) -> None:
        self.environment = os.environ | {"PULSE_SERVER": f"unix:{socket}"}

    async def record(self, seconds: float) -> npt.NDArray[np.int16]:
        """Return the sound that the loudspeaker plays from now on, mono, at `SAMPLE_RATE`."""
        process = await asyncio.create_subprocess_exec(
            *("parec", "--device=ears.monitor", "--format=s16le", f"--rate={SAMPLE_RATE}", "--channels=1", "--raw"),
            stdout=asyncio.subprocess.PIPE,
            env=self.environment,
        )
        if process.stdout is None:
            raise RuntimeError("parec has no output")
        try:
            async with asyncio.timeout(seconds + 20):
                data = await process.stdout.readexactly(int(seconds * SAMPLE_RATE) * 2)
        finally:
            process.terminate()
            await process.communicate()
        return np.frombuffer(data, np.int16)

    async def listen(self, seconds: float) -> Heard:
        """Record as `record` does, and tell when. No sample arrives before it is played; the quickest one says when."""
        process = await asyncio.create_subprocess_exec(
            *("parec", "--device=ears.monitor", "--format=s16le", f"--rate={SAMPLE_RATE}", "--channels=1", "--raw"),
            f"--latency-msec={LISTENING_MS}",
            stdout=asyncio.subprocess.PIPE,
            env=self.environment,
        )
        if process.stdout is None:
            raise RuntimeError("parec has no output")
        data, began = bytearray(), float("inf")
        try:
            async with asyncio.timeout(seconds + 20):
                while len(data) < int(seconds * SAMPLE_RATE) * 2:
                    chunk = await process.stdout.read(CHUNK)
                    if not chunk:
                        raise RuntimeError("parec ended")
                    data += chunk
                    began = min(began, time.monotonic() - len(data) / 2 / SAMPLE_RATE)
        finally:
            process.terminate()
            await process.communicate()
        return Heard(np.frombuffer(bytes(data[: len(data) // 2 * 2]), np.int16), began)

    async def hears(self, frequency: float, level: float, within: float = 20.0) -> bool:
        """Return whether the tone is played at `level` for a second on end, some time in the next `within` seconds."""
        for _ in range(int(within)):
            if tone_level(await self.record(1.0), frequency) >= level:
                return True
        return False


def tone_level(samples: npt.NDArray[np.int16], frequency: float) -> float:
    """Return the amplitude of one tone, 0 to 1 of full scale: the discrete Fourier transform at `frequency` in windows.

    Receivers shift the phase whenever they stretch or conceal sound, so only the windows' amplitudes are averaged.
    """
    whole = samples[: samples.size - samples.size % WINDOW].reshape(-1, WINDOW) / 32768
    wave = np.exp(-2j * np.pi * frequency * np.arange(WINDOW) / SAMPLE_RATE)
    return float(np.mean(abs(whole @ wave) / WINDOW * 2))


def tick_times(heard: Heard) -> list[float]:
    """Return when short sounds began, in s on the monotonic clock."""
    loud = np.flatnonzero(np.abs(heard.samples.astype(np.int32)) > LOUD * 32768)
    if loud.size == 0:
        return []
    first = np.concatenate(([True], np.diff(loud) > QUIET_SECONDS * SAMPLE_RATE))
    return [heard.began + float(at) / SAMPLE_RATE for at in loud[first]]


@asynccontextmanager
async def running_sound_card(directory: Path) -> AsyncIterator[SoundCard]:
    """Start the server, wait until it answers, and end it on leaving."""
    socket = directory / "card.socket"
    process = await asyncio.create_subprocess_exec(
        *("pulseaudio", "-n", "--daemonize=no", "--exit-idle-time=-1", "--use-pid-file=no", "--disable-shm=yes"),
        *("-L", f"module-native-protocol-unix auth-anonymous=1 socket={socket}"),
        *("-L", "module-null-sink sink_name=ears"),
        stderr=asyncio.subprocess.DEVNULL,
        env=os.environ | {"HOME": str(directory), "XDG_RUNTIME_DIR": str(directory)},
    )
    try:
        card = SoundCard(socket)
        await _until_it_answers(card)
        yield card
    finally:
        process.terminate()
        await process.wait()


async def _until_it_answers(card: SoundCard) -> None:
    for _ in range(READY_TRIES):
        probe = await asyncio.create_subprocess_exec(
            *("pactl", "info"),
            stdout=asyncio.subprocess.DEVNULL,
            stderr=asyncio.subprocess.DEVNULL,
            env=card.environment,
        )
        if await probe.wait() == 0:
            return
    raise RuntimeError("PulseAudio did not start")
