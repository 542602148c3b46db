"""Calibration of a rig: boards, heads, the hand, the clock."""
