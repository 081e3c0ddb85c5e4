"""Which effect does the cell lack? From a frame of measured columns to the extended cell."""

import csv
from pathlib import Path

import deflex

SAMPLES = Path(__file__).resolve().parents[2] / "samples/closed-loop"

# Any object with columns will do: a data frame of pandas or polars, or a dict as here.
with open(SAMPLES / "measured.csv", newline="") as file:
    rows = list(csv.DictReader(file))
measured = {name: [row[name] for row in rows] for name in rows[0]}

found = deflex.identify(runs=[(SAMPLES / "part.mod", measured)], cell=SAMPLES / "cell.toml")
print(found)
for effect in found.added:
    print(effect.kind, [parameter.value for parameter in effect.parameters])
print(f"{found.before.rms_mm:.4f} mm before, {found.after.rms_mm:.4f} mm after, on rows that no fit has seen")
print(f"{len(found.cell.to_toml().splitlines())} lines of cell file")
