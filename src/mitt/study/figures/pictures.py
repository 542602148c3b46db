"""Fig. 12: the throw as pictures every 33 ms, drawn in software."""

import base64
import io
from dataclasses import dataclass

import matplotlib.image
import numpy as np

from mitt.robot.arm import Arm
from mitt.study.log import TrialLog
from mitt.world.build import build_plant
from mitt.world.pictures import View, picture
from mitt.world.scene import Scene

#: Pictures a video of the paper's time has [s], how many before and after the catch, and the
#: spacing of the dots that trail the ball [ticks].
_PERIOD, _BEFORE, _LATER, _DOTS = 1.0 / 30.0, 7, 4, 8
#: From the side, a little from the thrower's end, so near that the fingers show.
_VIEW = View(eye=(1.0, -3.6, 0.45), target=(0.72, 0.0, 0.16), width=340, height=262, field_deg=21.5)


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """One picture.

    Attributes:
        t: Time from release [s].
        catch: Whether it shows the catch.
        png: PNG in base64.
    """

    t: float
    catch: bool
    png: str


def picture_strip(arm: Arm, scene: Scene, log: TrialLog) -> tuple[Picture, ...]:
    """Return pictures every 33 ms, one of them at the catch, or to the end without one."""
    trace = log.truth
    caught = bool(np.isfinite(log.t_catch))
    last = log.t_catch if caught else float(trace.t[-1])
    steps = np.arange(-_BEFORE, (_LATER if caught else 0) + 1)
    model = build_plant(scene, arm.model).model
    out = []
    for step in steps:
        t = last + step * _PERIOD
        if not trace.t[0] <= t <= trace.t[-1] + 1e-9:
            continue
        k = int(np.argmin(np.abs(trace.t - t)))
        trail = trace.r_o[max(k - 12 * _DOTS, 0) : k : _DOTS]
        pixels = picture(model, trace.qpos[k], _VIEW, trail=trail)
        stream = io.BytesIO()
        matplotlib.image.imsave(stream, pixels, format="png", metadata={"Software": "mitt"})
        png = base64.b64encode(stream.getvalue()).decode("ascii")
        out.append(Picture(t=float(trace.t[k]), catch=bool(caught and step == 0), png=png))
    return tuple(out)
