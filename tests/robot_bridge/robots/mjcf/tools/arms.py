"""Two arms as MJCF models: six joints with a spherical wrist, and seven with one to spare. Both carry a gripper."""

from typing import Final

__all__ = ["SEVEN_JOINTS", "SIX_JOINTS", "TOOL", "arm_model"]

TOOL: Final = '<custom><text name="lockstep_tool" data="grip"/></custom>'
# Name, axis, range (rad), offset from the link before (m), and a shape in the link's frame.
SIX_JOINTS: Final = (
    ("waist", "0 0 1", "-2.8 2.8", "0 0 0.30", '<geom type="cylinder" size="0.07 0.05"/>'),
    ("shoulder", "0 1 0", "-1.9 1.9", "0 0 0.10", '<geom type="capsule" fromto="0 0 0.10 0 0 0.34" size="0.05"/>'),
    ("elbow", "0 1 0", "-2.4 2.4", "0 0 0.42", '<geom type="capsule" fromto="0.10 0 0 0.24 0 0" size="0.04"/>'),
    ("roll", "1 0 0", "-2.9 2.9", "0.38 0 0", '<geom type="sphere" size="0.04"/>'),
    ("bend", "0 1 0", "-2.0 2.0", "0 0 0", '<geom type="box" size="0.03 0.03 0.03"/>'),
    ("twist", "1 0 0", "-2.9 2.9", "0 0 0", '<geom type="capsule" fromto="0.09 0 0 0.12 0 0" size="0.035"/>'),
)
SEVEN_JOINTS: Final = (
    ("a1", "0 0 1", "-2.9 2.9", "0 0 0.16", '<geom type="cylinder" size="0.07 0.05"/>'),
    ("a2", "0 1 0", "-2.0 2.0", "0 0 0.18", '<geom type="capsule" fromto="0 0 0.06 0 0 0.12" size="0.05"/>'),
    ("a3", "0 0 1", "-2.9 2.9", "0 0 0.20", '<geom type="capsule" fromto="0 0 0 0 0 0.12" size="0.05"/>'),
    ("a4", "0 -1 0", "-2.0 2.0", "0 0 0.20", '<geom type="capsule" fromto="0 0 0.05 0 0 0.12" size="0.045"/>'),
    ("a5", "0 0 1", "-2.9 2.9", "0 0 0.20", '<geom type="capsule" fromto="0 0 0 0 0 0.10" size="0.045"/>'),
    ("a6", "0 1 0", "-2.0 2.0", "0 0 0.20", '<geom type="sphere" size="0.045"/>'),
    ("a7", "0 0 1", "-3.0 3.0", "0 0 0.08", '<geom type="cylinder" size="0.03 0.02"/>'),
)
HANDS: Final = {6: ("0.16 0 0", "0 1 0"), 7: ("0 0 0.10", "0 1 0")}  # place of the grip, and of a finger's axis
HOMES: Final = {6: "0 -0.4 0.9 0 0.7 0", 7: "0 0.5 0 1.2 0 0.9 0"}


def arm_model(links: tuple[tuple[str, str, str, str, str], ...] = SIX_JOINTS, more: str = TOOL, base: str = "") -> str:
    """Return the model of an arm in its home posture. `base`: joints of the body that it stands on."""
    grip, axis = HANDS[len(links)]
    servos = "".join(f'<position name="{name}" joint="{name}" inheritrange="1"/>' for name, *_ in links)
    opened = "".join(
        f'<body name="{name}" pos="{place}" gravcomp="1"><joint name="{name}" axis="{turn}" range="{ends}" '
        f'damping="5" armature="0.1"/>{shape}'
        for name, turn, ends, place, shape in links
    )
    finger = (
        f'<body name="finger" pos="{grip}" gravcomp="1"><joint name="finger" type="slide" axis="{axis}" '
        'range="0 0.04" damping="5"/><geom type="box" size="0.01 0.004 0.01" mass="0.02"/></body>'
    )
    rest = " ".join("0" for _ in range(base.count("<joint")))
    return f"""<mujoco model="bench arm"><compiler angle="radian" autolimits="true"/>
<option timestep="0.002" integrator="implicitfast"/>
<default><position kp="4000" kv="200"/><geom mass="0.5"/></default>
<worldbody><geom name="floor" type="plane" size="2 2 0.1"/><camera name="overview" pos="1.6 -1.2 1.2"
xyaxes="0.6 0.8 0 -0.35 0.26 0.9"/>
<body name="base" pos="0.1 0.2 0">{base}<geom type="cylinder" size="0.09 0.1" pos="0 0 0.101"/>
{opened}<site name="grip" pos="{grip}" euler="0 1.5 0"/>{finger}{"</body>" * len(links)}</body></worldbody>
<actuator>{servos}<position name="gripper" joint="finger" kp="400" kv="20" inheritrange="1"/></actuator>{more}
<keyframe><key name="home" qpos="{rest} {HOMES[len(links)]} 0.02"/></keyframe></mujoco>"""
