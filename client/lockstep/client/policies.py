"""Policies of a console: offering them the seat, waiting for it, and shadows (docs/policies.md)."""

from lockstep.client.control.axis_values import Values, command_values
from lockstep.client.control.driving import Driving
from lockstep.client.errors import SeatRefused
from lockstep.client.requests.seat_requests import SeatRequests
from lockstep.client.session import Session
from lockstep.client.transport.transport import Transport
from lockstep.protocol.console import Shadow, ShadowVerdict
from lockstep.protocol.messages import Feedback
from lockstep.protocol.serial import event_after

__all__ = ["Policies"]

LOST_TO_OTHERS = ("seat_taken", "not_allowed")  # the offer was another's, or has ended meanwhile


class Policies:
    """`console.policies`: what a person does with policies, and what a policy does.

    A person, whose link is an operator's or a supervisor's, calls `offer` and `withdraw`, and `Console.take_over`.
    A program with the link of a policy waits for `seat`, and then drives with `Console.arm` and `Console.drive` until
    they raise CommandRefused, or calls `shadow` while somebody else drives.
    """

    def __init__(self, transport: Transport, session: Session, driving: Driving, requests: SeatRequests) -> None:
        self._transport = transport
        self._session = session
        self._driving = driving
        self._requests = requests

    @property
    def offered(self) -> bool:
        """True if a person lets a policy drive; stays True while one does."""
        return self._session.seat.offered

    @property
    def connected(self) -> dict[str, str]:
        """The policies that are connected: their names by peer id."""
        people = self._session.participants.participants
        return {each.peer: each.name for each in people if each.role == "policy"}

    @property
    def verdicts(self) -> list[ShadowVerdict]:
        """The last thousand verdicts on shadows that the console has told of, oldest first. It tells of the newest."""
        return list(self._session.verdicts)

    async def offer(self, policy: str = "") -> None:
        """Let a policy drive, which frees the seat if this connection holds it. One offer is one turn of a policy.

        Args:
            policy: the id of the only peer that may take the seat; "": any policy

        Raises:
            SeatRefused: another person drives or asks for the seat, the robot is stopped or away, or this link may not.
        """
        await self._requests.offer(policy)

    def withdraw(self) -> None:
        """End the offer. The policy that drives leaves the seat, and the robot rests."""
        self._requests.withdraw_offer()

    async def seat(self) -> None:
        """Wait until a person offers the seat to this policy, and take it; then call `Console.arm`.

        Raises:
            SeatRefused: this link is an observer's.
            ConsoleLost: the connection ended.
        """
        while not self._session.holds_seat:
            await self._requests.offered_here()
            try:
                await self._requests.take()
            except SeatRefused as refused:
                if self._session.role != "policy" or refused.reason not in LOST_TO_OTHERS:
                    raise

    def shadow(self, values: Values, feedback: Feedback | None = None) -> None:
        """Say what this policy would command as the answer to a feedback. Nothing of it reaches the robot.

        Of each event the last one counts; one that comes after its event was executed is late.

        Args:
            values: as for `Console.drive`
            feedback: the one that the values answer; None: the newest

        Raises:
            CommandError: as for `Console.drive`.
            ConsoleLost: the connection ended.
        """
        answered = feedback or self._driving.driver.sender.newest
        if answered is None:
            return  # there is nothing to answer
        shadow = Shadow(
            event=event_after(answered.event),
            issue=answered.issue,
            nonce=answered.nonce,
            values=command_values(self._driving.robot.description.axes, values),
        )
        self._transport.send("control", shadow)
