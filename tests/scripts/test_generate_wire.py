"""The published schemas are what the code speaks."""

import json

import jsonschema
import pytest

from lockstep.protocol.console import SeatRequest, Welcome, encode_console_message
from lockstep.protocol.messages import Command, Feedback
from scripts import generate_wire


def test_the_committed_schemas_are_what_the_messages_say() -> None:
    for path, text in generate_wire.generated().items():
        assert path.read_text() == text, f"run python -m scripts.generate_wire for {path.name}"


@pytest.mark.parametrize(
    "message",
    [
        SeatRequest(),
        Command(event=3, issue=1, values=[0.1]),
        Feedback(event=1, issue=1, time=1.0, axes=[]),
        Welcome(peer="p1", role="operator", name="Ann", streams=[]),
    ],
)
def test_a_message_on_the_wire_is_valid_under_the_schema(message: SeatRequest | Command | Feedback | Welcome) -> None:
    schema = json.loads((generate_wire.SCHEMAS / "console.schema.json").read_text())
    jsonschema.Draft202012Validator(schema).validate(json.loads(encode_console_message(message)))


def test_a_message_with_event_0_is_not_valid_under_the_schema() -> None:
    schema = json.loads((generate_wire.SCHEMAS / "console.schema.json").read_text())
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate({"type": "command", "event": 0, "issue": 1, "values": []}, schema)
