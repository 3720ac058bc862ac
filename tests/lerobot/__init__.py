"""The real LeRobot, in an environment of its own (.lerobot, 8.4 GB), against the real bridge and console.

`make test-long` installs it and runs these tests. The arm is in `parts/`, behind LeRobot's own base classes.
"""
