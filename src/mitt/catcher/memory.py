"""What a catcher knows and what it has brought about, with views of what Python reads each tick."""

from typing import Any, final

import numpy as np

from mitt.catcher.result import Result, ResultHandle, fresh_result, result_handle
from mitt.catcher.state import CatcherState, StateHandle, begun_with, state_handle
from mitt.control.rows import DQ
from mitt.errors import ShapeError
from mitt.robot.arm import Arm
from mitt.signals import ArmState, Array, Command
from mitt.vision.eyes import Eyes

#: Speeds below which a joint counts as at rest, commanded and estimated [rad/s].
_AT_REST, _STILL = 1e-3, 0.05


@final
class Memory:
    """State and result of a catcher; one object a throw.

    Attributes:
        state: What the catcher knows and remembers, overwritten by the next tick.
        result: What the last tick brought about, overwritten by the next.
        scalars, out: Single numbers of both.
        q, dq: What the encoders read last [rad, rad/s], shape (n,).
        handles: State and result as kernels take them.
    """

    def __init__(self, blank: CatcherState, eyes: Eyes) -> None:
        """Begin as ``blank`` says, which is copied, with the arrays of the eyes."""
        self.state, self.result = _begun(blank, eyes)
        self._show()

    def __getstate__(self) -> dict[str, Any]:
        """Return state and result, without what only shows parts of them."""
        return {"state": self.state, "result": self.result}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Take what :meth:`__getstate__` returned, and show its parts again."""
        self.__dict__.update(state)
        self._show()

    def _show(self) -> None:
        """Keep views of what is often read."""
        self.q, self.dq = np.zeros((2, self.state.estimated.shape[1]))
        self.scalars, self.out = self.state.scalars[0], self.result.scalars[0]
        out = self.result.scalars
        self._clock, self._hand, self._brakes = out["t"], out["hand"], out["brakes"]
        self._joints = self.result.command[:4]
        self.handles: tuple[StateHandle, ResultHandle] = (
            state_handle(self.state), result_handle(self.result)
        )  # fmt: skip

    @property
    def t(self) -> float:
        """Time of the last tick [s]."""
        t: float = self._clock.item()
        return t

    @property
    def at_rest(self) -> bool:
        """Whether the last command leaves every joint at rest."""
        return bool(np.all(np.abs(self.result.command[DQ]) < _AT_REST))

    @property
    def held(self) -> bool:
        """Whether the arm rests, and its torques hold it, or its brakes by now."""
        still = np.all(np.abs(self.state.estimated[1]) < _STILL)
        braked = self.scalars["braked"] or not self.out["brakes"]
        return bool(self.at_rest and still and braked)

    def read(self, arm: Arm, given: ArmState) -> None:
        """Take the encoders over: compiled code sees buffers of one type and the right length.

        Raises:
            ShapeError: They are not those of this arm.
        """
        q, dq, n = given.q, given.dq, arm.n
        if q.shape != (n,) or dq.shape != (n,):
            raise ShapeError("senses.arm.q, .dq", f"({n},)", q.shape if len(q) != n else dq.shape,
                             do=f"give the active joints {', '.join(arm.names)}")  # fmt: skip
        self.q[:], self.dq[:] = q, dq

    def command(self, gaze: Array | None) -> Command:
        """Return the command of the last tick, with where the heads are to look."""
        return Command(self.t, self._joints.copy(), self._hand.item(), gaze, self._brakes.item())

    def restart(self, blank: CatcherState, eyes: Eyes) -> None:
        """Overwrite both by a beginning, from where the encoders say the arm is and what holds it.

        The hand opens: a ball drops.
        """
        state, result = _begun(blank, eyes)
        state.estimated[:] = self.state.estimated
        state.slew[1] = self.state.slew[1]
        state.scalars["braked"] = self.scalars["braked"]
        for old, new in ((self.state, state), (self.result, result)):
            for mine, value in zip(old, new, strict=True):
                mine[...] = value


def _begun(blank: CatcherState, eyes: Eyes) -> tuple[CatcherState, Result]:
    """Return a copy of a state, and a result before any tick."""
    n = blank.estimated.shape[1]
    return begun_with(blank, eyes), fresh_result(n, max(eyes.heads, 1))
