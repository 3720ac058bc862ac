"""What people read of a setting that they have misspelt."""

import re
from pathlib import Path

import pytest

from lockstep.protocol.files.setting_names import not_a_setting

ROOT = Path(__file__).parents[3]
KNOWN = {"port", "host", "Robot"}


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("prot", "prot is not a setting; did you mean port?"),
        ("PORTT", "PORTT is not a setting; did you mean port?"),
        ("robt", "robt is not a setting; did you mean Robot?"),
        ("zzz", "zzz is not a setting"),
        ("", " is not a setting"),
    ],
)
def test_the_nearest_name_is_told_if_one_is_near(name: str, said: str) -> None:
    assert not_a_setting(name, KNOWN) == said


def test_a_table_stands_in_front_of_both_names_and_makes_none_nearer() -> None:
    assert not_a_setting("prot", KNOWN, within="media.") == "media.prot is not a setting; did you mean media.port?"
    assert not_a_setting("zzz", KNOWN, within="media.") == "media.zzz is not a setting"


def test_more_can_be_said_of_it() -> None:
    said = not_a_setting("prot", KNOWN, further=" and has no effect")
    assert said == "prot is not a setting and has no effect; did you mean port?"


def test_no_other_module_has_the_sentence() -> None:
    packages = ("protocol", "rtc", "robot_bridge", "client", "server", "bench")
    files = [path for each in packages for path in (ROOT / each / "lockstep").rglob("*.py")]
    found = [path.name for path in files if re.search(r"is not a setting.*did you mean", path.read_text())]
    assert found == ["setting_names.py"]
