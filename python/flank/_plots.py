"""Plots."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ._records import optional

if TYPE_CHECKING:
    from ._run import Run


def plot_run(run: Run, contact: str | int, cycles: int, axes: Any) -> Any:
    """Plot deflection and force of a contact over the last cycles, with its events."""
    pyplot = optional("matplotlib.pyplot", "a plot")
    names = run.scene.contacts
    j = contact if isinstance(contact, int) else names.index(contact)
    motion = run.trajectory(samples_per_cycle=256)
    # Lines break nowhere: events between two samples have points of their own.
    shown = motion.cycle >= motion.cycle[-1] - cycles
    t, deflection, force = motion.t[shown], motion.deflection[shown, j], motion.force[shown, j]
    if axes is None:
        _, axes = pyplot.subplots(2, 1, sharex=True, figsize=(8, 5), layout="constrained")
    above, below = axes
    length, force_unit, time = ("", "", "") if run.scene.dimensionless else (" in m", " in N", " in s")
    above.plot(t, deflection, color="C0", lw=1.2)
    gap = run.scene.check()["contacts"][j]["half_backlash_m"]
    for sign, flank in ((1.0, "drive flank"), (-1.0, "back flank")):
        above.axhline(sign * gap, color="0.6", lw=0.8, ls="--", label=f"{flank}" if gap or sign > 0 else None)
    below.plot(t, force, color="C1", lw=1.2)
    if len(run.events):
        name = next(column for column in run.events if column in ("t", "t_s"))
        height = next(column for column in run.events if column in ("deflection", "deflection_m"))
        chosen = (run.events["contact"] == names[j]) & (run.events[name] >= t[0])
        above.plot(run.events[name][chosen], run.events[height][chosen], "k.", ms=5, label="event")
    above.set_ylabel(f"deflection{length}")
    above.legend(loc="upper right", fontsize="small")
    below.set_ylabel(f"force{force_unit}")
    below.set_xlabel(f"time{time}")
    above.set_title(f"{run.scene.name}: {names[j]}", fontsize="medium")
    return above.figure
