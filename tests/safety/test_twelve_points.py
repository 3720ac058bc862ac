"""What a reviewer of a teleoperation system looks for, one test for each point that Python can show.

They stand together so that they are found; more on each of them stands where the rule is kept (docs/safety.md has the
table). What the page does is tested in web/test and tests/e2e.
"""

import ast
import json
from pathlib import Path

import httpx
import msgspec
import pytest

import lockstep.robot_bridge
from lockstep.client.control.command_gate import CommandGate
from lockstep.client.control.command_sender import CommandSender
from lockstep.protocol.console import Rename, Role, SeatRequest, StopStateNotice
from lockstep.protocol.framing import frame
from lockstep.protocol.messages import (
    Command,
    Feedback,
    Goodbye,
    Hello,
    Refusal,
    RefusalReason,
    Reset,
    Rest,
    Stop,
    encode_message,
)
from lockstep.protocol.serial import event_after
from lockstep.robot_bridge.control.event_core import Executed, Refused
from lockstep.robot_bridge.control.limits.axis_shaper import AxisShaper
from lockstep.robot_bridge.link.heartbeats import SILENCE
from lockstep.robot_bridge.link.link_session import BridgeSession
from lockstep.robot_bridge.robots.planar.description import DESCRIPTION
from tests.robot_bridge.bridge_helpers import (
    DRIVE,
    NEUTRAL,
    RecordingRobot,
    log_lines,
    operator,
    raw_link,
    running_bridge,
)
from tests.robot_bridge.control.core_helpers import MAX_AGE, MEASURED, command, core_at
from tests.server.rig import eventually, running_rig

ROLES: list[Role] = ["operator", "observer", "supervisor"]
DT = 0.004


def pilot_after_driving() -> tuple[CommandSender, float]:
    """A client's pilot that has driven event 2 and got its feedback, and now."""
    sender = CommandSender(CommandGate("feedback", 4, 0.0), NEUTRAL)
    sender.feedback(Feedback(event=1, issue=1, time=0.0, axes=NEUTRAL), 0.0)
    sender.readiness.ready = True
    sender.intend(DRIVE, 0.0)
    assert [message.values for message in sender.due(0.0) if isinstance(message, Command)] == [DRIVE]
    sender.feedback(Feedback(event=2, issue=1, time=0.0, axes=DRIVE, at_rest=False), 0.05)
    return sender, 0.05


def test_point_01_hold_to_run_a_script_that_stops_commanding_lets_go() -> None:
    """The page's deadman is tested in web/test/drive/arming.test.ts. Without one, silence is letting go."""
    sender, now = pilot_after_driving()
    sent = [message for step in range(60) for message in sender.due(now + step * 0.01)]
    assert sent
    assert all(message.values == NEUTRAL for message in sent if isinstance(message, Command))
    shaper = AxisShaper(DESCRIPTION.axes, hold=DESCRIPTION.hold)
    shaper.drive([0.5, 0.0, 0.0], 0.0)
    for tick in range(round(DESCRIPTION.hold / DT) + 1):
        values = shaper.step(tick * DT, DT)
    assert values == NEUTRAL


def test_point_02_one_zero_at_release_then_silence() -> None:
    sender, now = pilot_after_driving()
    sender.rest(now)
    released = sender.due(now)
    assert [type(message) for message in released] == [Rest, Command]
    assert isinstance(released[1], Command)
    assert released[1].values == NEUTRAL
    sender.feedback(Feedback(event=3, issue=1, time=0.0, axes=NEUTRAL, at_rest=True), now + 0.05)
    later = [message for step in range(1000) for message in sender.due(now + 0.05 + step * 0.01)]
    assert later == []


def test_point_03_the_timeout_is_the_robots_and_on_a_monotonic_clock() -> None:
    """No file of the bridge reads a clock that can be set, but the one that begins to number stops by it."""
    settable = {("time", "time"), ("time", "time_ns"), ("datetime", "now"), ("datetime", "utcnow"), ("date", "today")}
    for path in Path(lockstep.robot_bridge.__file__).parent.rglob("*.py"):
        if path.name == "stop_store.py":
            continue
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
                assert (node.value.id, node.attr) not in settable, path.name


