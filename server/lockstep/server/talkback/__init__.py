"""The loudspeaker at the robot that is attached to the console: plays the voice of who holds the control seat."""
