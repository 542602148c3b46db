"""Tests of a rig."""
