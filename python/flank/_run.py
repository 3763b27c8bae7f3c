"""Records of runs."""

from __future__ import annotations

import contextlib
import html
import importlib
import json
from collections.abc import Callable, Iterator
from pathlib import PurePath
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from . import _flank
from ._arguments import numbers, refuse, warn, whole
from ._errors import Error, Fault, Interrupted
from ._events import Events
from ._records import Named, Record, optional

if TYPE_CHECKING:
    from ._scene import Scene


class Run:
    """Record of a run: its events, its measures and its motion."""

    __slots__ = ("_core", "_summary", "events", "scene")

    def __init__(self, scene: Scene, core: _flank.Run) -> None:
        self._core = core
        self._summary = Record(json.loads(core.summary()))
        self.scene = scene
        """The scene."""
        self.events = Events(core.events)
        """Events as columns; empty for a run with ``log=False``."""

    @classmethod
    def _of(
        cls,
        scene: Scene,
        settings: dict[str, Any],
        observer: Callable[[Record], bool | None] | None,
        progress: bool | Callable[[float], Any],
    ) -> Run:
        if observer is not None:

            def watch(text: str) -> bool:
                answer = observer(Record(json.loads(text)))
                return not (isinstance(answer, (bool, np.bool_)) and not answer)

            settings["observer"] = watch
        else:
            settings["observer"] = None
        with bar(progress, "share", PurePath(scene.name).stem) as report:
            settings["progress"] = report
            core, failure = scene._core.run(settings)
        run = cls(scene, core)
        scene._warn()
        if failure is not None:
            if isinstance(failure, Interrupted):
                failure = Interrupted(f"interrupted at t = {run.outcome.seconds}; the attribute run has the record up to there")
            if isinstance(failure, Error):
                failure.run = run
            raise failure
        finish(progress)
        budget = scene.resolved["run"]["event_budget"]
        if run.outcome.kind == "event-budget-spent" and run.work.events >= budget:
            text = f"the event budget of the scene, {budget}, was spent in cycle {run.outcome.cycle}: raise event_budget"
            warn(text)
        return run

    @property
    def summary(self) -> Record:
        """All measures, with their origin: the content of ``summary.json``."""
        return self._summary

    @property
    def contacts(self) -> Named:
        """Measures of each contact by name, such as ``run.contacts["mesh"].apart_fraction``."""
        return Named(self._summary["contacts"])

    @property
    def transmission(self) -> Named:
        """Dynamic transmission error of each contact, by name."""
        return Named(self._summary["transmission"])

    @property
    def bearings(self) -> Named:
        """Forces of each bearing, by name."""
        return Named(self._summary["bearings"])

    @property
    def energy(self) -> Record:
        """Energy balance of the measured time, J."""
        record: Record = self._summary["energy"]
        return record

    @property
    def outcome(self) -> Record:
        """End of the run: its kind, time, mode, coordinates ``q`` and velocities ``v``."""
        record: Record = self._summary["outcome"]
        return record

    @property
    def work(self) -> Record:
        """Numbers of events, steps and grazes."""
        record: Record = self._summary["work"]
        return record

    def trajectory(self, t: npt.ArrayLike | None = None, *, samples_per_cycle: int | None = None) -> Trajectory:
        """Return the motion at given times, from the dense output.

        The motion is computed again up to the last time, with the same bits.

        Parameters
        ----------
        t : array_like, optional
            Times in rising order, s, ``[m]``, from the start of the run to its end.
        samples_per_cycle : int, optional
            Number of samples in each forcing cycle, at equal phases; 64 if neither is given.

        Returns
        -------
        Trajectory
        """
        if t is not None and samples_per_cycle is not None:
            raise refuse(Fault("samples_per_cycle", "given beside t", "t or samples_per_cycle", "leave one of them out"))
        if t is not None:
            return Trajectory(self.scene, *self._core.samples(times=numbers("t", t, 1).tolist()))
        per_cycle = whole("samples_per_cycle", 64 if samples_per_cycle is None else samples_per_cycle, 1, 2**20)
        return Trajectory(self.scene, *self._core.samples(per_cycle=per_cycle))

    def plot(self, contact: str | int = 0, *, cycles: int = 4, ax: Any = None) -> Any:
        """Plot deflection and force of a contact over the last cycles, with its events.

        Parameters
        ----------
        contact : str or int
            Name or number of the contact.
        cycles : int
            Number of cycles before the end; a scene without cycles is shown as a whole.
        ax : pair of matplotlib.axes.Axes, optional
            Axes of the deflection and of the force.

        Returns
        -------
        matplotlib.figure.Figure
        """
        from ._plots import plot_run

        return plot_run(self, contact, cycles, ax)

    def __reduce__(self) -> Any:
        raise TypeError("a Run cannot be pickled: keep run.summary.to_dict(), run.events.to_pandas() and the scene")

    def __repr__(self) -> str:
        return f"Run({self.scene.name!r}: {self.outcome.kind}, t = {self.outcome.seconds:.6g}, {self.work.events} events)"

    def _repr_html_(self) -> str:
        unit = "" if self.scene.dimensionless else "N"
        head = ["contact", "time apart", "separations", "contacts on drive and back", "mean force", "largest force"]
        rows = [
            [
                html.escape(name),
                f"{100 * contact.apart_fraction:.3g} %",
                str(contact.separations),
                f"{contact.drive_contacts}, {contact.back_contacts}",
                f"{contact.force_mean:.5g} {unit}",
                f"{contact.force_abs_max:.5g} {unit}",
            ]
            for name, contact in self.contacts.items()
        ]
        cells = "".join("<tr>" + "".join(f"<td>{cell}</td>" for cell in row) + "</tr>" for row in rows)
        titles = "".join(f"<th>{title}</th>" for title in head)
        return f"<p>{html.escape(repr(self))}</p><table><tr>{titles}</tr>{cells}</table>"


