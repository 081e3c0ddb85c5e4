"""Converts tables of any kind to the text of a CSV file."""

import math
import os
from collections.abc import Mapping, Sequence
from typing import Any, Protocol, cast, runtime_checkable

import numpy as np

from deflex import _deflex


@runtime_checkable
class Frame(Protocol):
    """A data frame: pandas, polars, or anything with columns and values by column."""

    @property
    def columns(self) -> Any:
        """Names of the columns."""
        ...

    def __getitem__(self, name: Any, /) -> Any: ...


Path = str | os.PathLike[str]
Table = Path | Mapping[str, Sequence[Any]] | Frame


def given(table: Table, name: str = "<table>") -> tuple[str, bytes]:
    """The name and the text of a CSV file.

    >>> given({"target": [1, 2], "x_mm": [0.1, None]})
    ('<table>', b'target,x_mm\\n1,0.1\\n2,\\n')
    """
    if isinstance(table, (str, os.PathLike)):
        return _deflex.read_table(table)
    names = list(table.keys() if isinstance(table, Mapping) else table.columns)
    columns = [_values(table[name]) for name in names]
    if len({len(column) for column in columns}) > 1:
        lengths = ", ".join(f"{name}: {len(column)}" for name, column in zip(names, columns))
        raise ValueError(f"columns differ in length: {lengths}")
    return name, _deflex.table_text([(str(name), column) for name, column in zip(names, columns)])


def _values(column: Any) -> Any:
    """The values of a column: an array of numbers, or the text of each field."""
    array = _numbers(column)
    if array is not None and array.ndim == 1:
        if array.dtype.kind == "f":
            return array.astype(np.float64)
        if array.dtype.kind in "iub" and np.can_cast(array.dtype, np.int64):
            return array.astype(np.int64)
    for to_list in ("tolist", "to_list"):
        if hasattr(column, to_list):
            column = getattr(column, to_list)()
    return [_field(value) for value in column]


def _numbers(column: Any) -> Any:
    if hasattr(column, "__array__"):
        return np.asarray(column)
    if not isinstance(column, (list, tuple)):
        return None
    values = cast(Sequence[object], column)
    kinds = {type(value) for value in values}
    # Of one kind alone: NumPy would convert numbers next to texts, and True to 1.0 next to floats.
    is_of_numbers = len(kinds) == 1 and issubclass(kinds.pop(), (bool, int, float, np.bool_, np.number))
    return np.asarray(values) if is_of_numbers else None


def _field(value: Any) -> str:
    if isinstance(value, str):
        return value
    if hasattr(value, "item"):
        value = value.item()
    if value is None or str(value) in ("nan", "<NA>", "NaT"):  # no figures, as NumPy and pandas write them
        return ""
    if isinstance(value, bool):
        return str(int(value))
    if isinstance(value, float):
        # Shortest digits that read back as the same number; a whole one without them, as ordinals are written.
        return str(int(value)) if value.is_integer() and math.fabs(value) < 2**53 else repr(value)
    return str(value)
