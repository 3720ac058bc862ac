"""One robot, its bridge, a console and its people, without I/O: what the random lives of a STOP are played in.

The bridge is `BridgeModel`, around the real cores. The console is the real desk, seat, clock, presses, keeper and stop
service on an event loop that never waits: its time is the world's. The disks are in memory and can fail.
`MotionWitness` says what may move; `Promises` what has to become of a press; both keep books of their own.
"""

import asyncio
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack, suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Literal, cast
from unittest.mock import patch

from lockstep.protocol.console import Role, ServerMessage
from lockstep.protocol.description import RobotDescription
from lockstep.protocol.messages import Command, Feedback, LinkMessage, Refusal, Reset, Rest, Stop, StopTaken
from lockstep.protocol.serial import event_after, is_newer
from lockstep.server.audit.records import Actor
from lockstep.server.auth.silenced_links import SilencedLinks
from lockstep.server.auth.tokens import Identity
from lockstep.server.control.command_arbiter import CommandArbiter, Forward, ForwardRest
from lockstep.server.control.seat.control_seat import ControlSeat
from lockstep.server.control.seat.seat_rules import SeatRules
from lockstep.server.control.seat.seat_table import SeatOutcome
from lockstep.server.control.seat.seat_times import SeatTimes
from lockstep.server.control.stop import reset_service, stop_service, stop_silence
from lockstep.server.control.stop.reset_service import ResetService
from lockstep.server.control.stop.stop_service import StopService
from lockstep.server.control.stop.stop_silence import StopSilence
from lockstep.server.errors import ConsoleError, Silenced
from lockstep.server.event_clock import EventClock
from lockstep.server.peers.peer_registry import PeerRegistry
from lockstep.server.session_events import SessionEvents
from lockstep.server.stop.stop_keeper import StopKeeper
from lockstep.server.stop.stop_presses import Press
from lockstep.server.stop.stop_store import KeptStops
from lockstep.server.telemetry.metrics import Metrics
from tests.robot_bridge.bridge_model import BridgeModel
from tests.robot_bridge.control.core_helpers import AXES, NEUTRAL

__all__ = ["MOVE", "PEOPLE", "World"]

ROBOT = RobotDescription(name="r", label="R", axes=AXES)
MOVE = [0.5, 0.2]
PEOPLE: dict[str, Role] = {"ann": "operator", "bob": "operator", "olga": "observer", "sue": "supervisor"}
TURNS = 12  # of the loop; no step of the console takes more of them
SLOW = "is not on the console's disk"
METRICS = Metrics(process=False)

Link = Literal["operator", "media"]
LINKS: tuple[Link, ...] = ("operator", "media")


class WorldLoop(asyncio.SelectorEventLoop):
    """Its time is the world's, its threads are none, and it never waits."""

    def __init__(self, now: Callable[[], float]) -> None:
        super().__init__()
        self._now = now
        self.set_default_executor(AtOnce(max_workers=1))

    def time(self) -> float:
        return self._now()

    def turn(self) -> None:
        for _ in range(TURNS):
            self.call_soon(self.stop)
            self.run_forever()


class AtOnce(ThreadPoolExecutor):
    def submit(self, call: Callable[..., Any], /, *args: Any, **kwargs: Any) -> "Future[Any]":
        done: Future[Any] = Future()
        try:
            done.set_result(call(*args, **kwargs))
        except BaseException as error:
            done.set_exception(error)
        return done


class Disk:
    def __init__(self) -> None:
        self.files: dict[str, Press] = {}
        self.fails = False


class StopsInMemory(KeptStops):
    def __init__(self, disk: Disk) -> None:
        super().__init__(Path("none"))
        self._disk = disk
        self.killed = False

    def load(self) -> list[Press]:
        return list(self._disk.files.values())

    def keep(self, press: Press) -> None:
        if self.killed:
            return
        if self._disk.fails:
            raise OSError(28, "No space left on device")
        self._disk.files[press.id] = press

    def drop(self, press: str) -> None:
        if not self.killed:
            self._disk.files.pop(press, None)


class MemoryKeeper(StopKeeper):
    def __init__(self, disk: Disk) -> None:
        super().__init__(Path("none"), "robot")
        self._files = self.memory = StopsInMemory(disk)


class Person:
    def __init__(self, name: str, role: Role, told: Callable[[ServerMessage], None]) -> None:
        self.id = f"{name}-1"
        self.name = name
        self.role = role
        self.identity = Identity(role, name, f"link of {name}", 1e12)
        self.silenced = False
        self._told = told

    @property
    def actor(self) -> Actor:
        return Actor(self.name, self.role, self.id, self.identity.token_id)

    def send(self, channel: str, message: ServerMessage) -> None:
        self._told(message)


