"""Arms as a user names them: by name, from a description file, or from an arm file."""

import logging
from collections.abc import Mapping, Sequence
from pathlib import Path

from mitt.errors import InputError
from mitt.files.arm_file import is_arm_file, limits_of, read_arm_file
from mitt.robot.arm import Arm
from mitt.robot.description import Hand
from mitt.robot.limit_sets import LimitSet
from mitt.robot.load import Mount, with_encoders
from mitt.robot.load import load_arm as load


def load_arm(
    name_or_path: str | Path = "wam",
    *,
    tip: str | None = None,
    joints: Sequence[str] | None = None,
    held: Mapping[str, float] | None = None,
    ready: Sequence[float] | None = None,
    limits: str | Path | LimitSet | None = None,
    hand: Hand | str | None = None,
    hand_turn: float = 0.0,
    hand_mount: Mount = "catch",
    encoder_step: float | Sequence[float] | None = None,
) -> Arm:
    """Return an arm by name, from a URDF or MJCF file, or from an arm file (``.toml``).

    What a user should know of how a file was read, ``arm.model.notes``, is logged as warnings of
    the logger ``mitt``.

    Args:
        name_or_path: Name or file. An arm file says all the rest but the limits and the encoders.
        tip: Frame of the file whose origin is the catch point and whose z axis is the normal
            of the palm; only for files.
        joints: Active joints of the file, the others held; of the WAM j1, j2 and j4 if left out.
        held: Angles at which joints are held [rad]; any other is held at 0, or at the end of its
            range that is nearest to it.
        ready: Ready pose of the active joints, in their order [rad]; 0 if left out, or the middle
            of a range that 0 is not in.
        limits: Limit set: a name of ``mitt.files.limit_files.shipped()``, ``paper``, ``wam-48v`` or
            ``wam-80v`` for the WAM, ``model`` for what a file states, or a TOML file
            (docs/arms.md).
        hand: A hand, or the name of one of ``mitt.robot.basket.HANDS``; with ``none`` nothing is
            mounted, and the tip is the catch point. If left out, the WAM has the three-finger hand,
            and a file is taken to contain what the arm carries, as with ``none``.
        hand_turn: How far the hand is turned about the z axis of the tip [rad].
        hand_mount: For files: whether the hand's catch point or its plate is at the tip.
        encoder_step: Resolution of the encoders of the active joints [rad], one for all or one a
            joint; the WAM's own, or ``description.ENCODER_STEP`` for files, if left out.

    Raises:
        UnknownNameError: No such arm, joint, frame, hand or limit set.
        FileError: The file cannot be read or parsed.
        ModelError: What it describes is no arm that can be used.
    """
    if isinstance(name_or_path, str | Path) and is_arm_file(name_or_path):
        said = {"tip": tip, "joints": joints, "held": held, "ready": ready, "hand": hand}
        for name, value in said.items():
            if value is not None:
                raise InputError(name, "nothing beside an arm file, which says it", "a value",
                                 do="change the arm file")  # fmt: skip
        arm = read_arm_file(Path(name_or_path)).load(limits=limits_of(limits))
        arm = arm if encoder_step is None else with_encoders(arm, encoder_step)
    else:
        arm = load(
            name_or_path, tip=tip, joints=joints, held=held, ready=ready, limits=limits_of(limits),
            hand=hand, hand_turn=hand_turn, hand_mount=hand_mount, encoder_step=encoder_step,
        )  # fmt: skip
    for note in arm.model.notes:
        logging.getLogger("mitt").warning("%s: %s", name_or_path, note)
    return arm
