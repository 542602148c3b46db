"""Recorded positions and videos to tracks of a ball."""
