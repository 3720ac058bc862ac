"""Takes the shadows of policies, and tells what they are judged to be; nothing of them reaches the robot."""

import time

from lockstep.protocol.console import Shadow, ShadowVerdict, encode_console_message
from lockstep.protocol.description import RobotDescription
from lockstep.protocol.messages import Command, Feedback, RefusalReason
from lockstep.server.control.policies.shadow_judge import JudgedShadow, ShadowJudge
from lockstep.server.peers.peer import Peer
from lockstep.server.peers.peer_registry import PeerRegistry
from lockstep.server.session_events import SessionEvents, ShadowJudged
from lockstep.server.util.rate_limits import RateLimits

__all__ = ["ShadowService"]

TOLD_RATE, TOLD = 10.0, 2  # Hz, of one policy's verdicts; further ones are only recorded


class ShadowService:
    """All methods are called on the loop and return at once."""

    def __init__(self, peers: PeerRegistry, events: SessionEvents) -> None:
        self._judge = ShadowJudge()
        self._peers = peers
        self._events = events
        self._told = RateLimits(TOLD_RATE, TOLD)

    def robot_link_up(self, description: RobotDescription) -> None:
        self._judge.robot_link_up(description)

    def epoch_ends(self) -> None:
        self._judge.epoch_ends()

    def gone(self, peer: Peer) -> None:
        self._judge.gone(peer.id)

    def shadow(self, peer: Peer, shadow: Shadow, *, drives: bool) -> RefusalReason | None:
        """Take a shadow; return why it is refused, or None. What a policy that `drives` wants is what it commands."""
        if peer.role != "policy":
            return "not_allowed"
        if drives:
            return None
        outcome = self._judge.take(peer.id, shadow)
        if isinstance(outcome, JudgedShadow):
            self._publish(outcome)
            return None
        return outcome

    def feedback(self, feedback: Feedback, executed: Command | None) -> None:
        """Take a feedback, and the command that became its event."""
        for judged in self._judge.feedback(feedback, executed):
            self._publish(judged)

    def _publish(self, judged: JudgedShadow) -> None:
        peer = self._peers.by_id(judged.peer)
        if peer is None:
            return
        verdict = ShadowVerdict(
            peer=peer.id,
            name=peer.name,
            event=judged.shadow.event,
            values=judged.shadow.values,
            judgement=judged.judgement,
            difference=judged.difference,
        )
        self._events.publish(ShadowJudged(peer.actor, verdict))
        if self._told.spend(peer.id, time.monotonic()):
            text = encode_console_message(verdict)
            for each in self._peers.drivers():
                each.send_spare(text)
