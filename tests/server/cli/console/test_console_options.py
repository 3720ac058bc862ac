from dataclasses import fields

from lockstep.server.cli.console.console_options import ConsoleOptions
from lockstep.server.settings import Settings

OF_THE_COMMAND = {"as_json", "quiet"}  # how it speaks, which is no setting


def test_every_option_is_a_setting_and_none_is_one_unless_it_is_given() -> None:
    names = [each.name for each in fields(ConsoleOptions) if each.name not in OF_THE_COMMAND]
    settings = ConsoleOptions().settings()
    assert len(settings) == len(names)
    assert settings.keys() <= Settings.model_fields.keys()
    assert {value for value in settings.values() if value is not None} == set()
