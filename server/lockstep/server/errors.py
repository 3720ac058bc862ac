"""Errors between the console and its clients.

ConsoleError
├── AccessError             the client is unknown, or may not do this
│   ├── TokenMissing
│   ├── TokenInvalid        wrong signature or malformed: the answer never says which
│   ├── LinkExpired         signed by this console, too old
│   ├── LinkOtherRobot      signed by this console, for other robots of the fleet
│   ├── LinkRevoked         signed by this console, revoked
│   ├── NoSeat              only the holder of the control seat may do this
│   ├── NotAllowed          the role does not permit this
│   ├── Silenced            a supervisor has silenced the stops of this link
│   ├── OriginRefused       a page of another site
│   └── RobotUnknown        a robot that dials in and is not, or no longer, paired
├── RequestError            the request is not understood
│   ├── ActionIdUsed        an earlier request for an action had this id
│   ├── AlreadyPaired       a robot is paired here: forget it first
│   ├── AlreadyPublishing   one link publishes one camera
│   ├── AlreadyRecording
│   ├── BadJson
│   ├── BadParameter
│   ├── BadSdp
│   │   └── TooManySections
│   ├── BadSdpFragment
│   ├── BodyTooLarge
│   ├── BodyTooSlow
│   ├── CameraTaken         another client publishes it
│   ├── EditRefused         a change of a recorded episode that is not allowed
│   ├── EpisodeEmpty        no event was executed in it
│   ├── EpisodeOpen         an episode is open, or about to begin
│   ├── HostRefused         a host name that is not the console's
│   ├── LockedOut           a reset while somebody at the robot keeps it from being driven
│   ├── NotAcceptable       an offer without anything that the console accepts
│   ├── NotConnected
│   ├── NotRenewable        an action that moves the robot, asked for over HTTP
│   ├── NotDialIn           the console connects to this robot; or its key is in the settings
│   ├── NoEpisode           none is open
│   ├── NoTask              an episode needs a task, in words
│   ├── NotFound
│   ├── NotPairing          no pairing code is open
│   ├── OtherEpisode        the request names another one than the one that is open
│   ├── PreconditionFailed
│   ├── TooManyInvitations
│   ├── PreconditionRequired
│   ├── RecordingOff        nothing is recorded, so no episode can be
│   ├── RecordingUnreadable  the recording is damaged for good
│   ├── ResetTooSoon        a reset right after the stop that it names
│   ├── PressUsed           the stop of this press has been reset
│   ├── TooFewSections      fewer media sections than streams, and the peer wants all of them
│   ├── StaleEdit           somebody else has changed the episodes since
│   ├── StaleReset          a reset that does not name the newest stop
│   ├── TooManyRequests
│   └── WrongMediaType
├── ChannelError            a data channel message that is not understood
│   ├── BinaryMessage
│   ├── DuplicateChannel
│   ├── Flood
│   ├── MalformedMessage
│   ├── MessageTooLarge
│   ├── TransportRefused    an error below the channels; each has its own name
│   ├── UnknownChannel
│   └── WrongChannel
├── InternalFault           the console failed, not the client
└── Unavailable             the console cannot do this right now
    ├── RobotLinkDown
    ├── RecordingFailed     the disk failed, or a file on it is damaged
    ├── ResetNotKept        the robot's disk does not store the reset
    ├── RobotFailed         the console's session of the robot failed and restarts
    ├── RobotUnreachable
    ├── SceneUnavailable
    ├── ShuttingDown
    ├── StateUnavailable    the state directory cannot be written
    ├── TooManyPeers
    └── Unconfirmed         the robot was told, and has not answered
"""

from typing import NamedTuple

__all__ = [
    "ActionIdUsed",
    "HTTP_ERRORS",
    "AccessError",
    "AlreadyPaired",
    "AlreadyPublishing",
    "AlreadyRecording",
    "BadJson",
    "BadParameter",
    "BadSdp",
    "BadSdpFragment",
    "BinaryMessage",
    "BodyTooLarge",
    "BodyTooSlow",
    "CameraTaken",
    "ChannelError",
    "ConsoleError",
    "DuplicateChannel",
    "EditRefused",
    "Flood",
    "HostRefused",
    "HttpError",
    "InternalFault",
    "RobotLinkDown",
    "LinkExpired",
    "LinkOtherRobot",
    "LinkRevoked",
    "LockedOut",
    "MalformedMessage",
    "NoSeat",
    "MessageTooLarge",
    "NotAcceptable",
    "NotAllowed",
    "NotConnected",
    "NotDialIn",
    "NotFound",
    "NotRenewable",
    "NotPairing",
    "OriginRefused",
    "PreconditionFailed",
    "PreconditionRequired",
    "RecordingFailed",
    "RecordingUnreadable",
    "RequestError",
    "ResetNotKept",
    "ResetTooSoon",
    "RobotFailed",
    "RobotUnknown",
    "RobotUnreachable",
    "SceneUnavailable",
    "ShuttingDown",
    "Silenced",
    "PressUsed",
    "StaleEdit",
    "StaleReset",
    "StateUnavailable",
    "TokenInvalid",
    "TokenMissing",
    "TooFewSections",
    "TooManyInvitations",
    "TooManyPeers",
    "TooManyRequests",
    "TooManySections",
    "TransportRefused",
    "Unavailable",
    "Unconfirmed",
    "UnknownChannel",
    "WrongChannel",
    "WrongMediaType",
    "http_error",
    "EpisodeEmpty",
    "EpisodeOpen",
    "NoEpisode",
    "NoTask",
    "OtherEpisode",
    "RecordingOff",
]


