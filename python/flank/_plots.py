"""Plots."""

from __future__ import annotations

from pathlib import PurePath
from typing import TYPE_CHECKING, Any

import numpy as np

from ._arguments import refuse, whole
from ._errors import Fault
from ._records import optional

if TYPE_CHECKING:
    from ._run import Run


SAMPLES = 4097
"""Least number of points of a line: a line of twice the width of a page."""

PER_CYCLE = 128
"""Least number of points of a cycle."""

MOST = 2**20
"""Largest number of points of a line."""

AWAY = 2.0
"""Distance of a flank from the motion, in heights of the motion, beyond which the picture leaves it out."""


def plot_run(run: Run, contact: str | int, cycles: int, axes: Any) -> Any:
    """Plot deflection and force of a contact over the last cycles, with its events."""
    pyplot = optional("matplotlib.pyplot", "a plot")
    names = run.scene.contacts
    if not names:
        raise refuse(Fault("contact", "a scene without contacts", "a scene with a contact", "plot run.trajectory()"))
    if isinstance(contact, str) and contact in names:
        j = names.index(contact)
    elif isinstance(contact, (int, np.integer)) and not isinstance(contact, bool) and -len(names) <= contact < len(names):
        j = int(contact) % len(names)
    else:
        raise refuse(Fault("contact", repr(contact), f"one of {', '.join(map(repr, names))}, or its number", ""))
    if axes is not None and np.shape(axes) != (2,):
        raise refuse(Fault("ax", type(axes).__name__, "two axes, of the deflection and of the force", "make them by plt.subplots(2)"))
    period, (start, end) = run.summary.train.cycle, run._core.span
    points = SAMPLES
    if period is not None:
        start = max(start, end - whole("cycles", cycles, 1, 10**12) * period)
        points = min(max(points, 1 + round(PER_CYCLE * (end - start) / period)), MOST)
    motion = run.trajectory(np.linspace(start, end, points))
    scale, length, unit, time = (1.0, "", "", "") if run.scene.dimensionless else (1e6, " in µm", " in N", " in s")
    t, force = motion.t, motion.force[:, j]
    if axes is None:
        _, axes = pyplot.subplots(2, 1, sharex=True, figsize=(8, 5), layout="constrained")
    above, below = axes
    above.plot(t, scale * motion.deflection[:, j], color="C0", lw=1.2)
    train = run.scene.check()["contacts"][j]
    if "±" in train["guards"]:
        half_backlash = scale * train["half_backlash_m"]
        low, high = scale * motion.deflection[:, j].min(), scale * motion.deflection[:, j].max()
        for flank, style, name in ((half_backlash, "--", "drive flank"), (-half_backlash, ":", "back flank")):
            if low - AWAY * (high - low) <= flank <= high + AWAY * (high - low):
                above.axhline(flank, color="0.5", lw=0.8, ls=style, label=name)
    below.plot(t, force, color="C1", lw=1.2)
    if len(run.events):
        columns = list(run.events)
        at = run.events[next(name for name in columns if name in ("t", "t_s"))]
        deflection = scale * run.events[next(name for name in columns if name in ("deflection", "deflection_m"))]
        chosen = (run.events["contact"] == names[j]) & (at >= t[0])
        above.plot(at[chosen], deflection[chosen], "k.", ms=5, label="event")
    above.set_ylabel(f"deflection{length}")
    if above.get_legend_handles_labels()[0]:
        above.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, fontsize="small", frameon=False, borderaxespad=0.2)
    above.set_title(f"{PurePath(run.scene.name).stem}: {names[j]}", fontsize="medium", loc="left")
    below.set_ylabel(f"force{unit}")
    below.set_xlabel(f"time{time}")
    return above.figure
