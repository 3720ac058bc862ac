"""What a shadow wants, from its verdict to the scene."""

import asyncio
import math

import msgspec

from lockstep.protocol.console import ShadowVerdict
from lockstep.protocol.description import Body, BodyJoint, Geom, Joint, Pose, RobotDescription
from lockstep.protocol.messages import Feedback
from lockstep.server.audit.records import Actor
from lockstep.server.auth.tokens import SceneTicket
from lockstep.server.scene.view import SceneView
from lockstep.server.session_events import EpochBegan, FeedbackReceived, SessionEvents, ShadowJudged
from lockstep.server.telemetry.metrics import Metrics
from tests.makers import goal_axis
from tests.server.rig import eventually

ARM = RobotDescription(
    name="arm",
    label="Arm",
    axes=(goal_axis("turn", most=3.0, reach=1.0),),
    joints=(Joint(name="turn", unit="rad"),),
    bodies=(
        Body(
            name="arm",
            parent="",
            joints=(BodyJoint(joint="turn", kind="revolute", axis=(0.0, 0.0, 1.0)),),
            geoms=(Geom(shape="box", size=(1.0, 0.1, 0.1)),),
        ),
    ),
)


async def test_a_shadow_that_is_judged_is_drawn_by_its_name_until_it_is_old() -> None:
    metrics = Metrics()
    scene, events = SceneView(60.0, 1, metrics), SessionEvents(metrics.faults)
    scene.subscribe(events)
    running = asyncio.create_task(scene.run())

    def feed(event: int) -> None:
        feedback = Feedback(event=event, issue=event, time=event / 10, axes=[0.0], joints=[0.0], goals=[0.0])
        events.publish(FeedbackReceived(feedback, 0.0, None))

    def names() -> list[str]:
        drawn = [] if scene.renderer.model is None else scene.renderer.model.shadows.drawn
        return [each.arm.label.text for each in drawn if each.root.visible]

    try:
        await scene.open()
        events.publish(EpochBegan(ARM))
        with scene.viewer(SceneTicket("link", "operator", math.inf)):
            verdict = ShadowVerdict(peer="p", name="act 3", event=1, values=[0.8], judgement="in_time")

            def drawn() -> bool:  # a policy repeats itself; on a busy machine one verdict may be old before it is drawn
                feed(1)
                events.publish(ShadowJudged(Actor(), verdict))
                feed(2)
                return names() == ["act 3 (shadow)"]

            await eventually(drawn)
            feed(200)
            await eventually(lambda: names() == [])
    finally:
        running.cancel()
        await asyncio.wait([running])
        await scene.close()


async def test_a_turn_that_no_sine_takes_leaves_out_that_policy_alone() -> None:
    metrics = Metrics()
    scene, events = SceneView(60.0, 1, metrics), SessionEvents(metrics.faults)
    scene.subscribe(events)
    running = asyncio.create_task(scene.run())
    turns = ("rx", "ry", "rz")
    axes = (*ARM.axes, *(goal_axis(name, most=3.0, reach=1.0, wrap=math.tau) for name in turns))
    tool = Pose(name="tool", label="Tool", body="arm", position=("", "", ""), rotation=turns)
    robot = msgspec.structs.replace(ARM, axes=axes, poses=(tool,))
    bad: list[float | None] = [0.0, 1.7e308, 1.7e308, 1.7e308]
    good: list[float | None] = [0.8, None, None, None]

    def drawn() -> bool:
        for event in (1, 2):
            feedback = Feedback(event=event, issue=1, time=0.1, axes=[0.0] * 4, joints=[0.0], goals=[0.0] * 4)
            events.publish(FeedbackReceived(feedback, 0.0, None))
        for name, values in (("bad", bad), ("good", good)):
            verdict = ShadowVerdict(peer=name, name=name, event=2, values=values, judgement="out_of_limits")
            events.publish(ShadowJudged(Actor(), verdict))
        shadows = [] if scene.renderer.model is None else scene.renderer.model.shadows.drawn
        return [each.arm.label.text for each in shadows if each.root.visible] == ["good (shadow)"]

    try:
        await scene.open()
        events.publish(EpochBegan(robot))
        with scene.viewer(SceneTicket("link", "operator", math.inf)):
            await eventually(drawn)
    finally:
        running.cancel()
        await asyncio.wait([running])
        await scene.close()
