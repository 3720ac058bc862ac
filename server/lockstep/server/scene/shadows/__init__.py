"""What shadow policies want, in the 3D scene."""
