"""A robot at its cell: the live loop, robots, ROS 2, recorder, a session, the simulated cell."""
