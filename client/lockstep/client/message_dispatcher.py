"""Hands each message of the console to its part of the connection, and wakes those that wait for one."""

import asyncio
from collections.abc import Callable

from lockstep.client.control.driving import Driving
from lockstep.client.episodes import EpisodeNews
from lockstep.client.errors import ConsoleLost
from lockstep.client.heartbeat import Heartbeat
from lockstep.client.media.media_receiver import MediaReceiver
from lockstep.client.robot_actions import RobotNews
from lockstep.client.session import Session
from lockstep.protocol.actions import ActionUpdate, Status
from lockstep.protocol.console import (
    Participants,
    RobotState,
    Seat,
    ShadowVerdict,
    SharedNote,
    StopStateNotice,
    Welcome,
    decode_server_message,
)
from lockstep.protocol.episodes import EpisodeAnswer, EpisodeState
from lockstep.protocol.errors import MessageError
from lockstep.protocol.maps import Navigation
from lockstep.protocol.messages import Feedback, Pong, Refusal, StopTaken
from lockstep.protocol.traces.trace_messages import Traces

__all__ = ["MessageDispatcher"]


class MessageDispatcher:
    """Call `received` with every message, and `end` when no more will come.

    Attributes:
        lost: why no more messages come; None while they do
        news: of the robot's actions, status and place
        episodes: what the console has said of episodes
        malformed: messages from the console that could not be read
    """

    def __init__(self, session: Session, driving: Driving, media: MediaReceiver, heartbeat: Heartbeat) -> None:
        self.lost: ConsoleLost | None = None
        self.malformed = 0
        self._session = session
        self._driving = driving
        self._media = media
        self._heartbeat = heartbeat
        self.news = RobotNews()
        self.episodes = EpisodeNews()
        self._changed = asyncio.Event()  # a message came, or the end

    async def until(self, condition: Callable[[], bool]) -> None:
        """Wait until a message makes the condition true. Raises ConsoleLost."""
        while not condition():
            if self.lost is not None:
                raise self.lost
            await self._changed.wait()

    def end(self, lost: ConsoleLost) -> None:
        """End every wait."""
        self.lost = lost
        self._wake_waiters()

    def received_from_relay(self, data: str | bytes) -> None:
        """Take only the kinds of message that this client asked the relay for."""
        try:
            message = decode_server_message(data)
        except MessageError:
            self.malformed += 1
            return
        if isinstance(message, Feedback | Pong):
            self.received(data)

    def received(self, data: str | bytes) -> None:
        """Take a message from the console."""
        try:
            message = decode_server_message(data)
        except MessageError:
            self.malformed += 1
            return
        self._heartbeat.heard()
        match message:
            case Feedback():
                self._feedback(message)
            case Refusal():
                if message.event == 0:
                    self._session.refused(message)
                self._driving.refusal(message)
            case Pong():
                self._pong(message)
            case RobotState():
                waiting = self._driving.describe(message)
                if waiting is not None:
                    self._feedback(waiting)
            case StopStateNotice():
                self._session.stop_shown(message.stop)
            case StopTaken():
                self._session.stop_taken(message)
            case ActionUpdate() | Status() | Navigation():
                self.news.hear(message, asyncio.get_running_loop().time())
            case EpisodeState() | EpisodeAnswer():
                self.episodes.hear(message)
            case Welcome() | Seat() | Participants() | SharedNote() | Traces() | ShadowVerdict():
                self._session.hear(message)
        self._wake_waiters()

    def _feedback(self, feedback: Feedback) -> None:
        if self._driving.feedback(feedback):
            self._media.feedback(feedback.event)

    def _pong(self, pong: Pong) -> None:
        round_trip = self._heartbeat.pong(pong)
        if round_trip is not None:
            self._driving.round_trip(round_trip)
            self._media.round_trip(round_trip)

    def _wake_waiters(self) -> None:
        self._changed.set()
        self._changed = asyncio.Event()
