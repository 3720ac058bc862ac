import pytest

from lockstep.bench.experiment.choices import MODES, PROFILES, media_of, round_trip_of
from lockstep.bench.experiment.matrix import matrix_of, thesis_matrix_of
from lockstep.emulator.impairment.profile import load_profile
from tests.bench.experiment.made_up import choices


@pytest.mark.parametrize(
    ("profile", "kbps", "rate", "tolerance"),
    [("macro-lan", 128, 8, 4), ("micro-lan", 128, 16, 4), ("hong-kong", 3072, 30, 2)],
)
def test_the_settings_are_those_of_the_thesis(profile: str, kbps: float, rate: float, tolerance: int) -> None:
    media = media_of(load_profile(profile))
    assert (media.video_kbps, media.frames_per_second, media.tolerance) == (kbps, rate, tolerance)
    assert (media.sound_codec, media.adapts) == ("PCMU", False)


def test_over_other_networks_the_console_does_as_it_does_by_itself() -> None:
    assert media_of(load_profile("lte-drive")).adapts
    assert media_of(load_profile("narrow-uplink")).video_kbps == 800


def test_without_the_quality_controller_a_narrow_link_gets_what_fits() -> None:
    media = media_of(load_profile("narrow-uplink"), adapts=False)
    assert (media.video_kbps, media.adapts) == (300, False)


def test_the_settings_reach_the_console_as_environment() -> None:
    said = media_of(load_profile("hong-kong")).environment()
    assert said["LOCKSTEP_MEDIA__VIDEO_BITRATE_BPS"] == "3072000"
    assert said["LOCKSTEP_MEDIA__QUALITY"] == "false"


def test_the_round_trip_is_that_of_a_command_and_its_feedback() -> None:
    assert round_trip_of(load_profile("hong-kong")) == pytest.approx(0.346, abs=0.001)
    assert round_trip_of(load_profile("satellite")) == pytest.approx(0.6, abs=0.001)


@pytest.mark.parametrize(
    ("mode", "gate", "pacing"),
    [
        ("off", "off", "feedback"),
        ("age", "age", "feedback"),
        ("feedback", "event", "feedback"),
        ("media", "event", "media"),
    ],
)
def test_a_mode_is_a_gate_and_a_pacing(mode: str, gate: str, pacing: str) -> None:
    said = choices(mode=mode)
    assert (said.gate, said.pacing) == (gate, pacing)
    assert gate not in said.watching
    assert len(said.watching) == 2
    assert choices(mode=mode, watchers=False).watching == ()


def test_the_matrix_has_every_profile_in_every_mode_with_watchers_where_no_gate_is() -> None:
    cells = list(matrix_of(choices()))
    assert [(cell.profile, cell.mode) for cell in cells] == [(name, mode) for name in PROFILES for mode in MODES]
    assert {cell.mode for cell in cells if cell.watchers} == {"off"}


def test_the_thesis_experiments_are_its_three_networks_without_and_with_and_each_has_a_robot_of_its_kind() -> None:
    cells = [(cell.profile, cell.mode, cell.robot, cell.watchers) for cell in thesis_matrix_of(choices())]
    assert cells == [
        ("macro-lan", "off", "mobile-manipulator", True),
        ("macro-lan", "feedback", "mobile-manipulator", False),
        ("micro-lan", "off", "micromanipulator", True),
        ("micro-lan", "feedback", "micromanipulator", False),
        ("hong-kong", "off", "mobile-manipulator", True),
        ("hong-kong", "feedback", "mobile-manipulator", False),
    ]
    assert {cell.robot for cell in thesis_matrix_of(choices(), "planar")} == {"planar"}
