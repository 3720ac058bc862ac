"""Inverse kinematics: joint goals that bring a tool to a pose. No I/O, no clock, nothing but numpy.

`Chain` knows where a tool is and how the joints move it, read from the bodies of a robot's description, so it serves
simulated robots, URDF and MJCF alike. `PoseSolver` takes one step towards a pose in each tick. `Clearance` keeps parts
of the robot apart.
"""