class ConsoleError(Exception):
    """Base of all named errors of the console.

    Attributes:
        detail: the exact error, for a person; the name is in `HTTP_ERRORS`, or `ChannelError.name`
    """

    def __init__(self, detail: str = "") -> None:
        super().__init__(detail)
        self.detail = detail


class AccessError(ConsoleError):
    pass


class TokenMissing(AccessError):
    pass


class TokenInvalid(AccessError):
    pass


class LinkExpired(AccessError):
    pass


class LinkOtherRobot(AccessError):
    pass


class LinkRevoked(AccessError):
    pass


class NotAllowed(AccessError):
    pass


class NoSeat(AccessError):
    pass


class OriginRefused(AccessError):
    pass


class RobotUnknown(AccessError):
    pass


class Silenced(AccessError):
    pass


class RequestError(ConsoleError):
    pass


class AlreadyPaired(RequestError):
    pass


class AlreadyPublishing(RequestError):
    pass


class AlreadyRecording(RequestError):
    pass


class BadJson(RequestError):
    pass


class BadParameter(RequestError):
    pass


class BadSdp(RequestError):
    pass


class TooManySections(BadSdp):
    pass


class TooFewSections(RequestError):
    pass


class BadSdpFragment(RequestError):
    pass


class BodyTooLarge(RequestError):
    pass


class BodyTooSlow(RequestError):
    pass


class CameraTaken(RequestError):
    pass


class HostRefused(RequestError):
    pass


class NotAcceptable(RequestError):
    pass


class NotConnected(RequestError):
    pass


class ActionIdUsed(RequestError):
    pass


class NotRenewable(RequestError):
    pass


class NotDialIn(RequestError):
    pass


class NotPairing(RequestError):
    pass


class RecordingUnreadable(RequestError):
    pass


class PreconditionFailed(RequestError):
    pass


class PreconditionRequired(RequestError):
    pass


class PressUsed(RequestError):
    pass


class StaleReset(RequestError):
    pass


class ResetTooSoon(RequestError):
    pass


class LockedOut(RequestError):
    pass


class TooManyRequests(RequestError):
    pass


class NotFound(RequestError):
    pass


class TooManyInvitations(RequestError):
    pass


class WrongMediaType(RequestError):
    pass


class EditRefused(RequestError):
    pass


class StaleEdit(RequestError):
    pass


class EpisodeEmpty(RequestError):
    pass


class EpisodeOpen(RequestError):
    pass


class NoEpisode(RequestError):
    pass


class NoTask(RequestError):
    pass


class OtherEpisode(RequestError):
    pass


class RecordingOff(RequestError):
    pass


class ChannelError(ConsoleError):
    """An error on a data channel; /metrics counts them by `name`."""

    name = "channel"


class BinaryMessage(ChannelError):
    name = "binary"


class DuplicateChannel(ChannelError):
    name = "duplicate_channel"


class Flood(ChannelError):
    name = "flood"


class MalformedMessage(ChannelError):
    name = "malformed"


class MessageTooLarge(ChannelError):
    name = "too_large"


class TransportRefused(ChannelError):
    name = "transport"

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self.name = name


class UnknownChannel(ChannelError):
    name = "unknown_channel"


class WrongChannel(ChannelError):
    name = "wrong_channel"


class InternalFault(ConsoleError):
    pass


class Unavailable(ConsoleError):
    pass


class RobotLinkDown(Unavailable):
    pass


class RecordingFailed(Unavailable):
    pass


class ResetNotKept(Unavailable):
    pass


class RobotFailed(Unavailable):
    pass


class RobotUnreachable(Unavailable):
    pass


class SceneUnavailable(Unavailable):
    pass


class ShuttingDown(Unavailable):
    pass


class StateUnavailable(Unavailable):
    pass


class TooManyPeers(Unavailable):
    pass


class Unconfirmed(Unavailable):
    pass


