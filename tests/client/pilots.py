"""Pilots without a console, for tests."""

from lockstep.client.control.command_gate import CommandGate
from lockstep.client.control.command_sender import CommandSender
from lockstep.protocol.messages import Command, Rest
from tests.client.helpers import feedback

FAST = [1.0]
NEUTRAL = [0.0]


def new_pilot(event: int = 1, min_interval: float = 0.0) -> CommandSender:
    pilot = CommandSender(CommandGate("feedback", 4, min_interval), NEUTRAL)
    pilot.feedback(feedback(event), 0.0)
    pilot.ready = True
    return pilot


def commands(messages: list[Command | Rest]) -> list[Command]:
    return [message for message in messages if isinstance(message, Command)]


def rests(messages: list[Command | Rest]) -> list[Rest]:
    return [message for message in messages if isinstance(message, Rest)]


def flying(pilot: CommandSender, now: float = 0.0) -> Command:
    pilot.intend(FAST, now)
    [command] = commands(pilot.due(now))
    return command
