"""Trains given as matrices."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from ._scene import Scene, load


class Matrices(Scene):
    """Scene of a linear structure ``M q'' + C q' + K q = f(t)`` with contacts, in any consistent set of units.

    Parameters
    ----------
    M : array_like or sparse array
        Mass matrix, ``[n][n]``, symmetric and positive definite, or its diagonal, ``[n]``.
    C, K : array_like or sparse array, optional
        Damping matrix, and stiffness matrix of everything but the contacts; zero if left out.
    contacts : sequence of mapping
        Contacts, as in a scene: ``name``, ``direction`` (``[n]``), ``half_backlash_m``, ``law`` and so on.
    load : array_like, optional
        Constant load, ``[n]``.
    load_harmonics : sequence of mapping
        Harmonic loads, as in a scene: ``vector_n``, ``frequency_rad_per_s``, ``phase_rad``.
    freedoms : sequence of str, optional
        Names of the degrees of freedom.
    initial : mapping or str
        Start, as in a scene: ``{"q": …, "v": …}`` or ``"static"``.
    run : mapping
        Settings of the run, as in a scene: ``cycles``, ``transient_cycles`` or ``t_end_s``.
    name : str
        Name in messages and results.
    **train
        Further keys of a train of kind ``matrices``, such as ``base_frequency_rad_per_s``.

    Raises
    ------
    SceneError
        With every fault, as for any scene.

    Examples
    --------
    >>> import flank
    >>> scene = flank.Matrices(
    ...     [1.0], contacts=[{
    ...         "name": "wall", "direction": [1.0], "half_backlash_m": 0.1,
    ...         "law": {"kind": "rigid", "restitution": 0.5},
    ...     }],
    ...     load=[1.0], run={"t_end_s": 0.5},
    ... )
    >>> scene.freedoms
    ['q1']
    """

    __slots__ = ()

    def __init__(
        self,
        M: Any,
        C: Any = None,
        K: Any = None,
        *,
        contacts: Sequence[Mapping[str, Any]] = (),
        load: npt.ArrayLike | None = None,
        load_harmonics: Sequence[Mapping[str, Any]] = (),
        freedoms: Sequence[str] | None = None,
        initial: Mapping[str, Any] | str | None = None,
        run: Mapping[str, Any],
        name: str = "matrices",
        **train: Any,
    ) -> None:
        parts = {
            "mass_kg": _dense(M),
            "damping_n_s_per_m": _dense(C),
            "stiffness_n_per_m": _dense(K),
            "load_n": _dense(load),
            "load_harmonics": list(load_harmonics) or None,
            "contacts": list(contacts),
            "freedoms": None if freedoms is None else list(freedoms),
            **train,
        }
        given = {key: value for key, value in parts.items() if value is not None}
        scene: dict[str, Any] = {"flank": 1, "train": {"kind": "matrices", **given}, "run": run}
        if initial is not None:
            scene["initial"] = initial
        super().__init__(_read(scene, name)._core)


def _read(scene: dict[str, Any], name: str) -> Scene:
    return load(scene, name=name)


def _dense(matrix: Any) -> npt.NDArray[Any] | None:
    return None if matrix is None else np.asarray(matrix.toarray() if hasattr(matrix, "toarray") else matrix)
