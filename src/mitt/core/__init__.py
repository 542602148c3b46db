"""What runs on the robot: NumPy, Numba and the standard library alone."""
