"""Rival ``quintic``: predict the catch and replan a quintic to it when the prediction moves.

The classic of robotic catching (Hong and Slotine 1995, Frese and others 2001): position, velocity
and acceleration are met at the predicted catch by a polynomial of degree five in each joint.
"""

from mitt.generator.generators import Generator
from mitt.generator.mapping import DirectMap
from mitt.rivals.planned import Planned, PlannedSettings, plan_quintic
from mitt.rivals.pursuit import rival


def make_quintic(f: DirectMap) -> Generator:
    """Return the rival for the arm of a map."""
    return rival(f, Planned(planner=plan_quintic, settings=PlannedSettings()))
