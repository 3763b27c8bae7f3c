"""Scenes: a train, its start and the settings of its run."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from . import _flank
from ._arguments import refuse, warn, whole_or_none
from ._errors import Fault, SceneError
from ._records import Record
from ._run import Run


def load(scene: str | os.PathLike[str] | Mapping[str, Any] | None = None, *, name: str = "scene") -> Scene:
    """Read a scene and check it.

    Parameters
    ----------
    scene : path or mapping, optional
        JSON file, or the same content as a dictionary; numbers of NumPy are allowed. The reference planetary set if left out.
    name : str
        Name of a dictionary in messages and results.

    Returns
    -------
    Scene

    Raises
    ------
    SceneError
        With every fault, each with the JSON pointer of its place.

    Examples
    --------
    >>> import flank
    >>> ball = flank.load({
    ...     "flank": 1,
    ...     "train": {
    ...         "kind": "wall", "mass_kg": 1, "load_n": -9.81,
    ...         "wall": {"side": "below", "position_m": 0},
    ...         "law": {"kind": "rigid", "restitution": 0.8},
    ...     },
    ...     "initial": {"q": [1]},
    ...     "run": {"t_end_s": 5},
    ... })
    >>> ball.run().events["t_s"][0] == (2 / 9.81) ** 0.5
    np.True_
    """
    if scene is None:
        return Scene(_flank.Scene.reference())
    if isinstance(scene, Mapping):
        return Scene(_flank.Scene.from_json(_json(scene), name))
    if isinstance(scene, (str, bytes, os.PathLike)):
        return Scene(_flank.Scene.from_file(os.fspath(scene)))
    raise refuse(
        Fault("scene", f"{repr(scene)[:80]} of type {type(scene).__name__}", "a path or a mapping", "read a file, or a dictionary")
    )


def schema() -> dict[str, Any]:
    """Return the JSON Schema (draft 2020-12) of scenes."""
    return dict(json.loads(_flank.schema()))


def _json(value: Any, place: str = "") -> str:
    """Write a value as JSON; numbers and arrays of NumPy are written as numbers and lists."""
    return json.dumps(_plain(value, place))


def _plain(value: Any, place: str) -> Any:
    """Return a value of the types of JSON, or refuse it with its place, a JSON pointer."""
    if isinstance(value, (np.generic, np.ndarray)):
        value = value.tolist()
    if isinstance(value, Mapping):
        return {str(key): _plain(item, f"{place}/{key}") for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item, f"{place}/{i}") for i, item in enumerate(value)]
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if isinstance(value, float) and not math.isfinite(value):
        raise refuse(Fault(place, repr(value), "a finite number", "write a finite number"))
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    found = f"{value!r} of type {type(value).__name__}"
    raise refuse(Fault(place, found, "numbers, texts, lists and dictionaries", "convert it"))


def checked(scene: Any) -> Scene:
    """Return a scene, or refuse what is none."""
    if isinstance(scene, Scene):
        return scene
    raise refuse(Fault("scene", repr(scene)[:80], "a flank.Scene", "read it by flank.load"))


class Scene:
    """Scene that has been read and checked; it never changes.

    Scenes come from :func:`load`, :meth:`with_` and :class:`Matrices`.
    """

    __slots__ = ("_core",)

    def __init__(self, core: _flank.Scene) -> None:
        self._core = core

    @property
    def name(self) -> str:
        """File of the scene, or its given name."""
        return self._core.name

    @property
    def hash(self) -> str:
        """SHA-256 of the scene with all defaults, without name and note, hexadecimal."""
        return self._core.hash

    @property
    def freedoms(self) -> list[str]:
        """Names of the degrees of freedom, ``[n]``."""
        return self._core.freedoms

    @property
    def contacts(self) -> list[str]:
        """Names of the contacts, such as the meshes."""
        return self._core.contacts

    @property
    def components(self) -> list[str]:
        """Names of the components of a state: coordinates, velocities, latched speeds."""
        return self._core.components()

    @property
    def dimensionless(self) -> bool:
        """True if the train is in dimensionless form; else its numbers are in SI units."""
        return self._core.dimensionless

    @property
    def given(self) -> dict[str, Any]:
        """The scene as it was given."""
        return dict(json.loads(self._core.given()))

    @property
    def resolved(self) -> dict[str, Any]:
        """The scene with every default written out."""
        return dict(json.loads(self._core.resolved()))

    @property
    def warnings(self) -> list[str]:
        """Warnings about the train and its start."""
        return self._core.warnings()

    def check(self) -> Record:
        """Return the contents of the scene: freedoms, contacts, natural frequencies, the orders that excite them.

        Returns
        -------
        Record
            The content of ``flank check --json``.
        """
        return Record(json.loads(self._core.report()))

    def pointer(self, key: str) -> str:
        """Return the JSON pointer of the only place with this key, such as ``/train/speed_rpm`` for ``speed_rpm``.

        Raises
        ------
        SceneError
            If no place has the key, with the most similar one, or if several have it, with all of them.
        """
        if not isinstance(key, str):
            raise refuse(Fault(repr(key), f"a {type(key).__name__}", "a key or a JSON pointer, a text", ""))
        if "/" in key and not key.startswith("/"):
            raise refuse(Fault(key, "a pointer without its first /", "a JSON pointer", f"write {'/' + key!r}"))
        return self._core.pointer(key)

    def with_(self, values: Mapping[str, Any] | None = None, /, **keys: Any) -> Scene:
        """Return the same scene with other values.

        Parameters
        ----------
        values : mapping, optional
            Values by JSON pointer, such as ``{"/train/contacts/0/half_backlash_m": 1e-5}``, or by key.
        **keys
            Values by key, such as ``speed_rpm=1800``; a key must be at one place only.

        Returns
        -------
        Scene

        Raises
        ------
        SceneError
            For an unknown key, with a suggestion, or if the scene is invalid with these values.
        """
        changed: dict[str, str] = {}
        faults: list[Fault] = []
        for key, value in [*(values or {}).items(), *keys.items()]:
            try:
                pointer = self.pointer(key)
                if pointer in changed:
                    raise refuse(Fault(pointer, "two values", "one value", "give the number once, by key or by pointer"))
                changed[pointer] = _json(value, pointer)
            except SceneError as error:
                faults += error.faults
        if faults:
            raise refuse(*faults)
        return Scene(self._core.with_all(list(changed.items())))

    def run(
        self,
        *,
        log: bool = True,
        out: str | os.PathLike[str] | None = None,
        replace: bool = False,
        trajectory: bool = False,
        verify: bool = False,
        max_events: int | None = None,
        observer: Callable[[Record], bool | None] | None = None,
        progress: bool | Callable[[float], Any] = False,
        **keys: Any,
    ) -> Run:
        """Run the scene to its end. Other threads of Python go on meanwhile.

        Parameters
        ----------
        log : bool
            Keep the events, and write them; without them a long run takes neither memory nor disk space.
        out : path, optional
            Folder for the files of ``flank run --no-report``, which get the same bytes: ``events.jsonl``, ``events.csv``, ``summary.json``.
        replace : bool
            Replace the files of an earlier run in the folder ``out``.
        trajectory : bool
            Write ``trajectory.csv`` into the folder ``out`` too.
        verify : bool
            Check every event, and that there are no others, by two independent methods.
        max_events : int, optional
            End the run after this many events.
        observer : callable, optional
            Called with each instant of events as a :class:`Record`, the content of a line of ``events.jsonl``; ``False`` ends the run.
        progress : bool or callable
            Show a bar (with ``tqdm``), or call this with the share that is done, in [0, 1].
        **keys
            Values by key, as in :meth:`with_`, such as ``cycles=500``.

        Returns
        -------
        Run

        Raises
        ------
        SceneError
            If the scene cannot start with these values.
        Alarm
            If the numbers of the run contradict each other; its attribute ``run`` has the record.
        Interrupted
            After Ctrl-C; its attribute ``run`` has the record up to there.
        Error
            If the run fails otherwise.
        """
        if keys:
            return self.with_(keys).run(
                log=log, out=out, replace=replace, trajectory=trajectory, verify=verify, max_events=max_events,
                observer=observer, progress=progress,
            )  # fmt: skip
        for name, value in (("log", log), ("replace", replace), ("trajectory", trajectory), ("verify", verify)):
            if not isinstance(value, (bool, np.bool_)):
                raise refuse(Fault(name, repr(value), "True or False", ""))
        for name, value in (("replace", replace), ("trajectory", trajectory)):
            if value and out is None:
                raise refuse(Fault(name, "True without a folder", "True with out", "name a folder by out"))
        if observer is not None and not callable(observer):
            raise refuse(Fault("observer", repr(observer), "a callable of one argument", ""))
        return Run._of(
            self,
            {
                "log": bool(log),
                "out": None if out is None else os.fspath(out),
                "replace": bool(replace),
                "trajectory": bool(trajectory),
                "verify": bool(verify),
                "max_events": whole_or_none("max_events", max_events, 1, 2**63 - 1),
            },
            observer,
            progress,
        )

    def _warn(self) -> None:
        for text in self.warnings:
            warn(f"{self.name}: {text}")

    def __repr__(self) -> str:
        kind = self.resolved["train"]["kind"]
        return f"Scene({self.name!r}: {kind}, {len(self.freedoms)} freedoms, {len(self.contacts)} contacts)"

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Scene) and self.hash == other.hash

    def __hash__(self) -> int:
        return hash(self.hash)

    def __reduce__(self) -> Any:
        return _again, (self._core.given(), self.name)


def _again(text: str, name: str) -> Scene:
    return Scene(_flank.Scene.from_json(text, name))
