"""Who listens to a session: all that passes the console, for a recorder. This one does nothing."""

from lockstep.protocol.console import Report, ServerMessage
from lockstep.protocol.messages import Command, Feedback, Refusal, Rest, StopTaken
from lockstep.server.audit.records import Actor
from lockstep.server.control.command_arbiter import CommandOutcome

__all__ = ["SessionListener"]


class SessionListener:
    """All are called on the loop and return at once. Who asks is nobody (`Actor()`) where the console acts itself."""

    def told(self, message: ServerMessage) -> None:
        """What everyone is told: the seat, the participants, notes, the robot link."""

    def command(self, by: Actor, command: Command, outcome: CommandOutcome) -> None:
        """What `by` asked for, and what became of it."""

    def rest(self, by: Actor, rest: Rest, why: str) -> None:
        """A rest went to the robot."""

    def feedback(self, feedback: Feedback, now: float) -> None: ...

    def refused(self, to: Actor, refusal: Refusal, by: str) -> None:
        """`by`: "console" or "robot"."""

    def stop_asked(self, by: Actor, where: str, reason: str, press: str, *, delivered: bool) -> None:
        """A press of STOP. `delivered`: there was a link to send it on."""

    def stop_taken(self, by: Actor, taken: StopTaken) -> None:
        """The robot has answered a press of `by`."""

    def reset_done(self, by: Actor, where: str, number: int) -> None:
        """The robot says that stop `number` is released, as `by` asked."""

    def report(self, by: Actor, report: Report) -> None:
        """Of the seat's holder."""