async def test_point_03_when_commands_end_the_robot_comes_to_rest_by_itself_while_the_link_lives() -> None:
    robot = RecordingRobot()
    async with running_bridge(robot) as bridge, operator(bridge) as driver:
        await driver.drive_until(lambda: robot.applied[-1][1] != NEUTRAL)
        await driver.heard(lambda feedback: feedback.at_rest)
        assert robot.applied[-1][1] == NEUTRAL


def test_point_04_malformed_input_does_not_feed_the_watchdog() -> None:
    session = BridgeSession(0.0, lambda _: Hello(role="robot", epoch="e", description=DESCRIPTION))
    session.receive(frame(encode_message(Hello(role="operator"))), 0.0)
    now = 0.0
    while session.ended is None and now < 3 * SILENCE:
        now += 0.05
        session.receive(frame(b"\xc1nonsense"), now)
        session.tick(now)
    assert session.ended is not None
    assert session.ended.error == "silent"
    assert now <= SILENCE + 0.1


async def test_point_04_malformed_input_does_not_keep_the_robot_moving() -> None:
    robot = RecordingRobot()
    async with running_bridge(robot) as bridge, raw_link(bridge, "operator") as link:
        while robot.applied[-1:] == [] or robot.applied[-1][1] == NEUTRAL:
            feedback = await link.find(Feedback)  # those that nobody asked for come, too
            values = NEUTRAL if feedback.neutral_needed else DRIVE
            following = event_after(feedback.event)
            link.send(Command(event=following, issue=feedback.issue, nonce=feedback.nonce, values=values))
        while (message := await link.next()) is not None and not isinstance(message, Goodbye):
            link.writer.write(frame(b"\xc1nonsense"))
        assert robot.applied[-1][1] == NEUTRAL


@pytest.mark.parametrize("role", ROLES)
@pytest.mark.parametrize("way", ["stop", "control", "session", "http"])
async def test_point_05_stop_passes_from_anyone_at_any_time_past_every_gate(role: Role, way: str) -> None:
    """Nobody of these holds the seat, and each has used up what it may send."""
    async with running_rig(max_message_rate=5.0) as rig, rig.peer(role) as peer, rig.peer("observer") as witness:
        for _ in range(60):
            peer.send("session", Rename(name="noise"))
        if way == "http":
            await rig.http.post("/api/stop", headers=rig.token(role), json={"reason": "now"})
        else:
            peer.send(way, Stop(reason="now"))
        await witness.until(lambda each: isinstance(each, StopStateNotice) and each.stop.stopped)
        await eventually(lambda: rig.count("lockstep_bad_input_total", where="session", reason="flood") > 0)


async def test_point_06_trips_latch_and_reset_moves_nothing() -> None:
    robot = RecordingRobot()
    async with running_bridge(robot) as bridge, operator(bridge) as driver:
        await driver.drive()
        driver.link.send(Stop(by="test", reason="trip"))
        await driver.heard(lambda feedback: feedback.stop.stopped and feedback.at_rest)
        assert (await driver.refused(driver.command())).reason == "stopped"
        await driver.reset()
        since = len(robot.applied)
        await robot.until(lambda: len(robot.applied) > since + 20, "the robot ticks on")
        assert all(values == NEUTRAL for _, values in robot.applied[since:])


async def test_point_07_an_operator_who_is_gone_leaves_the_robot_at_rest() -> None:
    """Blur, hidden tab and unplugged pad are tested elsewhere.

    tests/e2e/driving/test_chromium_driving.py and web/test/drive/arming.test.ts
    """
    robot = RecordingRobot()
    async with running_bridge(robot) as bridge:
        async with operator(bridge) as driver:
            await driver.drive()
        await robot.until(lambda: robot.applied[-1][1] == NEUTRAL, "it comes to rest")


def test_point_08_no_backlog_is_ever_replayed() -> None:
    """Ten copies of a command and its successors come out of a network that froze for ten seconds."""
    core = core_at(7, now=100.0)
    frozen = [command(event) for event in (8, 8, 8, 9, 10, 11, 8, 9)]
    for each in frozen:
        outcome = core.command(each, 100.0 + 10.0)
        assert isinstance(outcome, Refused)
        if core.issue_due(110.0):
            core.issue(MEASURED, 110.0)
    assert core.current == 7


