"""Sections, orbits, exponents, branches and thresholds."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _flank
from ._arguments import ends as ends_of
from ._arguments import numbers, refuse, threads_or_none, warn, whole, whole_or_none
from ._errors import Error, Fault
from ._flank import Section
from ._records import Record
from ._run import bar, finish
from ._scene import Scene, checked

Array = npt.NDArray[np.float64]

MEMORY = 10**10
"""Largest size of the states of an ensemble, bytes: a process that asks for more than there is ends without a word."""


class SectionMap:
    """Map of states over whole cycles of the forcing, from phase 0 to phase 0, with its derivatives.

    A state is a :class:`Section`, or an array: coordinates and velocities, ``[2n]``, or a whole state with latched speeds, ``[dim]``.
    Contacts of an array are open or closed by their deflections.

    Parameters
    ----------
    scene : Scene
        A scene whose forcing has a period.

    Examples
    --------
    >>> import flank, numpy as np
    >>> scene = flank.load({
    ...     "flank": 1,
    ...     "train": {"kind": "gear-pair-dimensionless", "damping_ratio": 0.05, "damping_in_gap": True, "mean_load": 0.1,
    ...               "transmission_error": [{"amplitude": 0.05, "frequency": 0.8}]},
    ...     "run": {"cycles": 100},
    ... })
    >>> section_map = flank.SectionMap(scene)
    >>> orbit = flank.orbit(scene)
    >>> bool(np.allclose(section_map(orbit.x).x, orbit.x, atol=1e-12))
    True
    """

    __slots__ = ("_core", "scene")

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self._core = _flank.SectionMap(checked(scene)._core)

    @property
    def cycle(self) -> float:
        """Length of a cycle, s."""
        return self._core.cycle

    @property
    def periods_per_cycle(self) -> int:
        """Periods of the forcing clock, such as mesh periods, in a cycle."""
        return self._core.periods_per_cycle

    @property
    def components(self) -> list[str]:
        """Names of the components of a state, ``[dim]``."""
        return self._core.components

    def start(self) -> Section:
        """Return the section at which the scene starts."""
        return self._core.start()

    def section(self, x: npt.ArrayLike | Section, contacts: Sequence[str] | None = None) -> Section:
        """Return the section at a state, with contacts in given states, such as ``["drive", "separated"]``."""
        if isinstance(x, Section):
            return x
        return self._core.section(numbers("x", x, 1), None if contacts is None else list(contacts))

    def __call__(self, x: npt.ArrayLike | Section, cycles: int = 1) -> Section:
        """Return the section after some cycles."""
        return self._core.follow(self.section(x), whole("cycles", cycles, 1, 10**6))

    def jacobian(self, x: npt.ArrayLike | Section, cycles: int = 1) -> Array:
        """Return the derivative of the state after some cycles by the state, ``[dim][dim]``."""
        return self.image(x, cycles=cycles).jacobian

    def derivative(self, x: npt.ArrayLike | Section, *keys: str, cycles: int = 1) -> Array:
        """Return the derivative of the state after some cycles by numbers of the scene, ``[dim][len(keys)]``; keys or JSON pointers."""
        return self.image(x, *keys, cycles=cycles).by_number

    def image(self, x: npt.ArrayLike | Section, *keys: str, cycles: int = 1) -> Image:
        """Return the image of a state after some cycles, with its derivatives by the state and by numbers of the scene."""
        pointers = [self.scene.pointer(key) for key in keys]
        return Image(*self._core.image(self.section(x), whole("cycles", cycles, 1, 10**6), pointers))


class Image:
    """Image of a section, with its derivatives."""

    __slots__ = ("between", "by_number", "end", "facts", "jacobian", "word")

    def __init__(self, end: Section, between: Array, jacobian: Array, by_number: Array, word: list[str], facts: str) -> None:
        self.end = end
        """Section after the cycles."""
        self.between = between
        """State after each cycle, ``[cycles][dim]``."""
        self.jacobian = jacobian
        """Derivative of the end by the start, ``[dim][dim]``."""
        self.by_number = by_number
        """Derivative of the end by each requested number, ``[dim][count]``."""
        self.word = word
        """Tokens of the events."""
        self.facts = Record(json.loads(facts))
        """``zeros``, ``volume``, ``corner`` and ``has_event_at_section``."""

    def __repr__(self) -> str:
        return f"Image(end={self.end.x!r}, word={' '.join(self.word)!r})"


class Ensemble:
    """Many motions of one train, each with the bits of the same motion alone, run from section to section.

    Parameters
    ----------
    scene : Scene
        A scene whose forcing has a period.
    x0 : array_like
        Starts: coordinates, m, and velocities, m/s, of each member, ``[members][2n]``.
    """

    __slots__ = ("scene", "x0")

    def __init__(self, scene: Scene, x0: npt.ArrayLike) -> None:
        self.scene = checked(scene)
        self.x0 = numbers("x0", x0, 2).copy()

    def run(
        self,
        cycles: int,
        *,
        every: int = 1,
        threads: int | None = None,
        progress: bool | Callable[[float], Any] = False,
    ) -> Array:
        """Return the states of all members at phase 0, without a loop in Python.

        Parameters
        ----------
        cycles : int
            Number of cycles of the forcing clock.
        every : int
            Cycles between two sections. A motion is cut at its sections: under another ``every`` the last bits differ.
        threads : int, optional
            As many as there are cores by default; results do not depend on it.
        progress : bool or callable
            Show a bar, or call this with the share that is done.

        Returns
        -------
        numpy.ndarray
            ``[members][cycles // every + 1][dim]``, the start first; ``scene.components`` names the components. The states of a member
            after a failure are NaN, and a :class:`SceneWarning` says why.

        Raises
        ------
        SceneError
            For a start that the train does not have, with its member.
        """
        length = whole("cycles", cycles, 0, 2**52), whole("every", every, 1, 2**52)
        memory = 8 * len(self.x0) * (length[0] // length[1] + 1) * len(self.scene.components)
        if memory > MEMORY:
            found = f"{cycles}: states of {memory:.1e} bytes"
            raise refuse(Fault("cycles", found, f"states of at most {MEMORY:.0e} bytes", "take fewer cycles, or a larger every"))
        with bar(progress, "units", "members", len(self.x0)) as report:
            states, failures = _flank.sections(self.scene._core, self.x0, length, threads_or_none(threads), report)
        finish(progress)
        self.scene._warn()
        if failures:
            member, reason = failures[0]
            text = f"{len(failures)} of {len(self.x0)} members failed, first member {member}: {reason}"
            warn(text)
        return states

    def __len__(self) -> int:
        return len(self.x0)

    def __repr__(self) -> str:
        return f"Ensemble({self.scene.name!r}, {len(self)} members)"


class Orbit:
    """Periodic orbit."""

    __slots__ = ("record", "scene")

    def __init__(self, scene: Scene, record: Record) -> None:
        changed: dict[str, Any] = {"/initial": record["initial"].to_dict()}
        if _flank.SectionMap(scene._core).starts_within_a_period:
            changed["/run/start_cycle"] = 0
        self.scene = scene.with_(changed)
        """The scene, started on the orbit."""
        self.record = record
        """Its entry in ``orbit.json``."""

    @property
    def period(self) -> int:
        """Smallest period, cycles."""
        return int(self.record["period_cycles"])

    @property
    def word(self) -> str:
        """Its events, in normal form."""
        return str(self.record["word"])

    @property
    def x(self) -> Array:
        """State at phase 0, ``[dim]``."""
        return np.array(self.record["x"], dtype=np.float64)

    @property
    def contacts(self) -> list[str]:
        """State of each contact at phase 0."""
        return list(self.record["contacts"])

    @property
    def section(self) -> Section:
        """Section at phase 0: the state and the states of the contacts."""
        return SectionMap(self.scene).section(self.x, self.contacts)

    @property
    def multipliers(self) -> npt.NDArray[np.complex128]:
        """Multipliers, the largest first, ``[dim]``."""
        return np.array([complex(*pair) for pair in self.record["multipliers"]], dtype=np.complex128)

    @property
    def is_stable(self) -> bool:
        """True if all multipliers but neutral ones are inside the unit circle."""
        return bool(self.record["stable"])

    @property
    def is_marginal(self) -> bool:
        """True if rounding may decide on ``is_stable``."""
        return bool(self.record["marginal"])

    @property
    def residual(self) -> float:
        """Distance between start and end, in scales of the motion."""
        return float(self.record["residual"])

    @property
    def condition(self) -> float:
        """Norm of ``(I - J)^-1`` in scales: the error of the state is about this times the residual."""
        condition = self.record["condition"]
        return float("inf") if condition is None else float(condition)

    def __repr__(self) -> str:
        stability = "marginal" if self.is_marginal else "stable" if self.is_stable else "unstable"
        return f"Orbit(period={self.period}, {stability}, word={self.word!r})"


def orbit(scene: Scene, *, period: int | None = None, threads: int | None = None, progress: bool | Callable[[float], Any] = False) -> Orbit:
    """Solve for the periodic orbit that a scene starts on or approaches, stable or not.

    Parameters
    ----------
    scene : Scene
        A scene whose forcing has a period.
    period : int, optional
        Period, cycles; the smallest that is found by default.
    threads : int, optional
        As many as there are cores by default.
    progress : bool or callable
        Show a bar, or call this with the share that is done.

    Raises
    ------
    Error
        If no orbit is found, with the reason.
    """
    found = _search(scene, period, 0, threads, progress)
    if not found["orbits"]:
        raise Error(f"no orbit: {found['reason']}")
    return Orbit(scene, found["orbits"][0])


def orbits(
    scene: Scene,
    *,
    starts: int,
    period: int | None = None,
    threads: int | None = None,
    progress: bool | Callable[[float], Any] = False,
) -> list[Orbit]:
    """Search for all orbits, from the start of the scene, the end of its run and further starts, in the order in which they are found.

    Parameters
    ----------
    starts : int
        Number of further starts, spread over the states of the motion and around them.
    scene, period, threads, progress
        As for :func:`orbit`.
    """
    return [Orbit(scene, record) for record in _search(scene, period, starts, threads, progress)["orbits"]]


def _search(scene: Scene, period: int | None, starts: int, threads: int | None, progress: Any) -> Record:
    checked(scene)
    period, starts = whole_or_none("period", period, 1, 10**4), whole("starts", starts, 0, 10**9)
    with bar(progress, "share", "orbits") as report:
        found = Record(json.loads(_flank.orbits(scene._core, period, starts, threads_or_none(threads), report)))
    finish(progress)
    scene._warn()
    if found["orbits"] and found["reason"]:
        warn(f"{scene.name}: {found['reason']}")
    for record in found["orbits"]:
        if record["event_at_phase_0"]:
            warn(f"orbit {record['word']!r}: an event lies on phase 0: it may be missing from word and multipliers, or be there twice")
        if record["piecewise"]:
            warn(f"orbit {record['word']!r}: dependent impacts fall on one instant: multipliers do not tell its stability")
    return found


class Exponents:
    """Lyapunov exponents with their bands."""

    __slots__ = ("course", "record")

    def __init__(self, content: dict[str, Any]) -> None:
        self.course: list[Any] = content.pop("course")
        """Course of the averages: cycles averaged, mean and band of each exponent."""
        self.record = Record(content)
        """Content of ``lyapunov.json``."""

    @property
    def exponents(self) -> Array:
        """Exponents, 1/s (1/time for a dimensionless scene), the largest first; minus infinity for ranks that contacts take."""
        return _numbers(self.record["exponents"], -np.inf)

    @property
    def band(self) -> Array:
        """One standard error of each exponent; NaN where there is none."""
        return _numbers(self.record["band"], np.nan)

    @property
    def sum(self) -> float | None:
        """Sum of the finite exponents."""
        value: float | None = self.record["sum"]
        return value

    @property
    def sum_rule(self) -> float | None:
        """Predicted value of the sum; None if contacts rest or latch speeds."""
        value: float | None = self.record["sum_rule"]
        return value

    @property
    def cycles(self) -> int:
        """Cycles averaged."""
        return int(self.record["cycles"])

    @property
    def is_whole(self) -> bool:
        """True if all requested cycles are averaged."""
        return bool(self.record["is_whole"])

    @property
    def reason(self) -> str | None:
        """Reason for stopping before the band was small enough, or before the end."""
        value: str | None = self.record["reason"]
        return value

    @property
    def without_saltation(self) -> Array | None:
        """Exponents without the change of event times, if requested."""
        bare = self.record.get("without_saltation")
        return None if bare is None else _numbers(bare["exponents"], -np.inf)

    @property
    def finite(self) -> Record | None:
        """Finite-time exponents of the first cycles, if requested."""
        value: Record | None = self.record.get("finite")
        return value

    def __repr__(self) -> str:
        return f"Exponents({self.exponents}, band={self.band}, cycles={self.cycles})"


def exponents(
    scene: Scene,
    *,
    cycles: int | None = None,
    without_saltation: bool = False,
    finite: int | None = None,
    progress: bool | Callable[[float], Any] = False,
) -> Exponents:
    """Measure all Lyapunov exponents of the motion that a scene runs to.

    Parameters
    ----------
    scene : Scene
        A scene whose forcing has a period.
    cycles : int, optional
        Cycles averaged; until the band of the largest exponent is below 1e-3 of it by default.
    without_saltation : bool
        Add the exponents without the change of event times.
    finite : int, optional
        Add the finite-time exponents of this many first cycles.
    progress : bool or callable
        Show a bar, or call this with the share that is done.
    """
    checked(scene)
    cycles, finite = whole_or_none("cycles", cycles, 1, 10**9), whole_or_none("finite", finite, 1, 10**9)
    with bar(progress, "share", "exponents") as report:
        found = Exponents(json.loads(_flank.exponents(scene._core, cycles, without_saltation, finite, report)))
    finish(progress)
    scene._warn()
    if found.reason:
        warn(f"{scene.name}: {found.reason}")
    if found.record.piecewise:
        warn(f"{scene.name}: dependent impacts fell on one instant: exponents are those of neighbours that keep them together")
    return found


class Branch:
    """Branch of periodic orbits along a number of a scene."""

    __slots__ = ("ends", "is_stable", "level", "multipliers", "periods", "residuals", "specials", "unlocated", "values", "words", "x")

    def __init__(self, parts: Sequence[Any]) -> None:
        self.level: int
        """0 for the first branch; one more for each doubling or broken symmetry."""
        self.values: Array
        """Values of the number, ``[points]``."""
        self.periods: npt.NDArray[np.uint64]
        """Periods, cycles, ``[points]``."""
        self.words: list[str]
        """Words of the orbits."""
        self.multipliers: Array
        """Largest absolute values of multipliers, ``[points]``."""
        self.x: Array
        """States at phase 0, ``[points][dim]``."""
        self.residuals: Array
        """Residuals, in scales of the motion, ``[points]``."""
        self.ends: tuple[str, str]
        """Reasons for the two ends."""
        (self.level, self.values, self.periods, self.words, stable, self.multipliers, self.x, self.residuals, ends, text) = parts
        self.is_stable: npt.NDArray[np.bool_] = np.array(stable, dtype=np.bool_)
        """True for stable orbits, ``[points]``."""
        self.ends = tuple(ends)
        further = json.loads(text)
        self.specials = [Record({**special, "multiplier": complex(*special["multiplier"])}) for special in further["specials"]]
        """Points at which the motion changes: kind, value, period, word, residual, uncertainty, multiplier, turns, and the
        number of its point on the branch (of its neighbour if the branch is born on another one)."""
        self.unlocated: list[str] = further["unlocated"]
        """Points that were passed and not located."""

    def __len__(self) -> int:
        return len(self.values)

    def __repr__(self) -> str:
        kinds = ", ".join(f"{special.kind} at {special.value:.6g}" for special in self.specials)
        return f"Branch(level {self.level}, {len(self)} points{': ' + kinds if kinds else ''})"


def continuation(
    scene: Scene,
    axis: Mapping[str | tuple[str, ...], tuple[float, float]] | None = None,
    /,
    *,
    period: int | None = None,
    doublings: int = 3,
    threads: int | None = None,
    progress: bool | Callable[[float], Any] = False,
    **key: tuple[float, float],
) -> list[Branch]:
    """Follow periodic orbits along a number of a scene, and locate the points at which the motion changes.

    Parameters
    ----------
    scene : Scene
        A scene whose forcing has a period; its orbit begins the first branch.
    axis : mapping, optional
        The number, by key or JSON pointer, and the ends of its range. A tuple of
        numbers moves further frequencies and periods with the first.
    period : int, optional
        Period of the first orbit, cycles.
    doublings : int
        Levels of branches beyond the first that are followed.
    threads : int, optional
        As many as there are cores by default.
    progress : bool or callable
        Show a bar, or call this with the share that is done.
    **key
        The number by key, such as ``speed_rpm=(400, 6000)``.

    Returns
    -------
    list of Branch
    """
    axes: dict[str | tuple[str, ...], tuple[float, float]] = dict(axis or {})
    axes.update(key)
    if len(axes) != 1:
        raise TypeError(f"a continuation follows one number, not {len(axes)}")
    ((keys, ends),) = axes.items()
    checked(scene)
    pointers = [scene.pointer(each) for each in ([keys] if isinstance(keys, str) else keys)]
    first = whole_or_none("period", period, 1, 10**4), whole("doublings", doublings, 0, 100)
    with bar(progress, "share", "branches") as report:
        found, left_out = _flank.branches(scene._core, pointers, ends_of(str(keys), ends), first, threads_or_none(threads), report)
    finish(progress)
    scene._warn()
    if left_out:
        text = f"{left_out} further branches are not followed: take a shorter range or fewer doublings"
        warn(text)
    branches = [Branch(parts) for parts in found]
    for number, branch in enumerate(branches):
        for passed in branch.unlocated:
            warn(f"branch {number}: not located: {passed}")
    return branches


def threshold(
    scene: Scene,
    axis: Mapping[str, tuple[float, float]] | None = None,
    /,
    *,
    by: str = "deflection",
    **key: tuple[float, float],
) -> Record:
    """Find the load below which meshes lose contact: a graze, to rounding, or a bracket where the motion jumps.

    Parameters
    ----------
    scene : Scene
        The scene.
    axis : mapping, optional
        Number to vary, by key or JSON pointer: its range, from the end where contact is lost to the end where it is kept. The search begins
        at the second end. The load of the scene by default.
    by : {"deflection", "force", "back-flank"}
        Event that counts as loss of contact.
    **key
        The number by key, such as ``torque_nm=(1, 200)``.

    Returns
    -------
    Record
        ``threshold`` with its ``kind``: ``graze`` (``value``, ``uncertainty``, ``contact``), ``bracket`` (``with``, ``without``,
        ``margin``, ``contact``, ``motion``), ``never`` or ``always``. ``pointer``, ``range`` and ``by`` of the search. ``shared`` if
        another motion has the event before.
    """
    axes = {**(axis or {}), **key}
    if len(axes) > 1:
        raise TypeError(f"a threshold is sought along one number, not {len(axes)}")
    checked(scene)
    vary = None
    for name, ends in axes.items():
        vary = scene.pointer(name), ends_of(name, ends)
    found = Record(json.loads(_flank.threshold(scene._core, vary, by)))
    scene._warn()
    if found.threshold.kind == "always" and vary is not None:
        warn(f"{scene.name}: contact is lost at {vary[1][1]} already, where the search begins: swap the ends of the range")
    if found.shared:
        warn(f"{scene.name}: before the threshold the start leads to another motion, which has the event: sweep both ways")
    return found


def _numbers(values: list[float | None], absent: float) -> Array:
    return np.array([absent if value is None else value for value in values], dtype=np.float64)
