"""Pilots without a console, for tests."""

from lockstep.client.control.command_gate import CommandGate
from lockstep.client.control.command_sender import CommandSender
from lockstep.protocol.messages import Command, Rest
from tests.makers import feedback

FAST = [1.0]
NEUTRAL = [0.0]


def new_sender(event: int = 1, min_interval: float = 0.0) -> CommandSender:
    sender = CommandSender(CommandGate("feedback", 4, min_interval), NEUTRAL)
    sender.feedback(feedback(event), 0.0)
    sender.readiness.ready = True
    return sender


def commands(messages: list[Command | Rest]) -> list[Command]:
    return [message for message in messages if isinstance(message, Command)]


def rests(messages: list[Command | Rest]) -> list[Rest]:
    return [message for message in messages if isinstance(message, Rest)]


def flying(sender: CommandSender, now: float = 0.0) -> Command:
    sender.intend(FAST, now)
    [command] = commands(sender.due(now))
    return command
