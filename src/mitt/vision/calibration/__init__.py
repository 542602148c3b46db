"""Calibration: each module builds one least-squares problem, which ``fit`` solves."""
