"""The law of a stop, over random arms and plants unlike them: see the sentences of the tests.

The plant is Pinocchio's forward dynamics of an arm whose masses are off, with friction that the
controller does not know; the controller is the envelope, the tracker and the encoders' monitor.
``MITT_LAW`` sets how many arms are drawn, 3 by default.
"""

import os
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from stages import Tracker
from support import thorough

from mitt.core.arm.arm import Arm
from mitt.core.arm.description import ArmModel, Link, rotation, transform
from mitt.core.arm.limits import joint_level
from mitt.core.control.encoders import (
    BRIDGED,
    Encoders,
    Reading,
    estimate_joints,
    monitor_of,
    predict_acceleration,
)
from mitt.core.control.stop import HARDEST, choose_stop, mass_work, stop_by
from mitt.core.signals import TICK, ArmState, Array
from mitt.lab.bench.libraries import to_pinocchio

ARMS = int(os.environ.get("MITT_LAW", "3"))
#: Ticks before a fault, to be found in, and to come to rest in; the delay of the brakes [s].
BEFORE = 250
WITHIN = 100
AFTER = 500
DELAY = 0.05
#: Steps of the plant in a tick, and sweeps of its friction.
PARTS = 4
SWEEPS = 60
#: Change of a speed in a sweep that ends it [rad/s].
CONVERGED = 1e-12
#: Mass and friction of a plant beyond what is known, shares of mass and of the largest torque.
MASS = 0.2
FRICTION = 0.05


def random_arm(rng: np.random.Generator) -> Arm:
    """Draw an arm of 2 to 7 hinges that half its torque holds in any pose.

    Each joint alone can stop from its largest speed in 0.2 s.
    """
    n = int(rng.integers(2, 8))
    links = []
    for k in range(n):
        size = float(rng.uniform(0.1, 0.4))
        mass, axis = float(rng.uniform(0.5, 3.0)), np.eye(3)[int(rng.integers(0, 3))]
        placement = transform(
            rotation(np.eye(3)[k % 3], float(rng.uniform(-1.0, 1.0))),
            np.array([0.0, 0.0, size if k else 0.3]),
        )
        links.append(
            Link(
                name=f"r{k}",
                placement=placement,
                axis=axis,
                q_min=-2.0,
                q_max=2.0,
                mass=mass,
                com=np.array([0.0, 0.0, 0.5 * size]),
                inertia=mass * size**2 / 6.0 * np.eye(3),
                armature=0.05,
            )
        )
    model = ArmModel(
        name="random",
        links=tuple(links),
        tool=transform(p=np.array([0.0, 0.0, 0.2])),
        hand=None,
        q_ready=np.zeros(n),
        base_capsules=(),
        mount=np.eye(4),
    )
    free = Arm(model, joint_level("free", tau=np.full(n, 1e3), speed=np.full(n, 10.0)))
    poses, still = rng.uniform(-2.0, 2.0, (100, n)), np.zeros(n)
    weight = np.max([np.abs(free.inverse_dynamics(q, still, still)) for q in poses], axis=0)
    speed = rng.uniform(1.0, 4.0, n)
    inertia = np.max([np.diag(free.mass_matrix(q)) for q in poses], axis=0)
    tau = np.maximum(2.0 * weight, inertia * speed / 0.2) * rng.uniform(1.0, 2.0, n)
    return Arm(model, joint_level("random", tau=tau, speed=speed))


class Cell:
    """An arm unlike its model, with its controller."""

    def __init__(self, arm: Arm, rng: np.random.Generator) -> None:
        """Draw the plant."""
        self.arm, n = arm, arm.n
        off = rng.uniform(1.0 - MASS, 1.0 + MASS, n)
        links = [
            replace(x, mass=m * x.mass, inertia=m * x.inertia)
            for x, m in zip(arm.model.links, off, strict=True)
        ]
        self.plant = to_pinocchio(replace(arm.model, links=tuple(links)))
        self.data = self.plant.createData()
        self.friction = FRICTION * arm.tau_max * rng.uniform(0.0, 1.0, n)
        self.q, self.dq, self.step = arm.q_ready.copy(), np.zeros(n), arm.encoder_step
        self.tracker, self.tau = Tracker(arm, bandwidth=40.0), np.zeros(n)
        self.monitor, self.estimated = monitor_of(arm, Encoders()), np.zeros((2, n))
        self.monitor.coupling[:] = np.eye(n)
        self.monitor.joints["ddq_unknown"] = self.monitor.joints["ddq_own"] = 1.0
        self.monitor.bounds[:] = self.tracker.safety_filter.bounds
        self.work = mass_work(arm)
        self.since, self.rubbed = -1, np.zeros(n)

    def energy(self) -> float:
        """Return the true kinetic energy [J]."""
        M = pin.crba(self.plant, self.data, self.q)
        M = np.triu(M) + np.triu(M, 1).T
        return float(0.5 * self.dq @ M @ self.dq)

    def tick(self, wish: Array, read: Array) -> int:
        """Make a tick; return what the monitor says."""
        tracker, arm = self.tracker, self.arm
        safety, last = tracker.safety_filter.safety, tracker.safety_filter.last
        held = self.since * TICK >= DELAY
        read = np.array([read, 0.0 * read])
        when = Reading(TICK, TICK, 0.0)
        code = int(estimate_joints(self.monitor, read, held, np.zeros(arm.n), when, self.estimated))
        if code > BRIDGED or self.since >= 0:
            self.since += 1
            wish = last.copy()
            choose_stop(arm.tables, safety.loaded, safety.bounds, last, HARDEST, safety.stop)
            stop_by(safety.bounds, last, safety.stop.rates, wish)
        state = ArmState(t=0.0, q=self.estimated[0], dq=self.estimated[1])
        self.tau = tracker.step(state, wish, hand=0.0).command.tau.copy()
        predict_acceleration(self.monitor, arm.tables, self.estimated, self.tau, self.work)
        if held:
            self.tau[:] = self.monitor.ddq_by_tau[:] = 0.0
        self._move(self.tau, held)
        return code

    def _move(self, tau: Array, held: bool) -> None:
        """Move the plant on by a tick in parts; brakes as strong as the joints' torques.

        Friction and brakes are impulses of bounded size that bring the joints to rest where they
        can, all together: Gauss-Seidel, from those of the step before.
        """
        h, rub = TICK / PARTS, self.friction + (self.arm.tau_max if held else 0.0)
        for _ in range(PARTS):
            free = self.dq + h * pin.aba(self.plant, self.data, self.q, self.dq, tau)
            inverse = pin.computeMinverse(self.plant, self.data, self.q)
            inverse = np.triu(inverse) + np.triu(inverse, 1).T
            p = self.rubbed
            v = free + inverse @ p
            for _ in range(SWEEPS):
                before = v
                for k in range(len(p)):
                    kept = p[k]
                    p[k] = min(max(kept - v[k] / inverse[k, k], -h * rub[k]), h * rub[k])
                    v = v + (p[k] - kept) * inverse[k]
                if np.max(np.abs(v - before)) < CONVERGED:
                    break
            self.dq = v
            self.q = self.q + h * v


