"""Small models for the tests, written here so that each test shows what it is about."""

from pathlib import Path

__all__ = ["ARM", "EXAMPLE", "model_file", "one_joint"]

EXAMPLE = Path(__file__).parents[4] / "docs" / "examples" / "mjcf" / "desk_arm.xml"


def one_joint(actuator: str, joint: str = 'type="hinge" axis="0 1 0" range="-1 1"', more: str = "") -> str:
    """A bar that hangs on one joint and would fall, and the actuator on it."""
    return f"""<mujoco><compiler angle="radian" autolimits="true"/><option timestep="0.002" integrator="implicitfast"/>
<worldbody><body name="bar" pos="0 0 1"><joint name="j" {joint}/><geom type="box" size="0.2 0.02 0.02" pos="0.2 0 0"
mass="0.5"/><site name="tip" pos="0.4 0 0"/></body></worldbody><actuator>{actuator}</actuator>{more}</mujoco>"""


ARM = one_joint('<position name="servo" joint="j" kp="200" kv="20"/>')


def model_file(directory: Path, text: str, name: str = "model.xml") -> Path:
    path = directory / name
    path.write_text(text)
    return path
