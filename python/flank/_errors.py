"""Errors and warnings of the package."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from ._run import Run


class Error(Exception):
    """Error of any work of Flank.

    Attributes
    ----------
    run : Run or None
        Record of a failed run up to its end.
    """

    run: Run | None = None

    def __reduce__(self) -> Any:
        # A run belongs to its process.
        return type(self), self.args, {name: value for name, value in vars(self).items() if name != "run"}


class Fault(NamedTuple):
    """Fault of a scene or of an argument."""

    pointer: str
    """Place: a JSON pointer of the scene, or the name of an argument."""
    found: str
    """Value or fact found there."""
    allowed: str
    """Values or facts allowed there."""
    remedy: str
    """Remedy; empty if none is known."""


class SceneError(Error, ValueError):
    """Scene, or arguments of a function, that cannot be used.

    Attributes
    ----------
    faults : list of Fault
        All faults, each with its place.
    """

    faults: list[Fault]

    def __init__(self, message: str, faults: Sequence[tuple[str, str, str, str]] = ()) -> None:
        super().__init__(message)
        self.faults = [Fault(*fault) for fault in faults]


class Alarm(Error):
    """Run whose numbers contradict each other; they must not be used."""


class Interrupted(Error, KeyboardInterrupt):
    """Work that Ctrl-C ended. Finished rows of a folder are kept."""


class SceneWarning(UserWarning):
    """Warning about a scene or a run."""