class Trajectory:
    """Motion at given times. At the time of an event, rounded to a double, it is the state after the event."""

    __slots__ = ("_names", "_values", "scene")

    def __init__(self, scene: Scene, names: list[str], values: npt.NDArray[np.float64]) -> None:
        self.scene = scene
        self._names, self._values = names, values

    @property
    def t(self) -> npt.NDArray[np.float64]:
        """Times, s, ``[m]``."""
        return self._values[:, 0]

    @property
    def cycle(self) -> npt.NDArray[np.int64]:
        """Forcing cycles, ``[m]``."""
        return self._values[:, 1].astype(np.int64)

    @property
    def phase(self) -> npt.NDArray[np.float64]:
        """Time since the start of the cycle, s, ``[m]``."""
        return self._values[:, 2]

    @property
    def q(self) -> npt.NDArray[np.float64]:
        """Coordinates, m, ``[m][n]``."""
        return self._values[:, 3 : 3 + len(self.scene.freedoms)]

    @property
    def v(self) -> npt.NDArray[np.float64]:
        """Velocities, m/s, ``[m][n]``."""
        n = len(self.scene.freedoms)
        return self._values[:, 3 + n : 3 + 2 * n]

    @property
    def deflection(self) -> npt.NDArray[np.float64]:
        """Deflection of each contact, m, ``[m][contacts]``."""
        return self._values[:, 3 + 2 * len(self.scene.freedoms) :: 2]

    @property
    def force(self) -> npt.NDArray[np.float64]:
        """Force of each contact, N, ``[m][contacts]``."""
        return self._values[:, 4 + 2 * len(self.scene.freedoms) :: 2]

    def __len__(self) -> int:
        return len(self._values)

    def __repr__(self) -> str:
        return f"Trajectory({len(self)} samples: {', '.join(self._names)})"

    def to_pandas(self) -> Any:
        """Return a ``pandas.DataFrame`` with the columns of ``trajectory.csv``."""
        return optional("pandas", "a data frame").DataFrame(self._values, columns=self._names)

    def to_xarray(self) -> Any:
        """Return an ``xarray.Dataset`` over time, freedom and contact."""
        xarray = optional("xarray", "a dataset")
        data = {
            "q": (("t", "freedom"), self.q, {"units": "m"}),
            "v": (("t", "freedom"), self.v, {"units": "m/s"}),
            "deflection": (("t", "contact"), self.deflection, {"units": "m"}),
            "force": (("t", "contact"), self.force, {"units": "N"}),
        }
        if self.scene.dimensionless:
            data = {name: (dimensions, values, {}) for name, (dimensions, values, _) in data.items()}
        coordinates = {"t": self.t, "freedom": self.scene.freedoms, "contact": self.scene.contacts}
        return xarray.Dataset(data, coordinates)


def finish(progress: Any) -> None:
    """Tell a callback that work is done."""
    if callable(progress):
        progress(1.0)


@contextlib.contextmanager
def bar(progress: Any, kind: str, name: str, total: int | None = None) -> Iterator[Callable[[int, float], None] | None]:
    """Give a callback that shows the share that is done, or the number of finished rows."""
    if not callable(progress) and not isinstance(progress, bool):
        raise refuse(Fault("progress", repr(progress), "True, False, or a callable of one argument", ""))
    if callable(progress):
        done = 0.0

        def report(units: int, share: float) -> None:
            nonlocal done
            done = max(done, share if kind == "share" else units / (total or 1))
            progress(done)

        yield report
        return
    if not progress:
        yield None
        return
    try:
        tqdm = importlib.import_module("tqdm.auto").tqdm
    except ImportError:
        yield None
        return
    form = "{l_bar}{bar}| {elapsed}<{remaining}" if kind == "share" else None
    with tqdm(total=1.0 if kind == "share" else total, desc=name, bar_format=form) as shown:

        def show(units: int, share: float) -> None:
            shown.n = share if kind == "share" else units
            shown.refresh()

        yield show
