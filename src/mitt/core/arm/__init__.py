"""The arm: its description, import, kinematics, dynamics, limits, shapes and hands."""
