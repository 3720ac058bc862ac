"""The interface of a listener to a session, such as the recorder. The base class does nothing."""

from lockstep.protocol.console import Report, ServerMessage
from lockstep.protocol.messages import Command, Feedback, Refusal, Rest, StopTaken
from lockstep.server.audit.records import Actor
from lockstep.server.control.command_arbiter import CommandOutcome

__all__ = ["SessionListener"]


class SessionListener:
    """Hears all that passes the console, on the loop; methods return at once. `Actor()`: the console acts itself."""

    def told(self, message: ServerMessage) -> None:
        """Called with each message to everyone: the seat, the participants, notes, the robot link."""

    def command(self, by: Actor, command: Command, outcome: CommandOutcome) -> None:
        """Called with each command of a peer, and its outcome."""

    def rest(self, by: Actor, rest: Rest, why: str) -> None:
        """Called when a rest went to the robot."""

    def feedback(self, feedback: Feedback, now: float) -> None: ...

    def refused(self, to: Actor, refusal: Refusal, by: str) -> None:
        """Called for each refusal. `by`: "console" or "robot"."""

    def stop_asked(self, by: Actor, where: str, reason: str, press: str, *, delivered: bool) -> None:
        """Called for each press of STOP. `delivered`: there was a link to send it on."""

    def stop_taken(self, by: Actor, taken: StopTaken) -> None:
        """Called when the robot has answered a press of `by`."""

    def reset_done(self, by: Actor, where: str, number: int) -> None:
        """Called when the robot says that stop `number` is released, as `by` asked."""

    def report(self, by: Actor, report: Report) -> None:
        """Called with each report of the seat's holder."""
