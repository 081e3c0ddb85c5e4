"""Judges `deflex identify` on cells of the truer plant: `judge.py [-o FOLDER] [--seeds N] [--first N] [--kinds kitchen,most,…]`.

Makes the cells (truer/cells.py), identifies each, and compares with where the plant takes the measured program and another one, without noise:
the declared cell, the extended cell, a ridge regression over every effect's columns, and a Gaussian process. On the first `--least` cells of each
kind it computes the least error that a method can expect. Prints Markdown and writes judge.json. `--again` takes the cells that are there. It needs
numpy, and deflex and the example effect_columns built.
"""

import argparse
import csv
import datetime
import functools
import json
import multiprocessing
import os
import pathlib
import subprocess
import sys
import time

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent
sys.path.insert(0, str(HERE / "truer"))

import numpy as np

import cells
import rivals

MODELS = {"declared": "declared cell", "deflex": "deflex", "ridge": "ridge", "process": "Gaussian process", "least": "least possible"}
PLACES = {"part": "measured program", "transfer": "other program"}
NAMED = 0.9
# An error counts as larger than another from this on: what rounding and the last rows' noise do.
SLACK = 1.02


def predicted(deflex, folder, cell, stem):
    """Positions (mm) and standard uncertainties (mm, NaN where none are said) that a cell predicts for a program under its measured forces."""
    report = cell.with_suffix(f".{stem}.csv")
    measured = "measured.csv" if stem == "part" else "transfer_measured.csv"
    subprocess.run([deflex, "predict", folder / f"{stem}.mod", "--cell", cell, "--forces", folder / measured, "--report", report, "--quiet"],
                   check=True, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    with open(report, newline="") as f:
        lines = list(csv.DictReader(f))
    position = np.array([[float(r[f"{a}_mm"]) + float(r[f"error_{a}_mm"]) for a in "xyz"] for r in lines])
    return position, np.array([float(r["sigma_mm"] or "nan") for r in lines])


def identified(deflex, folder, measured, cell, limit_s):
    """Runs identify; the answer and its seconds, or None where it was refused or took too long."""
    out = cell.with_suffix(".json")
    start = time.monotonic()
    try:
        done = subprocess.run([deflex, "identify", "--run", folder / "part.mod", measured, "--cell", folder / "cell.toml", "-o", cell, "--json", out, "--quiet"],
                              stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, timeout=limit_s)
    except subprocess.TimeoutExpired:
        return None, f"no answer in {limit_s} s"
    if done.returncode:
        return None, done.stderr.decode().strip().splitlines()[0]
    return json.loads(out.read_text()), time.monotonic() - start


def halved(folder):
    """Every second row of the measured file."""
    lines = (folder / "measured.csv").read_text().splitlines()
    half = folder / "measured_half.csv"
    half.write_text("\n".join([lines[0], *lines[1::2], ""]))
    return half


def names(found):
    """What is named, with its probability: the marginal one where the answer has it."""
    if "effects" in found:
        return [(e["kind"], e["probability"]) for e in found["effects"] if e["kind"] != "empirical"]
    return [(e["kind"], e["posterior"]) for e in found["added"] if e["kind"] != "empirical" and not e["not_told_apart_from"]]


def judged(options, folder):
    truth = json.loads((folder / "truth.json").read_text())
    exact = {"part": rivals.rows(folder / "exact.csv")[0], "transfer": rivals.rows(folder / "transfer_exact.csv")[0]}
    measured, force, _ = rivals.rows(folder / "measured.csv")
    forces = force, rivals.rows(folder / "transfer_measured.csv")[1]
    row = {"case": f"{folder.parent.name}/{folder.name}", "kind": folder.parent.name, "errors": {}, "names": [], "covered": {}, "notes": []}

    def note(model, positions):
        row["errors"][model] = {name: cells.rms(p - exact[name]) for name, p in zip(PLACES, positions)}

    scratch = folder / "judge"
    scratch.mkdir(exist_ok=True)
    tables = [scratch / "part.columns", scratch / "transfer.columns"]
    subprocess.run([options.columns, folder / "cell.toml", folder / "part.mod", folder / "measured.csv", tables[0],
                    folder / "transfer.mod", folder / "transfer_measured.csv", tables[1]], check=True, stdout=subprocess.DEVNULL)
    part, other = (rivals.read(t) for t in tables)
    for t in tables:
        t.unlink()
    declared = part["declared"], other["declared"]
    note("declared", declared)
    off = measured - part["declared"]
    note("ridge", [d + p for d, p in zip(declared, rivals.ridge(part, other, off, force))])
    note("process", [d + p for d, p in zip(declared, rivals.process(part, other, off, forces))])
    if int(folder.name) - options.first < options.least:
        row["errors"]["least"] = dict(zip(PLACES, rivals.least_errors(folder)))
    if options.limit_s > 0:
        cell = scratch / "all.toml"
        found, seconds = identified(options.deflex, folder, folder / "measured.csv", cell, options.limit_s)
        if found is None:
            row["notes"].append(str(seconds))
            row["errors"]["deflex"] = row["errors"]["declared"]
        else:
            row["seconds"] = seconds
            row["said"] = {k: found[k] for k in ("transfer_sigma_mm", "after_other_places") if k in found} | {"after": found["after"]["rms_mm"]}
            answers = [predicted(options.deflex, folder, cell, name) for name in PLACES]
            note("deflex", [a[0] for a in answers])
            for (name, what), (position, sigma) in zip(PLACES.items(), answers):
                known = ~np.isnan(sigma)
                ratio = np.abs(position - exact[name])[known] / sigma[known, None]
                row["covered"][name] = [[int(np.sum(ratio <= q)) for q in (1.0, 2.0, 3.0)], int(ratio.size)]
            there = {e["kind"] for e in truth["effect"]}
            row["names"] = [(kind, p, kind in there) for kind, p in names(found)]
            if options.halves:
                half = scratch / "half.toml"
                again, why = identified(options.deflex, folder, halved(folder), half, options.limit_s)
                if again is None:
                    row["notes"].append(f"half of the rows: {why}")
                else:
                    note("half", [predicted(options.deflex, folder, half, name)[0] for name in PLACES])
    said = "  ".join(f"{m} {e['part']:.4f} {e['transfer']:.4f}" for m, e in row["errors"].items())
    print(f"{row['case']:<14} {said}  {'; '.join(row['notes'])}", flush=True)
    return row


def geometric(values):
    return float(np.exp(np.mean(np.log(np.maximum(values, 1e-6))))) if len(values) else float("nan")


def table(rows):
    """The figures of a group of cells as Markdown."""
    models = [m for m in MODELS if any(m in r["errors"] for r in rows)]
    out = ["| mm rms, geometric mean | " + " | ".join(MODELS[m] for m in models) + " |", "|---" * (len(models) + 1) + "|"]
    at = lambda m, place: np.array([r["errors"][m][place] for r in rows if m in r["errors"]])
    against = lambda m: np.array([r["errors"]["declared"]["transfer"] for r in rows if m in r["errors"]])
    for place, name in PLACES.items():
        out.append(f"| {name} | " + " | ".join(f"{geometric(at(m, place)):.3f}" for m in models) + " |")
    counts = {
        "other program at most a fifth of declared": lambda m: np.sum(at(m, "transfer") <= against(m) / 5),
        "other program no better than 0.8 × declared": lambda m: np.sum(at(m, "transfer") > 0.8 * against(m)),
        "worse than declared": lambda m: np.sum(at(m, "transfer") > SLACK * against(m)),
        "measured program within 0.02 mm": lambda m: np.sum(at(m, "part") <= 0.02),
    }
    for name, count in counts.items():
        out.append(f"| {name} | " + " | ".join("" if m == "declared" else f"{count(m)} of {len(at(m, 'part'))}" for m in models) + " |")
    halves = [r["errors"] for r in rows if "half" in r["errors"]]
    out.append("")
    if halves:
        more = [place for place in PLACES for e in halves if e["deflex"][place] > 1.1 * e["half"][place]]
        ratio = {place: geometric([e["deflex"][place] / e["half"][place] for e in halves]) for place in PLACES}
        out.append(f"All rows against every second one, {len(halves)} cells: error × {ratio['part']:.2f} (measured), × {ratio['transfer']:.2f} (other); "
                   f"more than 1.1 times in {more.count('part')} and {more.count('transfer')}.")
    said = [n for r in rows for n in r["names"]]
    for low, high in ((0.5, NAMED), (NAMED, 0.99), (0.99, 1.01)):
        of = [right for _, p, right in said if low <= p < high]
        if of:
            out.append(f"Names from {low} to {min(high, 1.0)}: {sum(of)} of {len(of)} there.")
    for place, name in PLACES.items():
        of = [r["covered"][place] for r in rows if place in r["covered"] and r["covered"][place][1]]
        if of:
            shares = [100 * sum(c[0][i] for c in of) / sum(c[1] for c in of) for i in range(3)]
            out.append(f"`sigma_mm` holds the {name} within 1, 2, 3 of it in {shares[0]:.0f}, {shares[1]:.0f}, {shares[2]:.0f} %.")
    expected = [r["said"]["transfer_sigma_mm"] / (r["errors"]["deflex"]["transfer"] / np.sqrt(3)) for r in rows if r.get("said", {}).get("transfer_sigma_mm")]
    if expected:
        out.append(f"`transfer_sigma_mm` is {geometric(expected):.2f} times the error of an axis on the other program (geometric mean), from "
                   f"{min(expected):.2f} to {max(expected):.2f} times.")
    seconds = [r["seconds"] for r in rows if "seconds" in r]
    if seconds:
        out.append(f"An identification takes {np.median(seconds):.1f} s, {max(seconds):.1f} s at most.")
    late = sum(bool(r["notes"]) for r in rows)
    if late:
        out.append(f"{late} cell{'s' if late > 1 else ''} without an answer count{'' if late > 1 else 's'} as declared.")
    return "\n".join(out)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=pathlib.Path, default=ROOT / "target" / "judge")
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first", type=int, default=0, help="number of the first seed: others than those that rules were tuned on")
    parser.add_argument("--kinds", default="kitchen,most")
    parser.add_argument("--again", action="store_true", help="judge the cells that are there")
    parser.add_argument("--halves", action="store_true", help="identify from every second row too")
    parser.add_argument("--least", type=int, default=0, help="cells of each kind for which the least possible error is computed, half a minute each")
    parser.add_argument("--limit-s", type=float, default=120, help="after which an identification is given up; 0: the rivals alone")
    parser.add_argument("--deflex", type=pathlib.Path, default=ROOT / "target" / "release" / "deflex")
    parser.add_argument("--columns", type=pathlib.Path, default=ROOT / "target" / "release" / "examples" / "effect_columns")
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    a = parser.parse_args()
    kinds = ["kitchen", "most", *cells.ALONE] if a.kinds == "all" else a.kinds.split(",")
    jobs = [(a.output, kind, index) for kind in kinds for index in range(a.first, a.first + a.seeds)]
    with multiprocessing.Pool(a.jobs) as pool:
        if not a.again:
            pool.map(cells.case, jobs, chunksize=1)
        folders = [a.output / kind / f"{index:03}" for _, kind, index in jobs]
        rows = pool.map(functools.partial(judged, a), [f for f in folders if f.exists()], chunksize=1)
    (a.output / "judge.json").write_text(json.dumps(rows, indent=1) + "\n")
    print(f"\n{datetime.date.today()}: `judge.py {' '.join(sys.argv[1:])}`")
    for kind in kinds:
        of = [r for r in rows if r["kind"] == kind]
        if of:
            print(f"\n## {kind}, {len(of)} cells\n\n{table(of)}")


if __name__ == "__main__":
    main()