class People:
    def __init__(self, told: Callable[[ServerMessage], None]) -> None:
        self.all = {name: Person(name, role, told) for name, role in PEOPLE.items()}

    def __iter__(self) -> Iterator[Person]:
        return iter(self.all.values())

    def by_id(self, peer_id: str) -> Person | None:
        return next((person for person in self if person.id == peer_id), None)

    def tell(self, channel: str, message: ServerMessage) -> None:
        pass


class Promises:
    """What the console owes to people who pressed STOP."""

    def __init__(self, given: list[int]) -> None:
        self.owed: set[str] = set()  # presses that must not be lost
        self.kept: set[str] = set()  # and those of which somebody was told that they are on the disk
        self.numbers: dict[int, str] = {}  # number -> the press whose presser was told it
        self.delivered: set[str] = set()
        self._given = given

    def told(self, press: str, number: int) -> None:
        assert number in self._given, "somebody was told a number that the robot never gave"
        assert self.numbers.setdefault(number, press) == press, "two presses have one number"
        self.delivered.add(press)

    def console_killed(self) -> None:
        """What was in its memory alone is lost, and nobody was told anything else."""
        self.owed &= self.kept | self.delivered


class ConsoleModel:
    """One run of a console, as `lockstep.server.control.console.Console` puts its parts together.

    Nobody subscribes to its events.
    """

    def __init__(self, world: "World", disk: Disk) -> None:
        self.up = False
        self.detail = "not connected"
        self.holder = ""
        self.epoch = ""
        self._world = world
        self.people = People(self._told)
        self.clock, self.seat = EventClock(), ControlSeat(SeatTimes())
        self.rules = SeatRules(self.seat)
        self.keeper = MemoryKeeper(disk)
        world.loop.run_until_complete(self.keeper.load())
        self.arbiter = CommandArbiter(self.clock, self.seat, self.keeper.presses)
        peers, events = cast(PeerRegistry, self.people), SessionEvents(METRICS.faults)
        self.silence = StopSilence(SilencedLinks(), peers, events)
        self.service = StopService(
            self,
            self.keeper,
            peers,
            self.clock,
            self.silence,
            events,
        )
        self.resets = ResetService(self, self.service, peers, self.clock, self.seat, events)
        self._parts = [world.loop.create_task(part()) for part in (self.keeper.run, self.service.run, self.resets.run)]
        self._requests: list[asyncio.Task[None]] = []
        self._asker = Actor()
        self.proven = False  # a neutral command of the holder was executed since the last cause that came here
        self._neutral: int | None = None  # the holder's, forwarded since the link came up and the seat changed hands

    def end(self, *, killed: bool) -> None:
        self.keeper.memory.killed = killed
        for task in (*self._requests, *self._parts):
            task.cancel()
        self._world.loop.turn()

    # StopsRobotLink

    def send(self, message: Command | Rest | Reset) -> bool:
        if not self.up:
            return False
        if isinstance(message, Reset):
            assert not self.keeper.presses.pending, "a reset left while a stop was on its way"
            assert self._asker.role == "supervisor" or self._asker.name == self.holder, "reset without the right"
        self._world.to_bridge["operator"].append(message)
        return True

    def send_stop(self, stop: Stop) -> bool:
        for link in LINKS:
            if self._world.is_up(link):
                self._world.to_bridge[link].append(stop)
                return True
        return False

    # what people do

    def sit(self, person: str) -> None:
        who, now = self.people.all[person], self._world.now
        step = self.rules.take if who.role == "supervisor" else self.rules.request
        self._seated(step(who.id, who.role, now))

    def release(self) -> None:
        if self.seat.holder:
            self._seated(self.rules.release(self.seat.holder, self._world.now))

    def _seated(self, outcome: SeatOutcome) -> None:
        if outcome.rest and isinstance(found := self.arbiter.abandon(), ForwardRest):
            self.send(found.rest)
        person = self.people.by_id(self.seat.holder)
        self.holder, before = "" if person is None else person.name, self.holder
        if self.holder != before:
            self.proven, self._neutral = False, None

    def press(self, person: str, id_: str, *, http: bool) -> None:
        actor = self.people.all[person].actor
        press = Press(id=id_, by=actor._replace(peer="") if http else actor, where="http" if http else "stop")
        try:
            self.service.stop(press)
        except Silenced:
            assert self.people.all[person].silenced
            return
        self._world.promises.owed.add(id_)
        if http:
            self._requests.append(self._world.loop.create_task(self._outcome(id_)))

    async def _outcome(self, press: str) -> None:
        outcome = await self.service.outcome(press)
        if outcome.delivered:
            self._world.promises.told(press, outcome.number)
        elif SLOW not in outcome.detail:
            self._world.promises.kept.add(press)

    def reset(self, person: str, number: int, *, http: bool) -> None:
        who = self.people.all[person]
        self._asker = who.actor
        if http:
            self._requests.append(self._world.loop.create_task(self._reset(who.actor._replace(peer=""), number)))
            self._world.loop.turn()
        else:
            self.resets.reset_by_peer(cast(Any, who), number)
        self._asker = Actor()

    async def _reset(self, actor: Actor, number: int) -> None:
        with suppress(ConsoleError):
            await self.resets.reset(actor, "http", number)

    def command(self, person: str, command: Command) -> None:
        who = self.people.all[person]
        outcome = self.arbiter.command(who.id, command, self._world.now)
        if not isinstance(outcome, Forward):
            return
        assert person == self.holder, "somebody drives without the seat"
        assert not self.keeper.presses.pending, "a command passed a stop"
        assert command.nonce in self._world.bridge.issued, "a command passed that has seen nothing"
        if self._world.bridge.core.values.moves(outcome.command.values):
            assert self.proven, "the desk let a moving command pass before a neutral one was executed"
        else:
            self._neutral = outcome.command.event
        self.send(outcome.command)

    def _told(self, message: ServerMessage) -> None:
        if isinstance(message, StopTaken):
            self._world.promises.told(message.press, message.number)

    # what the links do

    def hello(self, epoch: str) -> None:
        if epoch != self.epoch:
            self.epoch = epoch
            self.service.epoch_ends(self.clock.stop)
            self.resets.robot_link_down("the robot bridge was started anew")
            self.arbiter.epoch_ends()
            self.clock.begin(epoch)

    def robot_link_up(self) -> None:
        self.up, self.proven, self._neutral = True, False, None
        self.service.robot_link_up()
        self.arbiter.robot_link_up(ROBOT)

    def robot_link_down(self) -> None:
        self.up, self.detail, self.proven, self._neutral = False, "lost", False, None
        self.arbiter.robot_link_down()
        self.service.robot_link_down()
        self.resets.robot_link_down("lost")

    def hear(self, message: LinkMessage) -> None:
        match message:
            case Feedback():
                shown = self.clock.stop.number
                if not self.clock.observe(message, self._world.now):
                    return
                self._note(message, shown)
                self.arbiter.feedback(message)
                self.resets.feedback(message.stop)
            case Refusal():
                if not self.resets.refused(message):
                    self.arbiter.refused(message)
                    self._neutral = None
            case StopTaken():
                self._told(message)  # if nobody waits for it any more, the audit is told
                self.arbiter.stop_taken(message)
                self.service.taken(message)

    def _note(self, feedback: Feedback, shown: int) -> None:
        executed = self._neutral is not None and not is_newer(self._neutral, feedback.event)
        if executed:
            self._neutral = None
        if feedback.stop.stopped or feedback.neutral_needed or feedback.stop.number > shown:
            self.proven = False
        elif executed:
            self.proven = True


