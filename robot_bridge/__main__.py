"""`python -m robot_bridge` is `lockstep robot`."""

from robot_bridge.cli import main

main()
