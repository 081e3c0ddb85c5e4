"""The whole blind table: `table.py [-o FOLDER] [--seeds N] [--first N] [--planned N]`.

Builds deflex, makes the cells of generate.py (designed and plain), of shop.py (as shops have them) and planned ones of 24, 48 and 96 rows, and
has each answered by the example `blind_table`, which prints a line a cell and the totals. Needs requirements.txt.
"""

import argparse
import pathlib
import subprocess
import sys

from shop import CASES

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=pathlib.Path, default=ROOT / "target" / "table")
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--first", type=int, default=0, help="number of the first seed: others than those that rules were tuned on")
    parser.add_argument("--planned", type=int, default=20, help="planned cells of each number of rows")
    a = parser.parse_args()
    subprocess.run(["cargo", "build", "--release", "--bin", "deflex", "--example", "blind_table"], cwd=ROOT, check=True)
    release, first = ROOT / "target" / "release", ["--first", str(a.first)]
    by_deflex = [kind for kind, case in CASES.items() if case["plan"] == "planned"]

    def kinds(some):
        return ["--kinds", ",".join(some), "--deflex", str(release / "deflex")]

    parts = {
        "blind": ["generate.py", "--seeds", str(a.seeds)],
        "shop": ["shop.py", "--seeds", str(a.seeds), *kinds(kind for kind in CASES if kind not in by_deflex)],
        "planned": ["shop.py", "--seeds", str(a.planned), *kinds(by_deflex)],
    }
    for name, (script, *options) in parts.items():
        folder = a.output / name
        folder.mkdir(parents=True, exist_ok=True)
        subprocess.run([sys.executable, HERE / script, "-o", folder, *first, *options], check=True)
        print(f"\n== {folder}", flush=True)
        subprocess.run([release / "examples" / "blind_table", folder], check=True)


if __name__ == "__main__":
    main()
