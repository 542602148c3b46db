"""Faults of the joint encoders."""

from dataclasses import replace
from typing import final

import numpy as np

from mitt.signals import Array, Senses
from mitt.world.faults.plan import Encoder
from mitt.world.faults.stage import Stage


@final
class Lying(Stage):
    """Encoders that lie about one joint or all; speeds follow from what is read."""

    def __init__(self, fault: Encoder, rng: np.random.Generator) -> None:  # noqa: ARG002
        """Take the fault; it draws nothing."""
        self._fault = fault
        self._t, self._read, self._stuck = 0.0, np.empty(0), np.empty(0)

    def told(self, senses: Senses) -> Senses:
        """Return the senses with the wrong readings."""
        fault, arm = self._fault, senses.arm
        if not fault.holds(senses.t):
            self._t, self._read = senses.t, arm.q
            self._stuck = arm.q
            return senses
        chosen = np.zeros(len(arm.q), bool)
        if fault.joint is None:
            chosen[:] = True
        else:
            chosen[fault.joint % len(arm.q)] = True
        q = np.where(chosen, self._reading(arm.q), arm.q)
        dq = np.where(chosen, self._rate(q, senses.t), arm.dq)
        self._t, self._read = senses.t, q
        return replace(senses, arm=replace(arm, q=q, dq=dq))

    def _reading(self, q: Array) -> Array:
        """Return what the encoders read instead of q [rad]."""
        kind, size = self._fault.fault, self._fault.magnitude
        if kind == "stuck":
            return self._stuck if len(self._stuck) else q
        if kind == "jump":
            return np.asarray(q + size)
        if kind == "dropout":
            return np.full_like(q, np.nan)
        return -q if kind == "sign" else np.asarray(size * np.rint(q / size))

    def _rate(self, q: Array, t: float) -> Array:
        """Return the speed that the readings make believe [rad/s]."""
        if len(self._read) != len(q) or t <= self._t:
            return np.zeros_like(q)
        return np.asarray((q - self._read) / (t - self._t))
