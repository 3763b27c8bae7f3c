"""Checks of arguments: all faults name their place, the value, the allowed range and a remedy."""

from __future__ import annotations

import operator
import os
import sys
import warnings
from numbers import Real
from typing import Any

import numpy as np
import numpy.typing as npt

from ._errors import Fault, SceneError, SceneWarning


def refuse(*faults: Fault) -> SceneError:
    """Return the error of arguments that cannot be used."""
    texts = []
    for fault in faults:
        remedy = f"\n    remedy:  {fault.remedy}" if fault.remedy else ""
        texts.append(f"\n  at {fault.pointer}\n    found:   {fault.found}\n    allowed: {fault.allowed}{remedy}")
    return SceneError(f"the arguments cannot be used{''.join(texts)}", faults)


def whole(name: str, value: Any, least: int, most: int) -> int:
    """Return a whole number in a range."""
    try:
        number = operator.index(value)
    except TypeError:
        number = least - 1
    if isinstance(value, bool) or not least <= number <= most:
        raise refuse(Fault(name, repr(value), f"a whole number from {least} to {most}", "write a number in this range"))
    return number


def whole_or_none(name: str, value: Any, least: int, most: int) -> int | None:
    """Return a whole number in a range, or None."""
    return None if value is None else whole(name, value, least, most)


def number_or_none(name: str, value: Any, least: float, most: float) -> float | None:
    """Return a number in a range, or None."""
    if value is None:
        return None
    is_real = isinstance(value, Real) and not isinstance(value, bool)
    if not (is_real and least <= float(value) <= most):
        raise refuse(Fault(name, repr(value), f"a number from {least:g} to {most:g}", "write a number in this range"))
    return float(value)


def threads_or_none(value: Any) -> int | None:
    """Return a number of threads, or None for as many as there are cores."""
    return whole_or_none("threads", value, 1, 1024)


def numbers(name: str, values: Any, dimensions: int) -> npt.NDArray[np.float64]:
    """Return finite numbers as an array."""
    allowed = f"finite numbers in an array of {dimensions} {'dimension' if dimensions == 1 else 'dimensions'}"
    try:
        if np.iscomplexobj(values):
            raise TypeError
        array = np.ascontiguousarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise refuse(Fault(name, repr(values)[:80], allowed, "")) from None
    if array.ndim < dimensions:
        array = array.reshape((1,) * (dimensions - array.ndim) + array.shape)
    if array.ndim != dimensions:
        raise refuse(Fault(name, f"an array of {array.ndim} dimensions", allowed, ""))
    if not np.isfinite(array).all():
        place = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        raise refuse(Fault(name, f"{array[place]} at {place if len(place) > 1 else place[0]}", allowed, ""))
    return array


def ends(name: str, value: Any) -> tuple[float, float]:
    """Return the ends of a range."""
    fault = Fault(name, repr(value), "the two ends of a range, different and finite, such as (400, 6000)", "")
    try:
        first, last = (float(end) for end in value)
    except (TypeError, ValueError):
        raise refuse(fault) from None
    if not np.isfinite([first, last]).all() or first == last:
        raise refuse(fault)
    return first, last


def warn(text: str) -> None:
    """Warn at the line of the user that called the package."""
    level, frame = 1, sys._getframe()
    while frame.f_back is not None and os.path.dirname(frame.f_code.co_filename) == os.path.dirname(__file__):
        level, frame = level + 1, frame.f_back
    warnings.warn(text, SceneWarning, stacklevel=level)
