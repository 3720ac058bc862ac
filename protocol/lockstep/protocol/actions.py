"""Actions of a robot and its status, on the robot link and on the console's channels (docs/robot-link.md, "Actions").

An action is something that a robot does once when it is asked: go home, switch a light on, take a picture. A status
item is something that a robot reports of itself: its battery, its mode, a temperature.
"""

import math
from typing import Annotated, Literal

import msgspec

from lockstep.protocol.serial import MAX_EVENT

__all__ = [
    "MAX_PARAMETERS",
    "MAX_STATUS_BYTES",
    "MAX_STATUS_ITEMS",
    "Act",
    "ActionCancel",
    "ActionId",
    "ActionReason",
    "ActionState",
    "ActionUpdate",
    "ParameterValue",
    "Parameters",
    "RenewedAction",
    "Status",
    "StatusItem",
    "StatusKind",
    "StatusLevel",
    "fits_kind",
    "status_item_bytes",
]

MAX_PARAMETERS = 8
MAX_STATUS_ITEMS = 64
MAX_STATUS_BYTES = 48 << 10  # of all items as JSON: no peer takes a message of more than 64 KiB
MAX_NUMBER = 1e12  # of a status value, in its unit

# Letters that nothing has to escape: an id stands in logs and recordings. `$` would let the end of a line pass.
ActionId = Annotated[str, msgspec.Meta(pattern=r"^[0-9A-Za-z_-]{1,64}(?![\s\S])")]
RenewedAction = Annotated[str, msgspec.Meta(pattern=r"^[0-9A-Za-z_-]{0,64}(?![\s\S])")]
Name = Annotated[str, msgspec.Meta(min_length=1, max_length=200)]
Text = Annotated[str, msgspec.Meta(max_length=500)]
Unit = Annotated[str, msgspec.Meta(max_length=20)]
Share = Annotated[float, msgspec.Meta(ge=0, le=1)]
Seconds = Annotated[float, msgspec.Meta(ge=0, le=1e9)]
ParameterText = Annotated[str, msgspec.Meta(max_length=200)]
ParameterValue = bool | float | ParameterText
Parameters = Annotated[dict[Name, ParameterValue], msgspec.Meta(max_length=MAX_PARAMETERS)]

ActionState = Literal["running", "done", "failed", "cancelled", "refused"]

ActionReason = Literal[
    "",  # it runs, it is done, or the robot failed at it
    # refused
    "unknown_action",  # the robot has no action of this name
    "bad_parameter",  # a parameter is missing, unknown, or not of the declared kind and range
    "late",  # answers no feedback of the last max_event_age, or one from before a stop or a rest
    "busy",  # this action runs already, another one that moves the robot runs, or too many run
    "driving",  # refused: the axes are not at rest; cancelled: a moving command came
    "not_neutral",  # a neutral command has to come first
    "warning",  # the robot warns before it moves, and has not warned long enough
    "not_possible",  # the robot says no; the text says why
    "no_seat",  # the sender does not hold the control seat
    "not_allowed",  # the sender's role does not permit it
    "too_often",  # more requests than the console or the bridge takes
    "link_down",  # refused: the console has no robot link; cancelled: the link was lost
    # refused or cancelled
    "stopped",  # the robot is stopped, or was stopped
    "locked_out",  # a person at the robot has locked it
    # cancelled
    "cancelled",  # somebody asked for it
    "not_renewed",  # no armed event renewed it within hold
    "rested",  # a rest came: the operator has let go or disarmed, or the seat has changed
    "interrupted",  # a fault, a limit in doubt, or the end of the bridge
]


class Act(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="act"):
    """Ask for an action. The robot does it at most once for each id, and answers with `action` messages."""

    id: ActionId  # 16 random bytes in hex, drawn for each request
    name: Name  # of an action of the description
    parameters: Parameters = {}  # by name, one for each parameter of the action that has no default
    nonce: Annotated[int, msgspec.Meta(ge=0, le=2**53 - 1)] = 0  # of a recent feedback: proof that it was seen
    by: Text = ""  # who asks; the console fills it in


class ActionCancel(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="action_cancel"):
    """Cancel an action that runs. Repeats, and ids of actions that do not run, have no effect."""

    id: RenewedAction = ""  # "": the one that moves the robot


class ActionUpdate(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="action"):
    """The state of an action. `done`, `failed`, `cancelled` and `refused` are final."""

    id: ActionId  # of the request
    name: Name  # of the action
    state: ActionState  # "running", or a final one
    reason: ActionReason = ""  # why it was refused or cancelled
    progress: Share = 0.0  # from 0 to 1
    text: Text = ""  # what it does now, its result, or what went wrong; for people
    moves: bool = False  # it moves the robot
    event: Annotated[int, msgspec.Meta(ge=1, le=MAX_EVENT)]  # the current one when this was said
    began: Annotated[int, msgspec.Meta(ge=0, le=MAX_EVENT)] = 0  # the current event when it began; 0: it never did
    by: Text = ""  # who asked for it
    age: Seconds = 0.0  # s since it came to this state, by the sender's own clock; 0 for one that runs


StatusKind = Literal["battery", "mode", "temperature", "hardware_stop", "number", "switch", "text"]
StatusLevel = Literal["ok", "warning", "error"]
StatusValue = bool | Annotated[float, msgspec.Meta(ge=-MAX_NUMBER, le=MAX_NUMBER)] | Text


class StatusItem(msgspec.Struct, frozen=True, kw_only=True):
    """One thing that a robot reports of itself."""

    name: Name  # stable, "battery"
    label: Name  # for people, "Battery"
    kind: StatusKind = "text"  # battery: a share from 0 to 1; hardware_stop and switch: true or false
    value: StatusValue  # number, true or false, or text, as the kind says
    unit: Unit = ""  # of a number, "°C"
    level: StatusLevel = "ok"  # by the robot's own limits
    text: Text = ""  # why the level is not ok, for people
    age: Seconds = 0.0  # s, how old the reading was when the bridge sent it, by the bridge's own clock
    old_after: Seconds = 5.0  # s; a reading of this age counts as old


class Status(msgspec.Struct, frozen=True, kw_only=True, tag_field="type", tag="status"):
    """All status items of a robot, in its own order. Each message replaces the one before it."""

    event: Annotated[int, msgspec.Meta(ge=1, le=MAX_EVENT)]  # the current one when this was said
    items: Annotated[list[StatusItem], msgspec.Meta(max_length=MAX_STATUS_ITEMS)] = []


def status_item_bytes(item: StatusItem) -> int:
    """Return the bytes of an item as JSON, as peers get it."""
    return len(msgspec.json.encode(item)) + 1


def fits_kind(item: StatusItem) -> bool:
    """Return whether the value is of the item's kind."""
    value = item.value
    is_number = isinstance(value, float | int) and not isinstance(value, bool) and math.isfinite(value)
    match item.kind:
        case "battery":
            return is_number and 0 <= float(value) <= 1
        case "temperature" | "number":
            return is_number
        case "hardware_stop" | "switch":
            return isinstance(value, bool)
        case "mode" | "text":
            return isinstance(value, str)
