"""Calibration of a rig, and seeing with it."""
