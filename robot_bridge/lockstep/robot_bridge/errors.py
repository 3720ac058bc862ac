"""Errors of the bridge itself; the link's errors are in `lockstep.protocol.errors`.

BridgeError
├── RobotUnavailable        something that the robot needs is missing on this machine
├── UnknownRobot            no robot has that name
├── BadRobot                the named class does not make a robot
├── SettingsError           a settings file cannot be used; names its line and key
├── ModelError              a MuJoCo model cannot be driven
├── ModelMissing            a simulated robot's model was not fetched
├── EncoderMissing          pictures are to be encoded, and PyAV is not installed
├── EncodingFailed          a picture could not be encoded; the stream goes on
├── DescriptionError        the robot's description contradicts itself
├── BadParameter            a request for an action has a parameter that the action does not take
├── ListenError             the bridge cannot listen on the address
├── InsecureLink            the bridge will not listen there without a secret or client certificates
├── StateDirInUse           another bridge keeps its stop in the directory
├── StateDirUnusable        the directory that keeps the stop cannot be made, read or written
├── BadConsoleAddress       a robot cannot dial that address
├── NotPaired               the robot has no key for a console
├── PairingRefused          the console did not take the pairing code, or is not the one that showed it
├── ConsoleUnreachable      no console answers at the address
├── WrongConsole            the certificate there is another one than the console's
├── ConsoleRefused          the console does not take this robot
└── RobotFailed             the robot adapter raised while running
"""

__all__ = [
    "BadParameter",
    "BadConsoleAddress",
    "BadRobot",
    "BridgeError",
    "ConsoleRefused",
    "ConsoleUnreachable",
    "DescriptionError",
    "DiallingMissing",
    "EncoderMissing",
    "EncodingFailed",
    "InsecureLink",
    "ListenError",
    "ModelError",
    "ModelMissing",
    "NotPaired",
    "PairingRefused",
    "RobotFailed",
    "RobotUnavailable",
    "SettingsError",
    "StateDirInUse",
    "StateDirUnusable",
    "UnknownRobot",
    "WrongConsole",
    "named",
]


class BridgeError(Exception):
    """Base of the bridge's errors.

    Attributes:
        name: stable, lower-case identifier
        detail: the fault and, where known, the remedy
    """

    name = "bridge"

    def __init__(self, detail: str) -> None:
        super().__init__(detail)
        self.detail = detail

    def __str__(self) -> str:
        return f"{self.name}: {self.detail}"


class RobotUnavailable(BridgeError):
    name = "robot_unavailable"


class BadParameter(BridgeError):
    name = "bad_parameter"


class UnknownRobot(BridgeError):
    name = "unknown_robot"


class BadRobot(BridgeError):
    name = "bad_robot"


class SettingsError(BridgeError):
    name = "settings"


class ModelError(BridgeError):
    name = "model"


class ModelMissing(BridgeError):
    name = "model_missing"


class DiallingMissing(BridgeError):
    name = "dialling_missing"


class EncoderMissing(BridgeError):
    name = "encoder_missing"


class EncodingFailed(BridgeError):
    name = "encoding_failed"


class DescriptionError(BridgeError):
    name = "description"


class ListenError(BridgeError):
    name = "listen"


class InsecureLink(BridgeError):
    name = "insecure_link"


class StateDirInUse(BridgeError):
    name = "state_dir_in_use"


class StateDirUnusable(BridgeError):
    name = "state_dir"


class BadConsoleAddress(BridgeError):
    name = "bad_console_address"


class NotPaired(BridgeError):
    name = "not_paired"


class PairingRefused(BridgeError):
    name = "pairing_refused"


class ConsoleUnreachable(BridgeError):
    name = "console_unreachable"


class WrongConsole(BridgeError):
    name = "wrong_console"


class ConsoleRefused(BridgeError):
    """Attributes: status, of HTTP."""

    name = "console_refused"

    def __init__(self, detail: str, status: int) -> None:
        super().__init__(detail)
        self.status = status


class RobotFailed(BridgeError):
    name = "robot_failed"


def named(error: BaseException) -> str:
    """Return the error as "OSError: no such device"; the detail of a RobotFailed, which has that form already."""
    return error.detail if isinstance(error, RobotFailed) else f"{type(error).__name__}: {error}"
