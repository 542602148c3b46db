"""How good is the ball filter: recorded flights, bounces, true covariance, outliers and faults.

    python benchmarks/track.py                 measure and print all tables
    python benchmarks/track.py --throws 400    fewer simulated throws

Simulated balls are thrown at 5 to 6.5 m/s for 0.5 s, drag 0.04 +- 0.005 per metre, 1 kHz unless
said otherwise. Seeds are 8000 and above; the filter was tuned on seeds below 1000.
"""

import argparse
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from mitt.core.ball.filter import BallFilter, FilterConfig
from mitt.core.signals import Array, Sighting
from mitt.lab.trials.catcher_settings import filter_settings
from mitt.lab.world.flights import RecordedFlight, builtin_flights
from mitt.lab.world.throws import fly
from mitt.robot.cameras.filtering import UNKNOWN_BALL, filter_flight

SEED = 8000
H = 1e-3
AHEAD = 0.1
#: Effect of each fault on the error at contact [mm rms], section C of the fault table.
TABLE_C = {
    "no fault": 1.1,
    "last 5 ms missing": 1.2,
    "last 20 ms missing": 1.5,
    "last 50 ms missing": 2.5,
    "last 100 ms missing": 4.7,
    "half lost": 1.4,
    "nine of ten lost": 2.9,
    "10 % swapped": 1.1,
    "10 % doubled": 1.4,
    "1 % outliers": 1.06,
    "10 % outliers": 1.14,
    "second ball, last 50 ms": 1.05,
    "late by 20 ms, stamped": 1.1,
    "frozen, last 100 ms": 4.7,
}

Seen = list[tuple[float, Array]]
Fault = Callable[[Seen, np.random.Generator], Seen]


def bounce_of(flight: RecordedFlight) -> float:
    """Return when the vertical velocity jumps by more than 2 m/s; infinite if it does not."""
    t, z = flight.t, flight.r[:, 2]
    jump = (z[8:] - z[4:-4]) / (t[8:] - t[4:-4]) - (z[4:-4] - z[:-8]) / (t[4:-4] - t[:-8])
    return float(t[4 + np.argmax(jump)]) if jump.max() > 2.0 else np.inf


def ahead_errors(config: FilterConfig) -> tuple[Array, Array]:
    """Return the errors 100 ms ahead on the recorded flights [mm]: before, and after a bounce.

    Before: rows from 0.12 s on whose target comes before a bounce. After: the first row 30 ms
    after a bounce.
    """
    before: list[float] = []
    after: list[float] = []
    for flight in builtin_flights():
        t, bounce = flight.t, bounce_of(flight)
        track = filter_flight(t, flight.r, ahead=AHEAD, config=config)
        true = np.stack([np.interp(t + AHEAD, t, flight.r[:, k]) for k in range(3)], axis=1)
        error, there = 1e3 * np.linalg.norm(track.ahead - true, axis=1), t + AHEAD <= t[-1]
        before.extend(error[there & (t >= 0.12) & (t + AHEAD + 0.006 < bounce)])
        after.extend(error[there & (t >= bounce + 0.03)][:1])
    return np.array(before), np.array(after)


def recorded() -> None:
    """Print the errors on the recorded flights, beside simpler filters."""
    gravity = replace(
        UNKNOWN_BALL,
        drag_mean=0.0,
        drag_sigma=0.0,
        drag_density=0.0,
        push_sigma=0.0,
        other_motion=0.0,
        watchful=False,
    )
    drag = replace(UNKNOWN_BALL, push_sigma=0.0, other_motion=0.0, watchful=False)
    flight = replace(UNKNOWN_BALL, other_motion=0.0, watchful=False)
    print(
        "recorded flights, 100 ms ahead [mm]: median, rms; first row 30 ms after a bounce: median"
    )
    noisy = replace(gravity, accel_density=0.03)
    rows = (
        ("gravity only", gravity),
        ("gravity, more noise", noisy),
        ("drag", drag),
        ("drag and push", flight),
        ("as mitt track", UNKNOWN_BALL),
    )
    for name, config in rows:
        before, after = ahead_errors(config)
        print(
            f"  {name:22s}{np.median(before):7.2f}{np.sqrt(np.mean(before**2)):7.2f}"
            f"{np.median(after):7.2f}   ({len(before)} rows, {len(after)} bounces)"
        )


def thrown(rng: np.random.Generator) -> tuple[Array, Array]:
    """Return positions and velocities of a throw, shape (501, 3) each."""
    r = np.array((rng.uniform(3.3, 4.9), rng.uniform(-0.4, 0.4), rng.uniform(-0.2, 0.6)))
    dr = np.array((-rng.uniform(5.0, 6.5), rng.uniform(-0.7, 0.7), rng.uniform(1.5, 3.0)))
    drag, states = max(rng.normal(0.04, 0.005), 0.0), [(r, dr)]
    for _ in range(500):
        states.append(fly(*states[-1], drag=drag, duration=H))
    return np.array([x[0] for x in states]), np.array([x[1] for x in states])


