"""Events of a run, kept as columns."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from decimal import Decimal
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _flank
from ._records import optional


class Events(Mapping[str, npt.NDArray[Any]]):
    """Events of a run, one row for each contact of each instant.

    A mapping of column names to arrays of one length. Names and units are those of ``events.csv``: ``index``, ``cycle``, ``phase_s``,
    ``t_s``, ``uncertainty_s``, ``contact``, ``kind``, ``from``, ``to``, ``deflection_m``, ``velocity_m_per_s``, ``approach_m_per_s``,
    ``release_m_per_s``, ``duration_s``, ``peak_force_n``, ``impulse_n_s``, ``energy_lost_j``, ``restitution``. A dimensionless scene has
    names without units. Numbers that an event does not have are NaN in arrays and null in Arrow.

    Data frames of other packages read it without copies, by the Arrow PyCapsule protocol.
    """

    __slots__ = ("_array", "_core")

    def __init__(self, core: _flank.Events) -> None:
        self._core = core
        self._array: npt.NDArray[Any] | None = None

    def __getitem__(self, name: str) -> npt.NDArray[Any]:
        try:
            values, words = self._core.column(name)
        except KeyError:
            raise KeyError(f"there is no column {name!r}; there are {', '.join(self)}") from None
        return values if words is None else np.asarray(words, dtype=np.str_)[values] if words else values.astype(np.str_)

    def __iter__(self) -> Iterator[str]:
        return iter(self._core.names())

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self._core)

    def __repr__(self) -> str:
        return f"Events({len(self)} rows: {', '.join(self)})"

    def __arrow_c_stream__(self, requested_schema: object | None = None) -> object:
        """Return the columns as an Arrow stream."""
        return self._core.__arrow_c_stream__(requested_schema)

    @property
    def array(self) -> npt.NDArray[Any]:
        """Structured array, ``[rows]``, with a field for each column; made on first use."""
        if self._array is None:
            columns = {name: self[name] for name in self}
            array = np.empty(len(self), dtype=[(name, column.dtype) for name, column in columns.items()])
            for name, column in columns.items():
                array[name] = column
            self._array = array
        return self._array

    def exact_times(self) -> list[Decimal]:
        """Return the times in 32 digits, s (without unit for a dimensionless scene), ``[rows]``."""
        return [Decimal(text) for text in self._core.exact_times()]

    def to_pandas(self) -> Any:
        """Return a ``pandas.DataFrame``; names are categories."""
        pandas = optional("pandas", "a data frame")
        columns = {}
        for name in self:
            values, words = self._core.column(name)
            columns[name] = values if words is None else pandas.Categorical.from_codes(values, categories=words)
        return pandas.DataFrame(columns, copy=False)

    def to_polars(self) -> Any:
        """Return a ``polars.DataFrame``."""
        polars = optional("polars", "a data frame")
        # Of the mapping polars would take the arrays, in which absent numbers are NaN.
        return polars.DataFrame(_Stream(self._core))

    def __reduce__(self) -> Any:
        raise TypeError("Events cannot be pickled: keep events.to_pandas() or events.array")


class _Stream:
    """Columns as an Arrow stream, and nothing else."""

    __slots__ = ("_core",)

    def __init__(self, core: _flank.Events) -> None:
        self._core = core

    def __arrow_c_stream__(self, requested_schema: object | None = None) -> object:
        return self._core.__arrow_c_stream__(requested_schema)