async def test_point_09_clamp_and_slew_limits_are_on_the_robot() -> None:
    robot = RecordingRobot()
    async with running_bridge(robot) as bridge, operator(bridge) as driver:
        for _ in range(10):
            await driver.drive([1e9, -1e9, 1e9])
    previous = NEUTRAL
    for _, values in robot.applied:
        for axis, before, after in zip(DESCRIPTION.axes, previous, values, strict=True):
            assert axis.minimum <= after <= axis.maximum
            assert abs(after - before) <= max(axis.slew, axis.brake) * robot.tick_seconds + 1e-9
        previous = values


BRIDGE_REASONS: list[RefusalReason] = [
    "late",
    "out_of_order",
    "rested",
    "stopped",
    "not_a_number",
    "wrong_size",
    "malformed",
    "not_allowed",
    "unseen",
    "not_neutral",
    "stale_reset",
    "too_soon",
]


async def test_point_10_every_refusal_is_told_counted_and_recorded(tmp_path: Path) -> None:
    """Of the bridge; the console's are in tests/server/peers/test_channels_live.py and its audit trail."""
    async with running_bridge(event_log=tmp_path / "log") as bridge, operator(bridge, armed=False) as driver:
        told = [(await driver.refused(driver.command())).reason]
        await driver.arm()
        known = driver.feedback
        following = event_after(known.event)
        late = Command(event=following, issue=known.issue + 1000, values=DRIVE)
        told.append((await driver.refused(late)).reason)
        told.append((await driver.refused(Command(event=following + 5, issue=1, values=DRIVE))).reason)
        told.append((await driver.refused(Command(event=following, issue=1, values=[1.0]))).reason)
        told.append((await driver.refused(Command(event=following, issue=1, values=[float("nan")] * 3))).reason)
        driver.link.send(Rest(event=following))
        told.append((await driver.refused(driver.command())).reason)
        told.append((await driver.refused(msgspec.structs.replace(driver.command(), nonce=0))).reason)
        async with raw_link(bridge, "media") as other:
            other.send(Command(event=following, issue=1, values=DRIVE))
            told.append((await other.find(Refusal)).reason)
            other.writer.write(frame(b"\xc1"))
            told.append((await other.find(Refusal)).reason)
        driver.link.send(Stop(reason="test"))
        await driver.heard(lambda feedback: feedback.stop.stopped)
        told.append((await driver.refused(driver.command())).reason)
        told.append((await driver.refused(Reset(number=driver.feedback.stop.number - 1))).reason)
        told.append((await driver.refused(Reset(number=driver.feedback.stop.number))).reason)
        assert sorted(told) == sorted(BRIDGE_REASONS)
        assert dict(bridge.counters.refusals) == dict.fromkeys(BRIDGE_REASONS, 1)
    assert sorted(str(line["reason"]) for line in log_lines(tmp_path / "log", "refused")) == sorted(BRIDGE_REASONS)


def test_point_11_a_deadman_held_unchanged_for_a_minute_counts_as_taped_down() -> None:
    """The page knows what is held, so the rule is the page's; its test is named here so that it cannot get lost."""
    text = (Path(__file__).parents[2] / "web/test/drive/arming.test.ts").read_text()
    assert 'it("held a minute with nothing else changing counts as taped down"' in text


async def test_point_12_who_drove_stopped_and_reset_is_in_the_audit_trail() -> None:
    async with running_rig() as rig, rig.peer("operator") as driver, rig.peer("observer") as other:
        driver.send("session", SeatRequest())
        other.send("stop", Stop(reason="a person in the way"))
        await driver.until(lambda each: isinstance(each, StopStateNotice) and each.stop.stopped)
        answer = await rig.http.get("/api/audit", headers=rig.token("supervisor"))
        assert answer.status_code == httpx.codes.OK
        records = json.loads(answer.text)["records"]
        kinds = {record["kind"] for record in records}
        assert {"joined", "seat", "stop"} <= kinds


def test_what_is_answered_in_time_executes_and_what_is_late_does_not() -> None:
    assert isinstance(core_at(7).command(command(8), 100.0 + MAX_AGE), Executed)
    assert isinstance(core_at(7).command(command(8), 100.0 + MAX_AGE + 0.001), Refused)


async def test_a_stopped_robot_stays_stopped_when_its_operator_comes_back() -> None:
    async with running_bridge() as bridge:
        async with operator(bridge) as driver:
            driver.link.send(Stop(reason="test"))
            await driver.heard(lambda feedback: feedback.stop.stopped)
        async with operator(bridge) as again:
            assert again.feedback.stop.stopped
            assert (await again.refused(again.command())).reason == "stopped"