def wish_at(arm: Arm, swing: Array, k: int) -> Array:
    """Return a smooth motion from rest, well within the limits, shape (3, n)."""
    t, w = TICK * k, 5.0
    size = swing * np.minimum(0.5 * arm.dq_max / w, 0.4)
    return np.array(
        [size * (1.0 - np.cos(w * t)), size * w * np.sin(w * t), size * w * w * np.cos(w * t)]
    )


def reading(kind: str, q: Array, joint: int, kept: Array, step: Array) -> Array:
    """Return what the encoders read."""
    read = np.rint(q / step) * step
    wrong = {
        "silent": np.nan,
        "stuck": kept[joint],
        "jumped": read[joint] + 0.3,
        "reversed": -read[joint],
    }
    read[joint] = wrong.get(kind, read[joint])
    return read


@pytest.mark.parametrize("seed", range(ARMS))
def test_without_a_fault_no_alarm(seed: int) -> None:
    """Whatever the arm, masses 20 % off and friction that nobody knows: no encoder is doubted."""
    rng = np.random.default_rng(seed)
    arm = random_arm(rng)
    cell, swing = Cell(arm, rng), rng.uniform(-1.0, 1.0, arm.n)
    for k in range(2 * BEFORE):
        read = reading("none", cell.q, 0, cell.q, cell.step)
        assert cell.tick(wish_at(arm, swing, k), read) <= BRIDGED


@pytest.mark.parametrize("kind", ["silent", "stuck", "jumped", "reversed"])
@pytest.mark.parametrize("seed", thorough([0], range(1, ARMS)))
def test_after_an_alarm_the_arm_only_comes_to_rest(seed: int, kind: str) -> None:
    """Kinetic energy never exceeds that at the alarm and what gravity can add in the brakes' delay.

    That is, per joint, the weight at most times the way that its largest speed since the alarm
    makes in the delay. From the delay on it only shrinks, and the arm is at rest at the end.
    """
    rng = np.random.default_rng(seed)
    arm = random_arm(rng)
    cell, swing, joint = Cell(arm, rng), rng.uniform(-1.0, 1.0, arm.n), int(rng.integers(arm.n))
    kept, energies, speeds, weights = cell.q, list[float](), list[Array](), list[Array]()
    still, fastest = np.zeros(arm.n), 0.0
    for k in range(BEFORE + WITHIN + AFTER):
        kept = cell.q.copy() if k < BEFORE else kept
        kind_now = kind if k >= BEFORE else "none"
        cell.tick(wish_at(arm, swing, k), reading(kind_now, cell.q, joint, kept, cell.step))
        fastest = max(fastest, float(np.max(np.abs(cell.dq) / arm.dq_max)))
        if cell.since >= 0:
            energies.append(cell.energy())
            speeds.append(np.abs(cell.dq))
            weights.append(np.abs(pin.rnea(cell.plant, cell.data, cell.q, still, still)))
    if kind in ("silent", "jumped"):
        assert energies
    if not energies:  # nothing that could be seen, and no harm
        assert fastest <= 1.0
        return
    delay = round(DELAY / TICK) + 1
    added = float(np.max(weights, axis=0) @ np.max(speeds, axis=0)) * DELAY
    assert max(energies) <= energies[0] + added + 1e-9
    later = np.array(energies[delay + 1 :])
    assert np.all(np.diff(later) <= 1e-6)
    assert np.max(speeds[-1]) < 1e-3