class HttpError(NamedTuple):
    """An error as HTTP sends it."""

    status: int
    name: str
    headers: dict[str, str] = {}


HTTP_ERRORS: dict[type[ConsoleError], HttpError] = {
    TokenMissing: HttpError(401, "unauthorized", {"WWW-Authenticate": "Bearer"}),
    TokenInvalid: HttpError(401, "unauthorized", {"WWW-Authenticate": 'Bearer error="invalid_token"'}),
    LinkExpired: HttpError(401, "link_expired", {"WWW-Authenticate": 'Bearer error="invalid_token"'}),
    LinkRevoked: HttpError(401, "link_revoked", {"WWW-Authenticate": 'Bearer error="invalid_token"'}),
    RobotUnknown: HttpError(401, "robot_unknown", {"WWW-Authenticate": "LockstepRobot"}),
    LinkOtherRobot: HttpError(403, "link_other_robot"),
    NoSeat: HttpError(403, "no_seat"),
    NotAllowed: HttpError(403, "not_allowed"),
    OriginRefused: HttpError(403, "origin_refused"),
    Silenced: HttpError(403, "silenced"),
    AlreadyPaired: HttpError(409, "already_paired"),
    AlreadyPublishing: HttpError(409, "already_publishing", {"Retry-After": "2"}),
    AlreadyRecording: HttpError(409, "already_recording"),
    RecordingOff: HttpError(409, "recording_off"),
    EpisodeOpen: HttpError(409, "episode_open"),
    NoEpisode: HttpError(409, "no_episode"),
    OtherEpisode: HttpError(409, "other_episode"),
    EpisodeEmpty: HttpError(409, "empty"),
    NoTask: HttpError(422, "no_task"),
    StaleEdit: HttpError(409, "stale_edit"),
    EditRefused: HttpError(422, "edit_refused"),
    BadJson: HttpError(400, "bad_json"),
    BadParameter: HttpError(422, "bad_parameter"),
    BadSdp: HttpError(400, "bad_sdp"),
    TooManySections: HttpError(400, "too_many_sections"),
    TooFewSections: HttpError(409, "too_few_sections"),
    BadSdpFragment: HttpError(400, "bad_sdp_fragment"),
    NotFound: HttpError(404, "not_found"),
    RecordingUnreadable: HttpError(422, "recording_damaged"),
    BodyTooLarge: HttpError(413, "too_large"),
    WrongMediaType: HttpError(415, "wrong_media_type"),
    BodyTooSlow: HttpError(408, "too_slow", {"Connection": "close"}),
    NotAcceptable: HttpError(406, "not_acceptable"),
    CameraTaken: HttpError(409, "camera_taken", {"Retry-After": "5"}),
    NotConnected: HttpError(409, "not_connected"),
    ActionIdUsed: HttpError(409, "action_id_used"),
    NotRenewable: HttpError(409, "not_renewable"),
    NotDialIn: HttpError(409, "not_dial_in"),
    NotPairing: HttpError(409, "not_pairing"),
    LockedOut: HttpError(409, "locked_out"),
    ResetTooSoon: HttpError(409, "too_soon", {"Retry-After": "1"}),
    PressUsed: HttpError(409, "press_used"),
    StaleReset: HttpError(409, "stale_reset"),
    TooManyInvitations: HttpError(409, "too_many_invitations"),
    PreconditionFailed: HttpError(412, "precondition_failed"),
    HostRefused: HttpError(421, "host_refused"),
    PreconditionRequired: HttpError(428, "precondition_required"),
    TooManyRequests: HttpError(429, "too_many_requests", {"Retry-After": "2"}),
    InternalFault: HttpError(500, "internal_error"),
    RobotLinkDown: HttpError(503, "link_down", {"Retry-After": "1"}),
    RecordingFailed: HttpError(503, "recording_failed", {"Retry-After": "5"}),
    ResetNotKept: HttpError(503, "not_kept", {"Retry-After": "5"}),
    RobotFailed: HttpError(503, "robot_failed", {"Retry-After": "2"}),
    RobotUnreachable: HttpError(409, "robot_unreachable", {"Retry-After": "1"}),
    SceneUnavailable: HttpError(503, "scene_unavailable", {"Retry-After": "5"}),
    ShuttingDown: HttpError(503, "shutting_down", {"Retry-After": "5"}),
    StateUnavailable: HttpError(503, "state_unavailable", {"Retry-After": "5"}),
    TooManyPeers: HttpError(503, "too_many_peers", {"Retry-After": "5"}),
    Unconfirmed: HttpError(503, "unconfirmed", {"Retry-After": "1"}),
}


def http_error(error: ConsoleError) -> HttpError:
    """Return the HTTP form of `error`; every error that HTTP can raise has one."""
    return HTTP_ERRORS[type(error)]
