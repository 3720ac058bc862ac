"""The 3D scene, made from the robot's feedback."""