def outliers(share: float) -> Fault:
    """Return the fault of sightings 0.3 m away."""

    def fault(seen: Seen, rng: np.random.Generator) -> Seen:
        bad = []
        for t, r in seen:
            way = rng.normal(size=3)
            wild = rng.uniform() < share
            bad.append((t, r + 0.3 * way / np.linalg.norm(way) if wild else r))
        return bad

    return fault


def swapped(seen: Seen, rng: np.random.Generator) -> Seen:
    """Swap a tenth of the neighbours."""
    seen = list(seen)
    for i in range(len(seen) - 1):
        if rng.uniform() < 0.1:
            seen[i], seen[i + 1] = seen[i + 1], seen[i]
    return seen


def other_ball(seen: Seen, _: np.random.Generator) -> Seen:
    """Let a second ball, 0.3 m aside, be seen beside the first for the last 50 ms."""
    n = len(seen) - 50
    extra = [(t + 1e-6, r + np.array((0.0, 0.3, 0.0))) for t, r in seen[n:]]
    return seen[:n] + [x for pair in zip(seen[n:], extra, strict=True) for x in pair]


def late(seen: Seen, rng: np.random.Generator) -> Seen:
    """Deliver each sighting up to 20 ms late, with its own stamp."""
    order = np.argsort(np.arange(len(seen)) + rng.uniform(0.0, 20.0, len(seen)))
    return [seen[i] for i in order]


FAULTS: dict[str, Fault] = {
    "no fault": lambda seen, _: seen,
    "last 5 ms missing": lambda seen, _: seen[:-5],
    "last 20 ms missing": lambda seen, _: seen[:-20],
    "last 50 ms missing": lambda seen, _: seen[:-50],
    "last 100 ms missing": lambda seen, _: seen[:-100],
    "half lost": lambda seen, rng: [x for x in seen if rng.uniform() < 0.5],
    "nine of ten lost": lambda seen, rng: [x for x in seen if rng.uniform() < 0.1],
    "10 % swapped": swapped,
    "10 % doubled": lambda seen, rng: [x for x in seen for _ in range(1 + (rng.uniform() < 0.1))],
    "1 % outliers": outliers(0.01),
    "10 % outliers": outliers(0.1),
    "second ball, last 50 ms": other_ball,
    "late by 20 ms, stamped": late,
    "frozen, last 100 ms": lambda seen, _: seen[:-100] + [seen[-101]] * 100,
}


def faults(throws: int) -> None:
    """Print the error at contact under each fault, beside the table's."""
    print(f"faults, {throws} throws, 3 mm of noise: error at contact [mm rms], growth, table, its")
    print("growth, and throws that end untracked or more than 30 mm off")
    config, clean = filter_settings(0.04, 0.07), np.nan
    for name, fault in FAULTS.items():
        rng, errors = np.random.default_rng(SEED), []
        for _ in range(throws):
            r, _ = thrown(rng)
            seen = [(i * H, x + 3e-3 * rng.normal(size=3)) for i, x in enumerate(r)]
            ball = BallFilter(config)
            for t, z in fault(seen, np.random.default_rng(rng.integers(2**32))):
                ball.update(Sighting(t=t, found=True, r_o=z, covariance=9e-6 * np.eye(3)))
            state = ball.state(500 * H)
            errors.append(1e3 * np.linalg.norm(state.r_o - r[-1]) if state.tracked else np.inf)
        found = np.array(errors)
        lost = ~(found < 30.0)
        rms = float(np.sqrt(np.mean(found[~lost] ** 2)))
        clean = rms if name == "no fault" else clean
        table = TABLE_C[name]
        print(
            f"  {name:26s}{rms:6.2f}{rms / clean:6.2f}{table:8.2f}{table / 1.1:6.2f}{lost.sum():6d}"
        )


def heads(throws: int) -> None:
    """Print the errors with the noise of active heads: 2.5 mm of depth at 3 m, 0.3 mm aside."""
    rng, position, velocity = np.random.default_rng(SEED + 1), [], []
    for _ in range(throws):
        r, dr = thrown(rng)
        ball = BallFilter(filter_settings(0.04, 0.07))
        for i, x in enumerate(r):
            far = float(np.linalg.norm(x))
            ray, depth = x / far, 2.5e-3 * (far / 3.0) ** 2
            R = 0.3e-3**2 * (np.eye(3) - np.outer(ray, ray)) + depth**2 * np.outer(ray, ray)
            z = x + np.linalg.cholesky(R) @ rng.normal(size=3)
            ball.update(Sighting(t=i * H, found=True, r_o=z, covariance=R))
            state = ball.state(i * H)
            if i >= 50:
                position.append(np.sum((state.r_o - x) ** 2))
            if i >= 100:
                velocity.append(np.sum((state.dr_o - dr[i]) ** 2))
    r_rms, dr_rms = 1e3 * np.sqrt(np.mean(position)), np.sqrt(np.mean(velocity))
    print(
        f"active heads' noise, {throws} throws: {r_rms:.2f} mm rms after 50 ms, "
        f"{dr_rms:.3f} m/s rms after 100 ms"
    )


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--throws", type=int, default=400)
    throws = parser.parse_args().throws
    recorded()
    heads(max(throws // 4, 1))
    faults(throws)


if __name__ == "__main__":
    main()
