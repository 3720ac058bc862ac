"""`python -m robot_bridge` is `lockstep robot`."""

from lockstep.robot_bridge.cli import main

main()
