"""Encoding of pictures and sound beside the robot, as its clients ask for it. Needs PyAV only while switched on."""
