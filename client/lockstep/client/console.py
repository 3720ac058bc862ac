"""The console without a browser: connect, watch, drive."""

import asyncio
from collections.abc import AsyncGenerator, Callable, Iterator, Mapping
from contextlib import aclosing, contextmanager, suppress
from pathlib import Path
from types import TracebackType
from typing import Self, cast

from av import AudioFrame, VideoFrame
from msgspec.structs import replace

from lockstep.client.connection import Connection
from lockstep.client.connection_options import ConnectionOptions
from lockstep.client.console_url import parse_link
from lockstep.client.control.axis_values import Values, command_values
from lockstep.client.control.clutch import Clutch
from lockstep.client.control.command_gate import GateState, Pacing
from lockstep.client.control.goal_move import GoalMove
from lockstep.client.episodes import Episodes
from lockstep.client.errors import ActionRefused, CommandError, ConsoleError, ConsoleLost
from lockstep.client.media.media_gate import GateMode
from lockstep.client.media.newest_queue import QueueClosed
from lockstep.client.media.render_log import FeedbackArrival, Rendering
from lockstep.client.media.stream import Picture, Sound
from lockstep.client.policies import Policies
from lockstep.client.statistics import ConsoleStatistics
from lockstep.client.transport.webrtc_transport import Route
from lockstep.protocol.actions import ActionUpdate, ParameterValue, StatusItem
from lockstep.protocol.carriers import Carrier
from lockstep.protocol.console import Participant, Role, Seat, SharedNote
from lockstep.protocol.description import RobotDescription
from lockstep.protocol.maps import Navigation, OccupancyMap
from lockstep.protocol.messages import Feedback, StopState
from lockstep.protocol.neutral import neutral_values
from lockstep.protocol.traces.trace_messages import TraceRequest, Traces

__all__ = ["Console"]

LEAVE_SECONDS = 1.5  # time for the robot to come to rest before the connection is closed


