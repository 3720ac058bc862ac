import pytest

from lockstep.server.cli.console.unknown_settings import unknown_settings
from lockstep.server.settings import Settings


def test_a_misspelt_setting_is_named_with_the_one_that_was_probably_meant() -> None:
    assert unknown_settings(["LOCKSTEP_PORTT"], Settings) == [
        "LOCKSTEP_PORTT is not a setting and has no effect; did you mean LOCKSTEP_PORT?"
    ]


def test_a_misspelt_field_of_a_group_is_named_too() -> None:
    (said,) = unknown_settings(["LOCKSTEP_MEDIA__QUALTY"], Settings)
    assert said.endswith("did you mean LOCKSTEP_MEDIA__QUALITY?")


@pytest.mark.parametrize(
    "name",
    [
        *(
            "LOCKSTEP_PORT",
            "lockstep_port",
            "LOCKSTEP_MEDIA__QUALITY",
            "LOCKSTEP_RECORDING__DIRECTORY",
            "LOCKSTEP_SITE",
        ),
        *("LOCKSTEP_ROBOT_OPTIONS", "LOCKSTEP_ROBOT_CONTAINERS", "LOCKSTEP_ROBOT_CONFIG", "LOCKSTEP_CONFIG_DIR"),
    ],
)
def test_a_setting_in_any_case_and_a_variable_of_another_program_are_not_named(name: str) -> None:
    assert unknown_settings([name], Settings) == []


def test_variables_of_others_are_nobodys_business() -> None:
    assert unknown_settings(["PATH", "LOCKSTEPPER", "HOME"], Settings) == []


def test_every_unknown_one_is_named_in_order() -> None:
    said = unknown_settings(["LOCKSTEP_ZZZ", "LOCKSTEP_AAA", "LOCKSTEP_OWN"], Settings, more=["LOCKSTEP_OWN"])
    assert [each.partition(" ")[0] for each in said] == ["LOCKSTEP_AAA", "LOCKSTEP_ZZZ"]
