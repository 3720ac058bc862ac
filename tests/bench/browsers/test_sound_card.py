"""The ear that the browser tests listen with."""

import numpy as np
import numpy.typing as npt

from lockstep.bench.browsers.sound_card import SAMPLE_RATE, Heard, tick_times, tone_level


def _tone(frequency: float, amplitude: float) -> npt.NDArray[np.int16]:
    time = np.arange(SAMPLE_RATE) / SAMPLE_RATE
    return (amplitude * 32768 * np.sin(2 * np.pi * frequency * time)).astype(np.int16)


def test_a_tone_is_measured_by_its_amplitude() -> None:
    assert abs(tone_level(_tone(440, 0.05), 440) - 0.05) < 0.001


def test_a_jump_of_phase_as_receivers_make_it_does_not_hide_the_tone() -> None:
    tone = _tone(440, 0.05)
    turned = np.concatenate([tone[: tone.size // 2], -tone[tone.size // 2 :]])
    assert abs(tone_level(turned, 440) - 0.05) < 0.001


def test_another_tone_is_not_heard() -> None:
    assert tone_level(_tone(520, 0.3), 440) < 0.002


def test_ticks_are_found_where_they_begin_however_long_they_are() -> None:
    silence = np.zeros(SAMPLE_RATE // 2, np.int16)
    tick = _tone(2000, 0.5)[: SAMPLE_RATE // 50]
    found = tick_times(Heard(np.concatenate([silence, tick, silence, tick]), 100.0))
    assert [round(time, 3) for time in found] == [100.5, 101.02]


def test_silence_has_no_tick() -> None:
    assert tick_times(Heard(np.zeros(SAMPLE_RATE, np.int16), 100.0)) == []
