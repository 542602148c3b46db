"""Values that are written slot by slot are those of the constructors."""

import numpy as np

from mitt.signals import ArmState, Command, Frame, Senses, command_of, frame_of, senses_of

Q, DQ = np.array([0.1, 0.2]), np.array([1.0, 2.0])


def test_a_frame_made_the_fast_way_is_the_same_frame() -> None:
    """Field by field, with and without the angles of a head."""
    pixels = np.zeros((8, 8), np.uint8)
    still = Frame(t=0.1, camera=1, number=7, pixels=pixels)
    assert repr(frame_of(0.1, 1, 7, pixels)) == repr(still)
    turned = Frame(t=0.1, camera=1, number=7, pixels=pixels, pan=0.2, tilt=-0.3)
    assert repr(frame_of(0.1, 1, 7, pixels, (0.2, -0.3))) == repr(turned)


def test_senses_and_commands_made_the_fast_way_are_the_same() -> None:
    """Field by field; the encoders are read at the time of the senses."""
    wanted = Senses(t=0.1, arm=ArmState(t=0.1, q=Q, dq=DQ))
    assert repr(senses_of(0.1, Q, DQ, (), ())) == repr(wanted)
    told = np.arange(8.0).reshape(4, 2)
    command = Command(t=0.1, joints=told, hand=0.5)
    assert repr(command_of(0.1, told, 0.5, None)) == repr(command)
