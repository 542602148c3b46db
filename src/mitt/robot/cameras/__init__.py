"""Where frames come from, calibration, and videos or recorded positions made into tracks."""