class Console:
    """One connection to a Lockstep console, as an async context manager: `async with Console(link) as console:`.

    Entering connects. Leaving brings the robot to rest, releases the seat and closes. After ConsoleLost make a new
    Console.

    Args:
        link: the link that `lockstep up` prints: "http://host:port/#token=…"
        pacing: "feedback": the next command waits for the feedback of the last, and up to 0.2 s for sound that is
            read and that it would make too old; "media": also for its picture, and such sound
        tolerance: largest gap of a rendered picture, in events; 0 or more
        audio_tolerance: the same for sound
        gate: "event": the rule. "off": renders everything, for comparison
        carrier: the way in which the event reference travels with media; no other carrier is offered
        video: number of cameras, at most; True: four, False: none
        audio: True to receive sound
        decode: False only counts RTP packets and frames: no pictures, no sound, hardly any cost
        codec: "VP8" or "H264"; None: the console's first choice
        sound_codec: "opus" or "PCMU"; None: the console's first choice
        event_rate: events per second, at most; None: the rate of the robot's description, which is never exceeded
        name: the name that other participants see
        connect_seconds: s allowed for connecting, including the wait for the robot
        silence_seconds: s without a message from the console after which the connection counts as lost
        tls_ca: file with a certificate to trust instead of the system's, such as a console's own (tls-cert.pem)
        relay_only: connect through the console's TURN server or not at all
        through_relay: an observer watches through a relay (docs/relay.md) if the console has one for it
        route: passes the connection through a forwarder; for measurements

    Raises:
        LinkFormatError: the link is not one that `lockstep up` prints.
        ValueError: pacing by media without decoded pictures.
        SignallingRefused: on entering: the console refused the connection, for example because the link is old.
        ConnectFailed: on entering: no console, robot or network path was found within `connect_seconds`.
    """

    def __init__(
        self,
        link: str,
        *,
        pacing: Pacing = "feedback",
        tolerance: int = 4,
        audio_tolerance: int = 6,
        gate: GateMode = "event",
        carrier: Carrier = "native",
        video: bool | int = True,
        audio: bool = True,
        decode: bool = True,
        codec: str | None = None,
        sound_codec: str | None = None,
        event_rate: float | None = None,
        name: str = "script",
        connect_seconds: float = 30.0,
        silence_seconds: float = 5.0,
        route: Route | None = None,
        tls_ca: str | Path | None = None,
        relay_only: bool = False,
        through_relay: bool = False,
    ) -> None:
        if pacing == "media" and not (decode and video):
            raise ValueError("pacing by media needs decoded pictures")
        self._options = ConnectionOptions(
            link=parse_link(link),
            pacing=pacing,
            tolerance={"video": tolerance, "audio": audio_tolerance},
            gate=gate,
            carrier=carrier,
            video=4 if video is True else int(video),
            audio=audio,
            decode=decode,
            codec=codec,
            sound_codec=sound_codec,
            event_rate=event_rate,
            name=name,
            connect_seconds=connect_seconds,
            silence_seconds=silence_seconds,
            route=route,
            tls_ca=None if tls_ca is None else Path(tls_ca),
            relay_only=relay_only,
            through_relay=through_relay,
        )
        self._connection: Connection | None = None

    async def __aenter__(self) -> Self:
        """Connect; the class says which errors that may raise."""
        connection = Connection(self._options)
        try:
            await connection.open()
        except BaseException:
            await connection.close()
            raise
        self._connection = connection
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        """Bring the robot to rest, release the seat, and close."""
        connection = self._live()
        try:
            if connection.session.holds_seat and connection.lost is None:
                async with asyncio.timeout(LEAVE_SECONDS):
                    await connection.driving.driver.rest()
        except (ConsoleError, TimeoutError):
            pass  # the bridge brings the robot to rest when its operator is gone
        finally:
            if connection.session.holds_seat:
                connection.requests.seat.release()
            await connection.close()

    # Known state

    @property
    def description(self) -> RobotDescription:
        """The description of the robot: its axes, sensors and cameras."""
        return self._live().driving.robot.description

    @property
    def epoch(self) -> str:
        """The id of the robot bridge's run; event references of two epochs are not comparable."""
        return self._live().driving.robot.epoch

    @property
    def feedback(self) -> Feedback | None:
        """The newest feedback; None before the first. `drive` and `feedbacks` return it too."""
        return self._live().driving.driver.sender.newest

    @property
    def gate_state(self) -> GateState:
        """The state of the gate: "open" if a command may leave now, otherwise the reason against it."""
        return self._live().driving.driver.sender.gate.state(asyncio.get_running_loop().time())

    @property
    def seat(self) -> Seat:
        """The control seat: its holder and the requests for it."""
        return self._live().session.seat

    @property
    def peer(self) -> str:
        """This connection's id, as in `seat.holder`."""
        return self._live().session.peer

    @property
    def relay(self) -> str:
        """The relay that media come through, as the console counts them ("0", …); "" if media come from the console."""
        relay = self._live().relay
        return "" if relay is None else relay.name

    @property
    def role(self) -> Role:
        """The role of this link."""
        role = self._live().session.role
        assert role is not None  # `Connection.open` waits for it
        return role

    @property
    def participants(self) -> list[Participant]:
        """All connected participants, this connection included."""
        return list(self._live().session.participants.participants)

    @property
    def notes(self) -> list[SharedNote]:
        """The last hundred notes to everyone, oldest first."""
        return list(self._live().session.notes)

    @property
    def actions(self) -> list[ActionUpdate]:
        """The states of the robot's newest actions, oldest first, whoever asked for them."""
        return list(self._live().news.updates.values())

    @property
    def episodes(self) -> Episodes:
        """The episodes of the console's recording: `await console.episodes.start("pick up the cube")`."""
        return self._live().requests.episodes

    @property
    def policies(self) -> Policies:
        """Policies: offering them the seat, and what a policy itself calls (docs/policies.md)."""
        connection = self._live()
        return Policies(connection.transport, connection.session, connection.driving, connection.requests.seat)

    @property
    def status(self) -> list[StatusItem]:
        """The robot's reports of itself: battery, mode, temperatures. Empty before the first report.

        `age` (s) of each item is its age now.
        """
        news = self._live().news
        since = asyncio.get_running_loop().time() - news.status_at
        items = [] if news.status is None else news.status.items
        return [replace(item, age=item.age + since) for item in items]

    @property
    def navigation(self) -> Navigation | None:
        """Where the robot is on its map, and where it is going; None before the robot has said so.

        `map_age` and `path_age` (s) are those of now.
        """
        news = self._live().news
        if news.navigation is None:
            return None
        since = asyncio.get_running_loop().time() - news.navigation_at
        told = news.navigation
        return replace(told, map_age=told.map_age + since, path_age=told.path_age + since)

    async def map(self) -> OccupancyMap | None:
        """Fetch the robot's newest map; None if it has sent none. `lockstep.protocol.maps.map_cells` gives its cells.

        `navigation.map` is the `id` of the newest one: fetch a map again when that has changed.

        Raises:
            SignallingRefused: the console answered with an error.
            ConnectFailed: it did not answer.
        """
        return await self._live().transport.whep.map()

    def stats(self) -> ConsoleStatistics:
        """Return the figures since the connection began."""
        return self._live().statistics()

    def rendered(self, stream: str) -> list[Rendering]:
        """Return the last thousand renderings of the camera or microphone `stream`, oldest first."""
        return self._live().media.log(stream)

    def feedback_log(self) -> list[FeedbackArrival]:
        """Return the last thousand feedbacks and their arrival times (s, the loop's clock), oldest first."""
        return list(self._live().driving.arrivals)

    def trace(self, wanted: bool = True) -> None:
        """Ask the console to send traces of pictures and commands, which `traces` returns, or to send no more.

        Args:
            wanted: False ends the traces; a new connection has none
        """
        self._live().transport.send("session", TraceRequest(wanted=wanted))

    def traces(self) -> Traces:
        """Return the last thousand pictures' and commands' spans at the robot and the console, oldest first.

        Empty before `trace`. The console sends traces a few times a second, with only the newest pictures of each
        camera, and not while feedback waits to be sent. docs/traces.md explains the spans.
        """
        session = self._live().session
        return Traces(pictures=list(session.traced_pictures), commands=list(session.traced_commands))

    async def restart_ice(self) -> None:
        """Look for a new path to the console, as after a change of networks; the connection lives on meanwhile.

        Only packets under way are lost, and the seat is kept. If the path was gone for longer than the console waits
        for a sign of life (20 s), make a new `Console`.

        Raises:
            SignallingRefused: the console has given up this connection.
            ConnectFailed: no new path was found in time; the old one stays. An observer's WebSocket beside a relay is
                TCP and has no other path.
        """
        connection = self._live()
        await connection.transport.restart_ice(connection.options.connect_seconds)

    # Driving

    async def take_seat(self) -> None:
        """Take the control seat, an operator when it is free, a supervisor from any holder; then `arm`.

        While the robot is stopped or away, only the seat is taken; call `arm` later. Arming answers a feedback, so the
        first one is waited for.

        Raises:
            SeatRefused: another peer holds the seat, or this link is an observer's.
            NoFeedback: the seat is taken, but no feedback came within 5 s from a robot that is not away.
        """
        seat = self._live().requests.seat
        await seat.take()
        await seat.arm_if_possible()

    async def take_over(self) -> None:
        """Take the seat from the policy that drives, at once, or a free one; then `arm`, as `take_seat` does.

        The robot rests first. A clutch has to be engaged anew, so that the robot does not jump to where the device is.

        Raises:
            SeatRefused: another person holds the seat, or this link is an observer's or a policy's.
            NoFeedback: as for `take_seat`.
        """
        seat = self._live().requests.seat
        await seat.take_over()
        await seat.arm_if_possible()

    async def request_seat(self, seconds: float = 65.0) -> None:
        """Ask the holder for the control seat and wait until it is granted; a free seat is granted at once.

        The console counts no answer within 60 s as no. Cancellation withdraws the request.

        Args:
            seconds: s to wait for the console's answer, more than the holder's 60 s

        Raises:
            SeatRefused: the holder declined or did not answer, or this link is an observer's.
            NoFeedback: as for `take_seat`.
        """
        seat = self._live().requests.seat
        await seat.request(seconds)
        await seat.arm_if_possible()

    async def arm(self) -> Feedback:
        """Let the robot move again: send one neutral command and return the feedback that answers it.

        Needed after a stop and its reset, a lost robot link, and whenever the robot says so; taking the seat arms too.
        Call it when the responsible person wants the robot to move on, never as an answer to `NotArmed` alone.

        Raises:
            CommandRefused: the robot is stopped, this console does not hold the seat, …
            ConsoleLost: the connection ended.
        """
        return await self._live().driving.driver.arm()

    def grant(self, peer: str) -> None:
        """Hand the control seat to a peer that asked for it.

        Args:
            peer: the id of one of `seat.claims`
        """
        self._live().requests.seat.answer(peer, grant=True)

    def decline(self, peer: str) -> None:
        """Refuse a peer that asked for the control seat.

        Args:
            peer: the id of one of `seat.claims`
        """
        self._live().requests.seat.answer(peer, grant=False)

    def release_seat(self) -> None:
        """Release the control seat, or withdraw a request for it."""
        self._live().requests.seat.release()

    async def drive(self, values: Values, *, speed: float = 1.0) -> Feedback:
        """Send one command as soon as the gate is open; return the feedback that answers it.

        The first call arms: from then on, whenever 200 ms pass without another call, the console sends neutral values,
        five times a second, until `rest`: rate axes are at rest then, and goal axes stay where they are. A lost command
        is repeated; a command that arrived too late is tried again on fresh feedback.

        Args:
            values: one value per axis in the description's order, or axis names with their values; other axes at rest,
                or where they are. In the axis' unit (such as m/s, or rad of a goal axis); None, for goal axes only: it
                stays. The bridge limits a value to the axis' `minimum` and `maximum`, and refuses a goal that is
                further than `reach` from the measured value (`jump`)
            speed: the share of the goal axes' largest speed that is used at most, 0 to 1

        Raises:
            CommandError: an unknown axis, a wrong number of values, None for a rate axis, a value that is not finite,
                or a speed that is not from 0 to 1.
            NotArmed: after a stop, a reset, a lost robot link or a new seat, `arm` comes first.
            CommandRefused: the robot is stopped, this console does not hold the seat, …
            ConsoleLost: the connection ended.
        """
        driving = self._live().driving
        command = command_values(driving.robot.description.axes, values)
        if not 0 <= speed <= 1:
            raise CommandError("the speed is not from 0 to 1")
        driving.check_ready()
        return await driving.driver.drive(command, speed)

    async def move_to(
        self,
        goals: Mapping[str, float],
        *,
        speed: float = 1.0,
        tolerance: Mapping[str, float] | float | None = None,
    ) -> Feedback:
        """Drive goal axes until they are measured at these values; return the feedback that shows it.

        Goals may be further away than the axes' `reach`: each event asks for as much of the way as is allowed. Other
        axes are at rest. Cancellation, and every error, sends a rest: the robot brakes and stays. `drive` and `act`
        must not run meanwhile.

        Args:
            goals: by axis, in its unit, within its `minimum` and `maximum`
            speed: the share of the axes' largest speed that is used at most, 0 to 1
            tolerance: the distance that counts as there, in the axis' unit, for all axes or by axis; None: a twentieth
                of the axis' `reach`

        Raises:
            CommandError: no goal axis of this name, or a goal out of its range.
            GoalNotReached: no axis came nearer to its goal for 2 s.
            NotArmed, CommandRefused, ConsoleLost: as for `drive`.
        """
        driver, move = self._live().driving.driver, GoalMove(self.description, goals, tolerance)
        clock = asyncio.get_running_loop().time
        answer = await self.drive(neutral_values(self.description.axes), speed=speed)
        try:
            while not move.arrived(answer, clock()):
                answer = await self.drive(move.values(answer), speed=speed)
        except BaseException:
            with suppress(ConsoleLost):
                driver.let_go()
            raise
        return answer

    def clutch(self, scales: Mapping[str, float]) -> Clutch:
        """Return a clutch that binds a device, such as a leader arm, to goal axes of this robot.

        It sees each feedback. It is released, and has to be engaged anew, when the seat or the arming is lost, the
        robot is stopped or needs a neutral command, no feedback came for the description's `max_event_age`, or nothing
        was driven for 200 ms. When feedback comes back after such a gap, the console sends a rest, and a `drive` that
        waits raises CommandRefused (`rested`): its goal is from before the gap.

        Args:
            scales: goal axes by name, in the order of the device's readings, with the goal per device motion

        Raises:
            ValueError: no axis of this name, no goal axis, or a scale that is not finite.
        """
        clutch = Clutch(self.description, scales)
        self._live().driving.driver.watch(clutch)
        return clutch

    async def act(
        self,
        name: str,
        parameters: Mapping[str, ParameterValue] | None = None,
        *,
        progress: Callable[[ActionUpdate], None] | None = None,
    ) -> ActionUpdate:
        """Ask for an action of the robot's description, once; return its last update when it is done.

        While an action moves the robot, this call sends neutral commands that renew the action, as fast as answers
        come. Without them the robot ends the action within `hold`. `drive` with values that move an axis cancels the
        action, and so does the cancellation of this call.

        Args:
            name: the name of one of `description.actions`
            parameters: values by name; those with a default may be left out
            progress: called with each update: the `running` ones, with the progress from 0 to 1, and the last one

        Raises:
            ActionRefused: the action was not begun; `reason` says why.
            NotArmed: call `arm` first, as before driving.
            ActionCancelled: the action was begun and cancelled; `reason` says why.
            ActionFailed: the robot failed at the action.
            ConsoleLost: the connection ended; the robot has ended every action that moves it.
        """
        return await self._live().requests.actions.act(name, parameters or {}, progress)

    async def go_to(
        self, x: float, y: float, yaw: float | None = None, *, progress: Callable[[ActionUpdate], None] | None = None
    ) -> ActionUpdate:
        """Send the robot to a place on its map, by the action that its description names; return its last update.

        The robot drives by itself while this call renews the action, as `act` says; it raises the same errors.

        Args:
            x: m, in the map's frame
            y: m
            yaw: rad, the heading at the end, where the robot takes one; None: the action's own default
            progress: as for `act`

        Raises:
            ActionRefused: besides the reasons of `act`, `unknown_action`: this robot has no goals on a map.
        """
        view = self._live().driving.robot.description.map
        if view is None or not view.goal:
            raise ActionRefused("unknown_action", "the robot has no goals on a map")
        heading: dict[str, ParameterValue] = {} if yaw is None else {"yaw": float(yaw)}
        return await self.act(view.goal, {"x": float(x), "y": float(y), **heading}, progress=progress)

    async def rest(self) -> None:
        """Send a rest at once, past the gate, and repeat it until the robot is proven to be at rest. Disarms."""
        await self._live().driving.driver.rest()

    async def stop(self, reason: str = "") -> StopState:
        """Latch the stop, from any role, at any time.

        Return it, with its number, when the robot has confirmed this very press. When the data channel does not
        confirm it, the press goes over HTTP as well.

        Args:
            reason: what everybody and the audit trail are told

        Raises:
            StopUnconfirmed: the robot has not confirmed it; the console keeps the stop if it was reached.
        """
        connection = self._live()
        return await connection.requests.stop.stop(connection.options.name, reason)

    async def reset(self, number: int | None = None) -> StopState:
        """Release a stop. Moves nothing; `arm` comes next.

        Args:
            number: of the stop; None: the newest that this connection knows

        Raises:
            CommandRefused: this connection neither holds the seat nor is a supervisor's, there is a newer stop
                (`stale_reset`), the stop is less than a second old (`too_soon`), a person at the robot keeps the stop
                (`locked_out`), …
        """
        connection = self._live()
        wanted = connection.session.newest_stop if number is None else number
        return await connection.requests.stop.reset(connection.options.name, wanted)

    async def note(self, text: str) -> SharedNote:
        """Write a note to everyone and return it; it keeps the event reference of that moment.

        Args:
            text: at most 500 characters

        Raises:
            CommandRefused: there are too many notes, or nothing in this one can be printed.
        """
        return await self._live().requests.notes.write(text)

    # Watching

    async def feedbacks(self) -> AsyncGenerator[Feedback]:
        """Yield every new feedback; a slow reader gets only the newest.

        Raises:
            ConsoleLost: the connection ended.
        """
        connection = self._live()
        with _ending_with(connection), connection.driving.readers.open(1) as queue:
            while True:
                yield await queue.get()

    async def pictures(self, camera: str = "", *, keep: int = 2) -> AsyncGenerator[Picture]:
        """Yield the pictures of a camera that pass the gate; each is checked again when it is taken.

        Args:
            camera: its name in the description; "" is the main one
            keep: pictures that may wait for a slow reader, which loses the oldest

        Raises:
            ConsoleLost: the connection ended.
            NoSuchStream: this camera is not received.
        """
        connection = self._live()
        stream = connection.media.stream("video", camera)
        with _ending_with(connection):
            async with aclosing(stream.read(keep)) as media:
                async for medium, gap in media:
                    yield Picture(stream.name, medium.stamp, gap, cast(VideoFrame, medium.frame))

    async def sounds(self, microphone: str = "", *, keep: int = 50) -> AsyncGenerator[Sound]:
        """Yield the segments of a microphone that pass the gate, as `pictures` does.

        Args:
            microphone: its name in the description; "" is the first one
            keep: segments that may wait for a slow reader, which loses the oldest

        Raises:
            ConsoleLost: the connection ended.
            NoSuchStream: this microphone is not received.
        """
        connection = self._live()
        stream = connection.media.stream("audio", microphone)
        with _ending_with(connection):
            async with aclosing(stream.read(keep)) as media:
                async for medium, gap in media:
                    yield Sound(stream.name, medium.stamp, gap, cast(AudioFrame, medium.frame))

    def _live(self) -> Connection:
        if self._connection is None:
            raise ConsoleLost("not connected: use `async with Console(link) as console`")
        return self._connection


@contextmanager
def _ending_with(connection: Connection) -> Iterator[None]:
    """End when the queue that is read inside ends. Raises ConsoleLost: the connection ended."""
    try:
        yield
    except QueueClosed:
        if connection.lost is not None:
            raise connection.lost from None
