"""A network in a box: impairs what passes between a client, the console and the robot. docs/networks.md tells how."""
