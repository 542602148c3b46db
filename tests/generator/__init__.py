"""Tests of the map; a package, because `world` has a test_flights.py too."""
