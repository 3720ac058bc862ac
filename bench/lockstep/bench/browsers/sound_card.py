"""A sound card for a test: a separate PulseAudio server with one silent loudspeaker that can be recorded."""

import asyncio
import os
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import numpy as np
import numpy.typing as npt

__all__ = ["SAMPLE_RATE", "SoundCard", "running_sound_card", "tone_level"]

SAMPLE_RATE = 48000
READY_TRIES = 100
WINDOW = SAMPLE_RATE // 20  # samples


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
