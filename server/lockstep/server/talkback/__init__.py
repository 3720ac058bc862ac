"""The loudspeaker at the robot, attached to the console: plays the voice of the holder of the control seat."""