class World:
    """Verbs that move it on by one step each. Call `close` at the end."""

    def __init__(self, *, first_event: int = 1) -> None:
        self.wall = 10**6
        self.loop = WorldLoop(lambda: self.now)
        self.bridge = BridgeModel(first_event=first_event, wall=lambda: self.wall)
        clock = SimpleNamespace(monotonic=lambda: self.now, time=lambda: self.now)
        self._clock = ExitStack()
        for module in (stop_service, reset_service, stop_silence):
            self._clock.enter_context(patch.object(module, "time", clock))
        self.disk = Disk()
        self.promises = Promises(self.bridge.witness.given)
        self.presses: list[str] = []
        self.runs = 0  # of the bridge
        self.live: set[Link] = set()
        self.moved = 0  # moving commands executed after a stop was reset
        self.to_bridge: dict[Link, list[Command | Rest | Stop | Reset]] = {link: [] for link in LINKS}
        self.to_console: dict[Link, list[LinkMessage]] = {link: [] for link in LINKS}
        self._pressed_on: dict[str, Link] = {}
        self.console = ConsoleModel(self, self.disk)

    def close(self) -> None:
        self.console.end(killed=True)
        self._clock.close()
        self.loop.close()

    @property
    def now(self) -> float:
        return self.bridge.now

    def is_up(self, link: Link) -> bool:
        return link in self.live

    def wait(self, seconds: float) -> None:
        self.bridge.now += seconds
        self.loop.turn()

    # what is on its way

    def arrive(self, link: Link, count: int = 1000) -> None:
        """The oldest `count` messages reach the bridge."""
        arrived, self.to_bridge[link] = self.to_bridge[link][:count], self.to_bridge[link][count:]
        for message in arrived:
            if isinstance(message, Stop):
                self._pressed_on[message.press] = link
            self._answer(self.bridge.receive(message))
            if isinstance(message, Command):
                self.moved += self.bridge.driven and bool(self.bridge.witness.given)

    def hear(self, link: Link, count: int = 1000) -> None:
        """The oldest `count` messages reach the console."""
        arrived, self.to_console[link] = self.to_console[link][:count], self.to_console[link][count:]
        for message in arrived:
            self.console.hear(message)
        self.loop.turn()

    def tick(self) -> None:
        self.bridge.now += 0.004
        self._answer(self.bridge.tick())

    def write(self) -> None:
        self._answer(self.bridge.write())

    def pump(self) -> None:
        """All that is on its way arrives, and what it brings about too."""
        for _ in range(2):
            for link in LINKS:
                self.arrive(link)
            self.write()
            self.tick()
            for link in LINKS:
                self.hear(link)

    def _answer(self, messages: list[LinkMessage]) -> None:
        for message in messages:
            link = self._pressed_on.get(message.press, "operator") if isinstance(message, StopTaken) else "operator"
            if link in self.live:
                self.to_console[link].append(message)

    # links and processes

    def connect(self, link: Link) -> None:
        if link in self.live:
            return
        self.live.add(link)
        self.console.hello(str(self.runs))
        if link == "operator":
            self.console.robot_link_up()
            self.bridge.operator_comes()
            self._answer([self.bridge.feedback])
        self.loop.turn()

    def lose(self, link: Link, arrives: int = 0) -> None:
        """Of what was on its way some may arrive."""
        if link not in self.live:
            return
        self.arrive(link, arrives)
        self.hear(link, arrives)
        self.live.discard(link)
        self.to_bridge[link], self.to_console[link] = [], []
        if link == "operator":
            self.bridge.operator_lost()
            self.console.robot_link_down()
        self.loop.turn()

    def lose_all(self, arrives: int = 0) -> None:
        for link in LINKS:
            self.lose(link, arrives)

    def restart_bridge(self, *, in_order: bool, file_lost: bool = False, arrives: int = 0) -> None:
        self.lose_all(arrives)
        locked = self.bridge.witness.locked
        self.bridge.restart(in_order=in_order, file_lost=file_lost)
        self.runs += 1
        if locked:
            self.bridge.lock("key switch")

    def restart_console(self, *, killed: bool, arrives: int = 0) -> None:
        self.lose_all(arrives)
        self.console.end(killed=killed)
        if killed or self.disk.fails:
            self.promises.console_killed()
        self.console = ConsoleModel(self, self.disk)

    # people

    def press(self, person: str, *, again: bool = False, http: bool = False) -> None:
        if not (again and self.presses):
            self.presses.append(f"{len(self.presses) + 1:032x}")
        self.console.press(person, self.presses[-1], http=http)
        self.loop.turn()

    def press_as(self, person: str, id_: str, *, http: bool = False) -> None:
        """With an id that somebody has used before."""
        self.console.press(person, id_, http=http)
        self.loop.turn()

    def reset(self, person: str, offset: int = 0, *, http: bool = False) -> None:
        self.console.reset(person, max(0, self.console.clock.stop.number + offset), http=http)
        self.loop.turn()

    def command(self, person: str, values: list[float]) -> None:
        feedback = self.console.clock.feedback
        if feedback is not None:
            event = event_after(feedback.event)
            command = Command(event=event, issue=feedback.issue, values=values, nonce=feedback.nonce)
            self.console.command(person, command)

    def drive(self, *values: list[float]) -> None:
        """The holder sends these, each as the answer to the newest feedback."""
        for each in values:
            self.pump()
            if self.console.holder:
                self.command(self.console.holder, each)
        self.pump()

    def arm_and_drive(self) -> None:
        for link in LINKS:
            self.connect(link)
        if not self.console.holder:
            self.console.sit("ann")
        self.drive(NEUTRAL, MOVE)

    def let_a_second_pass_and_reset(self, person: str = "sue", *, http: bool = False) -> None:
        self.connect("operator")
        self.pump()
        self.wait(1.1)
        self.pump()
        self.reset(person, http=http)
        self.pump()

    # what has to be so

    def check(self) -> None:
        assert not (self.bridge.driven and self.bridge.witness.holds), "it is driven while a stop holds"
        presses = self.console.keeper.presses
        for press in self.promises.owed:
            assert press in self.promises.delivered or presses.is_pending(press), "a press is lost"
