"""A robot's Python that cannot dial, as that of a ROS installation."""

import subprocess
import sys

WITHOUT = """
import sys
sys.modules["websockets"] = None
sys.modules["av"] = None
from lockstep.robot_bridge.cli import main
main()
"""


def _run(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", WITHOUT, *arguments], capture_output=True, text=True, timeout=60, check=False
    )


def test_a_bridge_that_does_not_dial_needs_no_websockets() -> None:
    assert _run("--help").returncode == 0


def test_one_that_is_to_dial_without_them_says_what_to_install() -> None:
    done = _run("planar", "--console", "wss://console.example.org")
    assert done.returncode == 2
    assert "install it for this interpreter" in done.stderr
    assert "Traceback" not in done.stderr
