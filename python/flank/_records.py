"""Measures as records: mappings with attributes."""

from __future__ import annotations

import operator
from collections.abc import Iterator, Mapping
from typing import Any

WIDTH = 120
"""Longest text of a record on one line, characters."""


class Record(Mapping[str, Any]):
    """Mapping of names to values, which are attributes too.

    Nested mappings are records, and lists of mappings lists of records. The names are those of the files that the command writes. A name
    that a mapping has itself, such as ``values``, needs brackets: ``record["values"]``.
    """

    __slots__ = ("_values",)

    def __init__(self, values: Mapping[str, Any]) -> None:
        self._values = {name: _record(value) for name, value in values.items()}

    def __getitem__(self, name: str) -> Any:
        try:
            return self._values[name]
        except KeyError:
            raise KeyError(f"there is no {name!r}; there are {', '.join(map(repr, self._values))}") from None

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        try:
            return self._values[name]
        except KeyError:
            known = ", ".join(self._values)
            raise AttributeError(f"{type(self).__name__} has no {name!r}; it has {known}") from None

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self._values]

    def __repr__(self) -> str:
        items = [f"{name}={value!r}" for name, value in self._values.items()]
        text = f"{type(self).__name__}({', '.join(items)})"
        if len(text) <= WIDTH:
            return text
        lines = "".join(f"\n    {item}," for item in (item.replace("\n", "\n    ") for item in items))
        return f"{type(self).__name__}({lines}\n)"

    def to_dict(self) -> dict[str, Any]:
        """Return the values as plain dictionaries and lists."""
        return {name: _plain(value) for name, value in self._values.items()}

    def __reduce__(self) -> Any:
        return type(self), (self.to_dict(),)


class Named(Mapping[str, Record]):
    """Records by name, in the order of the train; a number stands for a place in that order."""

    __slots__ = ("_records",)

    def __init__(self, records: list[Mapping[str, Any]]) -> None:
        self._records = {record["name"]: Record(record) for record in records}

    def __getitem__(self, name: str | int) -> Record:
        if not isinstance(name, str) and -len(self) <= operator.index(name) < len(self):
            return list(self._records.values())[name]
        try:
            return self._records[str(name)]
        except KeyError:
            known = ", ".join(map(repr, self._records))
            raise KeyError(f"there is no {name!r}; there are {known}") from None

    def __getattr__(self, name: str) -> Record:
        if name.startswith("_"):
            raise AttributeError(name)
        try:
            return self._records[name]
        except KeyError:
            known = ", ".join(map(repr, self._records))
            raise AttributeError(f"{type(self).__name__} has no {name!r}; it has {known}") from None

    def __reduce__(self) -> Any:
        return type(self), ([record.to_dict() for record in self._records.values()],)

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *(name for name in self._records if name.isidentifier())]

    def __iter__(self) -> Iterator[str]:
        return iter(self._records)

    def __len__(self) -> int:
        return len(self._records)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(map(repr, self._records))})"

    def to_pandas(self) -> Any:
        """Return a row for each record and a column for each measure, as a ``pandas.DataFrame``."""
        pandas = optional("pandas", "a data frame")
        rows = [record.to_dict() for record in self._records.values()]
        return pandas.DataFrame(rows, columns=None if rows else ["name"]).set_index("name")


def _record(value: Any) -> Any:
    if isinstance(value, Mapping) and not isinstance(value, Record):
        return Record(value)
    return [_record(item) for item in value] if isinstance(value, list) else value


def _plain(value: Any) -> Any:
    if isinstance(value, Record):
        return value.to_dict()
    return [_plain(item) for item in value] if isinstance(value, list) else value


def optional(module: str, wanted: str) -> Any:
    """Import a package that Flank does not require, or say what to install."""
    import importlib

    try:
        return importlib.import_module(module)
    except ImportError as error:
        root = module.split(".", maxsplit=1)[0]
        raise ImportError(f"{wanted} needs {root}: pip install {root}, or pip install 'flank[all]'") from error
