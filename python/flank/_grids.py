"""Work over many points: sweeps, maps and basins, as datasets of xarray."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _flank
from ._arguments import number_or_none, numbers, refuse, threads_or_none, warn, whole, whole_or_none
from ._errors import Fault, Interrupted, SceneError
from ._records import optional
from ._run import bar, finish
from ._scene import Scene, checked

Axis = str | npt.ArrayLike
"""Values of an axis: an array, or ``"FROM:TO:COUNT"`` (``…:log`` for equal ratios) as in the command."""

UNITS = {
    "_m_per_s": "m/s",
    "_rad_per_s": "rad/s",
    "_n_per_m": "N/m",
    "_n_s_per_m": "N s/m",
    "_n_s": "N s",
    "_nm": "N m",
    "_kg_m2": "kg m²",
    "_rpm": "rev/min",
    "_rad": "rad",
    "_deg": "°",
    "_hz": "Hz",
    "_kg": "kg",
    "_s": "s",
    "_n": "N",
    "_m": "m",
    "_w": "W",
    "_j": "J",
}
"""Units by the ends of names."""


def unit_of(name: str) -> dict[str, str]:
    """Return the unit that the end of a name gives, as attributes of xarray; none for a quotient that the list does not have."""
    ends = [end for end in UNITS if name.endswith(end)]
    if not ends:
        return {}
    end = max(ends, key=len)
    is_quotient = "_per_" in name[: -len(end)] or ("_per_" in name and "_per_" not in end)
    return {} if is_quotient else {"units": UNITS[end]}


def sweep(
    scene: Scene,
    axes: Mapping[str, Axis] | None = None,
    /,
    *,
    seed: str = "fresh",
    columns: str | Sequence[str] = (),
    tolerance: float | None = None,
    max_cycles: int | None = None,
    measure_cycles: int | None = None,
    out: str | os.PathLike[str] | None = None,
    replace: bool = False,
    threads: int | None = None,
    progress: bool | Callable[[float], Any] = True,
    **keys: Axis,
) -> Any:
    """Measure the steady motion at every point of a grid of one or two numbers of a scene.

    Parameters
    ----------
    scene : Scene
        The scene.
    axes : mapping, optional
        Values by JSON pointer or key: an array, or ``"FROM:TO:COUNT"``, with ``:log`` for equal ratios.
    seed : {"fresh", "up", "down", "both"}
        Start of a point: as the scene says, or the end of its neighbour along the last axis.
    columns : str or sequence of str
        Measures of contacts, by their names without unit; the usual ones if empty.
    tolerance : float, optional
        Largest relative distance between the ends of an orbit, 1e-9 by default.
    max_cycles, measure_cycles : int, optional
        Cycles of the search for an orbit, 400 by default, and cycles measured.
    out : path, optional
        Folder of the files of ``flank sweep``, which get the same bytes. An interrupted call goes on from there.
    replace : bool
        Begin anew in a folder that has another sweep.
    threads : int, optional
        As many as there are cores by default; results do not depend on it.
    progress : bool or callable
        Show a bar (if ``tqdm`` is installed), or call this with the share that is done.
    **keys
        Values by key, such as ``speed_rpm=np.linspace(500, 900, 41)``.

    Returns
    -------
    xarray.Dataset
        A dimension for each axis, ``direction`` for ``seed="both"``, and ``contact`` for measures of contacts. Variables have the names of
        the columns of ``sweep.csv``, and their units as attributes. A point that failed has its reason in ``error``, and NaN elsewhere.

    Raises
    ------
    SceneError
        With all faults of the axes, or of the scene at the corners of the grid.
    Interrupted
        After Ctrl-C; the same call with the same ``out`` goes on.
    """
    settings = {
        "seed": seed,
        "columns": _listed(columns),
        "tolerance": number_or_none("tolerance", tolerance, 1e-13, 0.1),
        "max_cycles": whole_or_none("max_cycles", max_cycles, 1, 10**9),
        "measure_cycles": whole_or_none("measure_cycles", measure_cycles, 1, 10**5),
    }

    def work(texts: list[str], grid: dict[str, Any]) -> Any:
        table, interrupted = _flank.sweep(scene._core, texts, settings, grid)
        known = [name.rpartition(" ")[2] for name, _, _ in table]
        if table and not all(any(name.startswith(column) for name in known) for column in _listed(columns)):
            allowed = f"columns of the finished sweep in {grid['out']}: {', '.join(dict.fromkeys(known))}"
            raise refuse(Fault("columns", ", ".join(_listed(columns)), allowed, "name another folder, or compute anew by replace=True"))
        return table, interrupted

    points = _points(scene, {**(axes or {}), **keys}, _pointer)
    return _dataset("sweep", scene, points, work, (out, replace, threads, progress), 2 if seed == "both" else 1)


def map(
    scene: Scene,
    axes: Mapping[str, Axis] | None = None,
    /,
    *,
    columns: str | Sequence[str] = (),
    transient: int = 200,
    further: int = 500,
    out: str | os.PathLike[str] | None = None,
    replace: bool = False,
    threads: int | None = None,
    progress: bool | Callable[[float], Any] = True,
    **keys: Axis,
) -> Any:
    """Decide what the motion is in every cell over two numbers of a scene: periodic, chaotic, teeth apart, one flank or both.

    Parameters
    ----------
    scene, axes, out, replace, threads, progress, **keys
        As for :func:`sweep`, with two axes; the files are those of ``flank map``.
    columns : str or sequence of str
        Measures of contacts, by their names without unit; ``apart_fraction`` if empty.
    transient : int
        Cycles of the transient, from 1.
    further : int
        Cycles after it that decide on the kind of a motion without an orbit, from 100.

    Returns
    -------
    xarray.Dataset
        As for :func:`sweep`, with ``kind``, ``period_cycles``, ``word``, ``exponent`` and ``impacts`` of each cell.
    """
    cycles = _cycles(transient, further)

    def work(texts: list[str], grid: dict[str, Any]) -> Any:
        return _flank.kinds(scene._core, texts, _listed(columns), cycles, grid)

    points = _points(scene, {**(axes or {}), **keys}, _pointer)
    return _dataset("map", scene, points, work, (out, replace, threads, progress))


def basins(
    scene: Scene,
    axes: Mapping[str, Axis] | None = None,
    /,
    *,
    transient: int = 200,
    further: int = 500,
    out: str | os.PathLike[str] | None = None,
    replace: bool = False,
    threads: int | None = None,
    progress: bool | Callable[[float], Any] = True,
    **keys: Axis,
) -> Any:
    """Find the attractor on which each start in a plane of starts ends.

    Parameters
    ----------
    scene, out, replace, threads, progress
        As for :func:`sweep`; the files are those of ``flank basins``.
    axes : mapping
        Two components of the start: ``"q NAME"`` or ``"v NAME"`` with the name of a freedom, or their JSON pointers.
    transient, further : int
        As for :func:`map`.
    **keys
        ``q`` and ``v`` of a train with one freedom.

    Returns
    -------
    xarray.Dataset
        ``attractor`` (-1 if the motion is not decided or failed), ``cycles`` and ``error`` of each start. Variables along ``number``
        describe the attractors: ``attractor_kind``, ``attractor_period_cycles``, ``attractor_word``, ``attractor_impacts``,
        ``attractor_exponent``, and ``attractor_fraction`` of the starts with its ``attractor_standard_error``. The attribute
        ``attractors_json`` is the content of ``attractors.json``, with states and the measures of the boundary.
    """
    cycles = _cycles(transient, further)

    def work(texts: list[str], grid: dict[str, Any]) -> Any:
        table, interrupted = _flank.basins(scene._core, texts, cycles, grid)
        if interrupted is None:
            found.update(json.loads(Path(grid["out"], "attractors.json").read_text("utf-8")))
        return table, interrupted

    found: dict[str, Any] = {}
    points = _points(scene, {**(axes or {}), **keys}, _start)
    data = _dataset("basins", scene, points, work, (out, replace, threads, progress))
    words = data["attractor"].values
    numbers = np.array([int(word) if word.isdigit() else -1 for word in words.flat], dtype=np.int64)
    data["attractor"] = (data["attractor"].dims, numbers.reshape(words.shape))
    for measure in ("kind", "period_cycles", "word", "impacts", "fraction", "standard_error", "exponent"):
        values = [attractor[measure] for attractor in found["attractors"]]
        is_text = measure in ("kind", "word", "impacts")
        absent = "" if is_text else np.nan
        data[f"attractor_{measure}"] = ("number", np.array([absent if value is None else value for value in values]))
    for coordinate in () if scene.dimensionless else data.coords.values():
        coordinate.attrs["units"] = "m" if "/q/" in coordinate.attrs.get("pointer", "") else "m/s"
    data.attrs["attractors_json"] = json.dumps(found)
    return data


def _listed(columns: str | Sequence[str]) -> list[str]:
    return [columns] if isinstance(columns, str) else list(columns)


def _cycles(transient: int, further: int) -> tuple[int, int]:
    return whole("transient", transient, 1, 10**9), whole("further", further, 100, 10**6)


def _pointer(scene: Scene, key: str) -> str:
    return scene.pointer(key)


def _start(scene: Scene, key: str) -> str:
    """Return the pointer of a component of the start."""
    if key.startswith("/"):
        return key
    kind, _, name = key.partition(" ")
    if kind in ("q", "v") and not name and len(scene.freedoms) == 1:
        name = scene.freedoms[0]
    if kind not in ("q", "v") or name not in scene.freedoms:
        known = ", ".join(f"{kind} {name}" for kind in ("q", "v") for name in scene.freedoms)
        raise refuse(Fault(key, "no component of the start", known, "name one of them"))
    return f"/initial/{kind}/{name}"


def _points(scene: Scene, axes: Mapping[str, Axis], pointer: Callable[[Scene, str], str]) -> dict[str, tuple[str, str]]:
    """Return pointer and text form of each axis, by its key."""
    checked(scene)
    points, faults = {}, []
    for key, values in axes.items():
        try:
            name = pointer(scene, key)
            if not isinstance(values, str):
                array = np.atleast_1d(numbers(key, values, 1))
                if not len(array):
                    raise refuse(Fault(key, "no values", "one value at least", "write the values of the axis"))
                # Each number in the digits that read as the same double.
                values = ",".join([repr(value) for value in array.tolist()])
            if _repeats(values.split(",")):
                raise refuse(Fault(key, "a value twice", "different values", "leave one of them out"))
            points[key] = name, f"{name}={values}"
        except SceneError as error:
            faults += error.faults
    if faults:
        raise refuse(*faults)
    return points


def _repeats(values: list[str]) -> bool:
    try:
        return len({float(value) for value in values}) < len(values)
    except ValueError:
        return False


def _dataset(
    name: str,
    scene: Scene,
    points: dict[str, tuple[str, str]],
    work: Callable[[list[str], dict[str, Any]], Any],
    settings: tuple[str | os.PathLike[str] | None, bool, int | None, bool | Callable[[float], Any]],
    rows: int = 1,
) -> Any:
    """Do the work in its folder, and arrange its table."""
    import tempfile

    xarray = optional("xarray", f"flank.{name}")
    out, replace, threads, progress = settings
    threads = threads_or_none(threads)
    total = rows * math.prod(_count(text) for _, text in points.values())
    with tempfile.TemporaryDirectory(prefix="flank-") as scratch, bar(progress, "units", name, total) as report:
        folder = os.path.join(scratch, name) if out is None else os.fspath(out)
        grid = {"out": folder, "replace": replace, "threads": threads, "progress": report}
        table, interrupted = work([text for _, text in points.values()], grid)
    if interrupted is not None:
        kept = "" if out is None else f"; finished rows are kept in {folder}, and the same call goes on"
        raise Interrupted(f"interrupted{kept}") if isinstance(interrupted, Interrupted) else interrupted
    finish(progress)
    columns = {column: _values(values, words) for column, values, words in table}
    pointers = [pointer for pointer, _ in points.values()]
    keys = _names(list(points), pointers, {column.rpartition(" ")[2] for column in columns if column not in pointers})
    coordinates: dict[str, Any] = {}
    shape = []
    for key, pointer in zip(keys, pointers, strict=True):
        values = columns.pop(pointer)
        _, first = np.unique(values, return_index=True)
        axis = values[np.sort(first)]
        shape.append(len(axis))
        units = {} if scene.dimensionless else unit_of(pointer)
        coordinates[key] = (key, axis, {"pointer": pointer, **units})
    dimensions = list(keys)
    if "direction" in columns:
        directions = columns.pop("direction")
        seen = list(dict.fromkeys(directions.tolist()))
        if len(seen) > 1:
            dimensions.append("direction")
            shape.append(len(seen))
            coordinates["direction"] = seen
    data: dict[str, Any] = {}
    measures: dict[str, dict[str, npt.NDArray[Any]]] = {}
    for column, values in columns.items():
        owner, _, measure = column.rpartition(" ")
        arranged = values.reshape(shape)
        if owner:
            measures.setdefault(measure, {})[owner] = arranged
        else:
            data[column] = (dimensions, arranged, unit_of(column))
    for measure, of in measures.items():
        along = "bearing" if measure.startswith("bearing") else "contact"
        known = coordinates.setdefault(along, list(of))
        arrays = [of.get(owner, np.full(shape, np.nan)) for owner in known]
        data[measure] = ([*dimensions, along], np.stack(arrays, axis=-1), unit_of(measure))
    if failed := int(np.count_nonzero(columns["error"] != "")):
        warn(f"{failed} of {len(columns['error'])} points failed: the variable error has the reasons")
    scene._warn()
    attributes = {"scene": scene.name, "scene_sha256": scene.hash, "flank": _flank.__version__}
    return xarray.Dataset(data, coordinates, attributes)


def _count(text: str) -> int:
    """Return the number of values of an axis in text form, for the length of a bar; 1 for a text that will be refused."""
    values = text.rpartition("=")[2]
    parts = values.split(":")
    if len(parts) < 3:
        return values.count(",") + 1
    return int(parts[2]) if parts[2].isdigit() else 1


def _names(keys: list[str], pointers: list[str], taken: set[str]) -> list[str]:
    """Return names for the dimensions: the last keys of pointers if they differ and no variable has them, else the whole pointers."""
    # Numbers that move together have the values of the first.
    last = [next(part for part in reversed(key.split(",")[0].split("/")) if not part.isdigit()) for key in keys]
    if len(set(last)) == len(last) and not set(last) & taken:
        return last
    return [pointer.split(",")[0].strip("/").replace("/", " ") for pointer in pointers]


def _values(values: npt.NDArray[Any], words: list[str] | None) -> npt.NDArray[Any]:
    return values if words is None else np.array([*words, ""], dtype=np.str_)[values]
