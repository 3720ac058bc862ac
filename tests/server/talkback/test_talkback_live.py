"""A voice on its way through a whole console, from an Opus sender to a file and to a sound card."""

import asyncio
import contextlib
import wave
from collections.abc import AsyncIterator
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import httpx
import numpy as np
import pytest
from aiortc import AudioStreamTrack

from lockstep.bench.browsers.sound_card import SoundCard, running_sound_card, tone_level
from lockstep.protocol.console import SeatRelease, SeatRequest, Voice, Welcome
from tests.server.rig import Rig, TestPeer, eventually, running_rig

TONE = 440.0
RATE = 48_000


class Tone(AudioStreamTrack):
    """20 ms at a time, in real time; silent packets are still packets."""

    async def recv(self) -> Any:
        frame: Any = await super().recv()
        start = frame.pts * RATE // frame.sample_rate if frame.pts is not None else 0
        phase = (start + np.arange(RATE // 50)) * TONE * 2 * np.pi / RATE
        sound = av.AudioFrame.from_ndarray((np.sin(phase) * 9000).astype(np.int16).reshape(1, -1), "s16", "mono")
        sound.sample_rate, sound.pts, sound.time_base = RATE, start, Fraction(1, RATE)
        return sound


@contextlib.asynccontextmanager
async def speaking(rig: Rig, role: Any) -> AsyncIterator[TestPeer]:
    """A peer that sends a tone from the start."""
    peer = TestPeer()
    try:
        peer.pc.addTransceiver(Tone(), direction="sendonly")
        await peer.join(rig, rig.token(role), ("control", "session", "stop"))
        yield peer
    finally:
        await peer.close()


async def seated(peer: TestPeer) -> str:
    welcome = await peer.until(lambda each: isinstance(each, Welcome))
    assert isinstance(welcome, Welcome)
    peer.send("session", SeatRequest())
    return welcome.peer


HEADER = 44  # bytes; a file is there before its header is


def heard(path: Path) -> np.ndarray[Any, np.dtype[np.int16]]:
    if not path.exists() or path.stat().st_size < HEADER:
        return np.zeros(0, np.int16)
    with wave.open(str(path)) as file:
        data = file.readframes(file.getnframes())
        return np.frombuffer(data[: len(data) // 2 * 2], np.int16)


async def loudest(card: SoundCard) -> float:
    """Level of the tone in the best twentieth of a second of some; a machine that is busy leaves much of it out."""
    best = 0.0
    for _ in range(8):
        sound = await card.record(1.0)
        best = max(best, *(tone_level(part, TONE) for part in np.split(sound, 20)))
        if best > 0.05:
            break
    return best


async def test_who_holds_the_seat_is_heard_and_nobody_else(tmp_path: Path) -> None:
    path = tmp_path / "heard.wav"
    async with running_rig(speaker=f"file:{path}") as rig, speaking(rig, "operator") as peer:
        assert (await rig.session())["voice"] is True
        await eventually(lambda: rig.count("lockstep_voice_packets_total", outcome="no_seat") > 10)
        assert rig.count("lockstep_voice_packets_total", outcome="played") == 0
        me = await seated(peer)
        told = await peer.until(lambda each: isinstance(each, Voice) and each.peer == me)
        assert isinstance(told, Voice)
        assert told.name == "operator"
        await eventually(lambda: heard(path).size > RATE // 4)
        peer.send("session", SeatRelease())
        await eventually(lambda: rig.count("lockstep_voice_speaking") == 0)
        silent_from = rig.count("lockstep_voice_packets_total", outcome="played")
        await eventually(lambda: rig.count("lockstep_voice_packets_total", outcome="no_seat") > 40)
        assert rig.count("lockstep_voice_packets_total", outcome="played") == silent_from
        sound = heard(path)
        assert tone_level(sound[: RATE // 4], TONE) > 0.05
        assert sound.size <= (silent_from + 1) * RATE // 50  # nothing was made up


async def test_the_voice_is_played_by_pulseaudio(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    async with running_sound_card(tmp_path) as card:
        monkeypatch.setenv("PULSE_SERVER", card.environment["PULSE_SERVER"])
        async with running_rig(speaker="pulse:ears") as rig, speaking(rig, "operator") as peer:
            await seated(peer)
            await eventually(lambda: rig.count("lockstep_voice_speaking") == 1)
            assert await loudest(card) > 0.05


async def test_a_speaker_that_does_not_work_is_told_to_everyone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PULSE_SERVER", "unix:/nowhere")
    async with running_rig(speaker="pulse:") as rig, rig.peer("observer", "session") as peer:
        told = await peer.until(lambda each: isinstance(each, Voice) and bool(each.trouble))
        assert isinstance(told, Voice)
        assert told.trouble == "PulseAudio: Connection refused"
        assert rig.count("lockstep_voice_speaker_works") == 0


@pytest.mark.parametrize(("role", "speaker"), [("observer", "file:x.wav"), ("operator", None)])
async def test_nobodys_voice_is_taken_without_a_speaker_and_no_observers_ever(
    role: Any, speaker: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    async with running_rig(speaker=speaker) as rig, speaking(rig, role) as peer:
        welcome = await peer.until(lambda each: isinstance(each, Welcome))
        assert isinstance(welcome, Welcome)
        assert welcome.voice == ""
        assert "a=inactive" in peer.pc.remoteDescription.sdp
        await asyncio.sleep(0)
        assert rig.count("lockstep_voice_packets_total", outcome="no_seat") == 0


async def test_the_page_may_ask_for_the_microphone_and_nothing_else() -> None:
    async with running_rig() as rig:
        answer: httpx.Response = await rig.http.get("/")
        policy = answer.headers["permissions-policy"]
        assert "microphone=(self)" in policy
        assert "camera=()" in policy
