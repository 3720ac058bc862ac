import os
import subprocess
import sys

import pytest

PROGRAM = """
from lockstep.robot_bridge.errors import RobotUnavailable
from lockstep.robot_bridge.robots.registry import create_robot
try:
    create_robot("mobile-manipulator")
except RobotUnavailable as error:
    print("UNAVAILABLE", error)
"""

NO_MUJOCO = """
import sys
sys.modules["mujoco"] = None
"""

NO_EGL = """
import ctypes.util
import ctypes
real = ctypes.CDLL.__init__
def missing(self, name, *args, **kwargs):
    if name and "EGL" in str(name):
        raise OSError(f"{name}: cannot open shared object file")
    real(self, name, *args, **kwargs)
ctypes.CDLL.__init__ = missing
ctypes.util.find_library = lambda name: None
"""


def run(program: str, **environment: str) -> str:
    result = subprocess.run(
        [sys.executable, "-c", program], env={**os.environ, **environment}, capture_output=True, text=True, timeout=50
    )
    assert result.returncode == 0, result.stderr
    return result.stdout


@pytest.mark.parametrize(
    ("program", "environment"),
    [
        pytest.param(PROGRAM, {"MUJOCO_GL": "nonsense"}, id="a backend that does not exist"),
        pytest.param(NO_EGL + PROGRAM, {"MUJOCO_GL": "egl"}, id="libEGL is not installed"),
        pytest.param(PROGRAM, {"MUJOCO_GL": "egl", "MUJOCO_EGL_DEVICE_ID": "99"}, id="no such device"),
        pytest.param(PROGRAM, {"MUJOCO_GL": "disable"}, id="rendering is disabled"),
    ],
)
def test_without_opengl_it_says_what_to_install_and_what_runs_anyway(program: str, environment: dict[str, str]) -> None:
    output = run(program, **environment)
    assert output.startswith("UNAVAILABLE robot_unavailable")
    assert "libegl1" in output
    assert "libgl1-mesa-dri" in output
    assert "--robot planar" in output


def test_egl_is_chosen_unless_the_environment_chooses() -> None:
    program = "import os, lockstep.robot_bridge.robots.mobile_manipulator; print(os.environ['MUJOCO_GL'])"
    assert run(f"import os; os.environ.pop('MUJOCO_GL', None); {program}").strip() == "egl"
    assert run(program, MUJOCO_GL="osmesa").strip() == "osmesa"


def test_without_mujoco_the_package_is_named_and_not_opengl() -> None:
    said = run(NO_MUJOCO + PROGRAM)
    assert "this robot needs mujoco, which is not installed" in said
    assert "lockstep-bridge[sim]" in said
    assert "libegl1" not in said
