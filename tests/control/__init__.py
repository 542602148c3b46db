"""Tests of control; a package, because `world` has a test_hand.py too."""
