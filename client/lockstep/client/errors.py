"""Errors of the client.

ConsoleError
├── LinkFormatError         the link given to Console is not one that `lockstep up` prints     (caller)
├── CommandError            values that no robot accepts (caller)
├── NoSuchStream            a camera or microphone that is not received                        (caller)
├── SignallingRefused       the console answered WHEP with an error
├── ConnectFailed           the console, or the way to it, did not work within the time allowed
├── ConsoleLost             an established connection ended; terminal, make a new Console
├── NoFeedback              the robot sent no feedback in time: its bridge, or the way to it, does not work now
├── GoalNotReached          `move_to`: the robot came no nearer: something is in its way, or a load pulls it
├── StopUnconfirmed         the robot has not confirmed a stop; it is not lost, but do not rely on it
├── ActionCancelled         an action began and was cancelled: a stick, a stop, a lost seat, no armed events, …
├── ActionFailed            an action began, and the robot failed at it
└── Refused                 the console or the robot said no
    ├── ActionRefused       … to an action
    ├── CommandRefused      … to a command
    │   └── NotArmed        … until `await console.arm()`: after a stop, a reset, a lost link, …
    ├── EditRefused         … to a change of a recorded episode
    ├── EpisodeRefused      … to a request about an episode
    └── SeatRefused         … to the control seat
"""

__all__ = [
    "ActionCancelled",
    "ActionFailed",
    "ActionRefused",
    "CommandError",
    "CommandRefused",
    "ConnectFailed",
    "ConsoleError",
    "ConsoleLost",
    "EditRefused",
    "EpisodeRefused",
    "GoalNotReached",
    "LinkFormatError",
    "NoFeedback",
    "NoSuchStream",
    "NotArmed",
    "Refused",
    "SeatRefused",
    "SignallingRefused",
    "StopUnconfirmed",
]

ADVICE = {
    "unauthorized": "use a link of this console: one that it printed, or that `lockstep invite` made",
    "link_expired": "ask for a new link",
    "link_revoked": "ask the person who invited you",
    "not_allowed": "the role of this link does not permit the request; use the operator's link",
    "robot_unreachable": "start the robot bridge, or give the console its address",
    "too_many_peers": "close another connection first",
}


class ConsoleError(Exception):
    """Base of all errors of this package."""

    def __init__(self, detail: str) -> None:
        super().__init__(detail)
        self.detail = detail

    def __str__(self) -> str:
        return self.detail


class LinkFormatError(ConsoleError):
    """The link is not `http://host:port/#token=…`."""


class CommandError(ConsoleError):
    """The values name an axis that the robot does not have, are of a wrong number, not finite, or out of range."""


class NoSuchStream(ConsoleError):
    """The robot has no such camera or microphone, or the console was told not to receive it."""


class SignallingRefused(ConsoleError):
    """The console refused the connection.

    Attributes:
        status: HTTP status
        error: stable name given by the console, "" when it gave none
    """

    def __init__(self, status: int, error: str, detail: str) -> None:
        super().__init__(detail)
        self.status = status
        self.error = error

    def __str__(self) -> str:
        said = f"the console answered {self.status} {self.error}".rstrip()
        advice = ADVICE.get(self.error, "")
        return said + (f": {self.detail}" if self.detail else "") + (f"; {advice}" if advice else "")


class ConnectFailed(ConsoleError):
    """No connection was made within the time allowed."""


class ConsoleLost(ConsoleError):
    """The connection ended. The bridge brings the robot to rest; a new Console connects again."""


class NoFeedback(ConsoleError):
    """No feedback came from a robot that is there, in the time allowed."""


class GoalNotReached(ConsoleError):
    """A goal axis came no nearer to its goal. The robot stays where it is.

    Attributes:
        axis: the axis' name
        goal: the value that was asked for, in the axis' unit
        measured: the newest measured value
        applied: the applied goal; None: not known
    """

    def __init__(self, axis: str, unit: str, goal: float, measured: float, applied: float | None) -> None:
        super().__init__(f"{axis} is at {measured:g} {unit} and comes no nearer to {goal:g} {unit}")
        self.axis, self.goal, self.measured, self.applied = axis, goal, measured, applied


class Refused(ConsoleError):
    """The console or the robot refused a request.

    Attributes:
        reason: one of `lockstep.protocol.messages.RefusalReason`
    """

    def __init__(self, reason: str, detail: str = "") -> None:
        super().__init__(f"{reason}: {detail}" if detail else reason)
        self.reason = reason
        self.detail = detail

    def __str__(self) -> str:
        return str(self.args[0])


class CommandRefused(Refused):
    """The command was not executed, and repeating it would not help."""


class NotArmed(CommandRefused):
    """The robot may not move before a neutral command: call `await console.arm()` when it is safe to go on."""

    def __init__(self) -> None:
        super().__init__("not_neutral", "the robot was stopped, reset or lost, or the seat is new: call arm() first")


class StopUnconfirmed(ConsoleError):
    """The robot has not confirmed a stop. The console keeps it, if the stop reached it; use the hardware stop.

    Attributes:
        press: the id of the press; the same press may be sent again
    """

    def __init__(self, press: str, detail: str) -> None:
        super().__init__(detail)
        self.press = press


class ActionRefused(Refused):
    """The action was not begun.

    Attributes:
        reason: one of `lockstep.protocol.actions.ActionReason`
    """


class ActionCancelled(ConsoleError):
    """The action was begun and cancelled; the robot comes to rest.

    Attributes:
        reason: one of `lockstep.protocol.actions.ActionReason`
    """

    def __init__(self, reason: str, detail: str = "") -> None:
        super().__init__(f"{reason}: {detail}" if detail else reason)
        self.reason = reason


class ActionFailed(ConsoleError):
    """The robot began the action and failed at it; the detail says why."""


class EpisodeRefused(Refused):
    """A request about an episode was refused, or the episode did not come about.

    Attributes:
        reason: one of `lockstep.protocol.episodes.EpisodeReason`
    """


class EditRefused(Refused):
    """A change of a recorded episode was refused; nothing was changed.

    Attributes:
        reason: "stale_edit": somebody has changed the recording's episodes since; "edit_refused": it is not allowed
    """


class SeatRefused(Refused):
    """The control seat was refused."""
