"""Converts tables of any kind to the text of a CSV file."""

import csv
import io
import math
import os
from collections.abc import Mapping, Sequence
from typing import Any, Protocol, runtime_checkable

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
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(names)
    writer.writerows(zip(*([_field(value) for value in column] for column in columns)))
    return name, text.getvalue().encode()


def _values(column: Any) -> list[Any]:
    for to_list in ("tolist", "to_list"):
        if hasattr(column, to_list):
            return list(getattr(column, to_list)())
    return list(column)


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
