#!/usr/bin/env python3
"""Runs deflex and the programs it is compared with in turn, prints ratios as Markdown, draws how cost grows.

  benches/compare.py [--anchors DIR] [--targets N] [--runs N]        a table on stdout
  benches/compare.py --figure docs/speed.svg [--largest N]           how time and memory grow
  benches/compare.py --memory [--targets N]                          peak memory by kind of program and command
  benches/compare.py --identification --rows 210000                  the same of an identification alone
  benches/compare.py --driven                                        what the driven path costs

--anchors (or ANCHORS in the environment) is a folder with the hand-written floor, built: target/release/pipeline_floor and
force_bench; --python an interpreter with the packages of its python_job.py, the same job in NumPy. What is not there is left
out. Times are wall seconds, median of the runs, which take turns; memory is the operating system's peak.
"""
import argparse
import csv
import math
import os
import pathlib
import random
import re
import shutil
import statistics
import subprocess
import sys
import tempfile
import time

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent
DEFLEX = ROOT / os.environ.get("CARGO_TARGET_DIR", "target") / "release/deflex"

HEAD = """MODULE Mill
  PERS tooldata tMill:=[TRUE,[[321.5,0,148.25],[0.70710678,0,0.70710678,0]],[38,[90,0,60],[1,0,0,0],0,0,0]];
  PERS wobjdata wPart:=[FALSE,TRUE,"",[[1600,-200,600],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
  PROC main()
"""
UNUSED = "[0,-1,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v50,z1,tMill\\WObj:=wPart;"
ROW = 1000  # targets of a row over the surface
ROUTINES = 50


def generate(path, targets):
    """A wavy surface in rows, inline targets of about 146 bytes."""
    rows = []
    for i in range(min(targets, ROW)):
        x = 0.3 * i
        half = 0.0436 + 0.5 * math.atan(0.3 * math.cos(0.02 * x))
        z = 40.0 + 15.0 * math.sin(0.02 * x)
        rows.append((f"    MoveL [[{x:.3f},", f",{z:.3f}],[0.00000000,{math.cos(half):.8f},0.00000000,{math.sin(half):.8f}],{UNUSED}\n"))
    with open(path, "w") as out:
        out.write(HEAD)
        for row in range(math.ceil(targets / ROW)):
            y = f"{0.02 * row:.3f}"
            some = rows[: targets - row * ROW]
            # Back and forth.
            out.writelines(a + y + b for a, b in (some if row % 2 == 0 else reversed(some)))
        out.write("  ENDPROC\nENDMODULE\n")


def generate_declared(path, targets):
    """The same targets, declared before the routine that moves to them."""
    generate(path, targets)
    pose = re.compile(r"    MoveL (\[\[.*\]\]),v50")
    with open(path) as inline, open(f"{path}.moves", "w") as moves, open(f"{path}.declared", "w") as out:
        count = 0
        for line in inline:
            found = pose.match(line)
            if found:
                count += 1
                out.write(f"  CONST robtarget p{count}:={found[1]};\n")
                moves.write(f"    MoveL p{count},v50{line[found.end():]}")
            elif "PROC" in line or line.startswith("ENDMODULE"):
                moves.write(line)
            else:
                out.write(line)
        moves.close()
        with open(f"{path}.moves") as rest:
            shutil.copyfileobj(rest, out)
    os.remove(f"{path}.moves")
    os.replace(f"{path}.declared", path)


def generate_routines(path, targets):
    """The same targets in 50 routines that main calls, main first."""
    generate(path, targets)
    each = math.ceil(targets / ROUTINES)
    with open(path) as inline, open(f"{path}.routines", "w") as out:
        count = 0
        for line in inline:
            if "PROC main" in line:
                out.write(line + "".join(f"    Path_{i};\n" for i in range(math.ceil(targets / each))) + "  ENDPROC\n")
            elif "MoveL" in line:
                if count % each == 0:
                    out.write(("  ENDPROC\n" if count else "") + f"  PROC Path_{count // each}()\n")
                out.write(line)
                count += 1
            else:
                out.write(line)
    os.replace(f"{path}.routines", path)


def generate_cl(path, targets):
    """The same surface as cutter locations: a point and the tool axis."""
    rows = []
    for i in range(min(targets, ROW)):
        x, tilt = 0.3 * i, math.atan(0.3 * math.cos(0.02 * 0.3 * i))
        z = 40.0 + 15.0 * math.sin(0.02 * x)
        rows.append((f"GOTO/{x:.4f},", f",{z:.4f},{-math.sin(tilt):.6f},0.000000,{math.cos(tilt):.6f}\n"))
    with open(path, "w") as out:
        out.write("UNITS/MM\nLOADTL/1\nSPINDL/6000,RPM,CLW\nFEDRAT/3000,MMPM\n")
        for row in range(math.ceil(targets / ROW)):
            y, some = f"{0.02 * row:.4f}", rows[: targets - row * ROW]
            out.writelines(a + y + b for a, b in (some if row % 2 == 0 else reversed(some)))
        out.write("FINI\n")


KINDS = (
    ("inline targets", "part.mod", generate),
    ("CL to RAPID", "part.cl", generate_cl),
    ("declared targets", "declared.mod", generate_declared),
    ("50 routines", "routines.mod", generate_routines),
)


def run(command, stdin=None, stdout=None, cwd=None):
    """Wall seconds, peak MiB. Through time(1): a child of this interpreter would begin with its peak."""
    with tempfile.NamedTemporaryFile("r") as note:
        start = time.perf_counter()
        timed = ["/usr/bin/time", "-f", "%M", "-o", note.name, *(str(c) for c in command)]
        process = subprocess.run(timed, stdin=stdin, stdout=stdout or subprocess.DEVNULL, stderr=subprocess.PIPE, cwd=cwd)
        seconds = time.perf_counter() - start
        if process.returncode:
            sys.exit(f"{timed}: exit {process.returncode}\n{process.stderr.decode()[:2000]}")
        return seconds, int(note.read().split()[-1]) / 1024


def in_turn(jobs, runs, outputs=()):
    """Median seconds and most memory of each job: one warm-up, then A B C, A B C, …, each into new files."""
    got = {name: [] for name in jobs}
    for turn in range(runs + 1):
        for name, job in jobs.items():
            for output in outputs:
                output.unlink(missing_ok=True)
            came = job()
            if turn or runs == 1:
                got[name].append(came)
    return {name: (statistics.median(t for t, _ in rows), max(m for _, m in rows)) for name, rows in got.items()}


def compensate(program, folder, threads, cell=HERE / "cell.toml"):
    outputs = ["-o", folder / "out.mod", "--report", folder / "out.csv"]
    return [DEFLEX, "compensate", program, "--cell", cell, *outputs, "--jobs", threads, "--quiet"]


def piped(program, folder, threads):
    with open(program) as from_, open(folder / "pipe.mod", "w") as to:
        return run([DEFLEX, "compensate", "-", "--cell", HERE / "cell.toml", "--jobs", threads, "--quiet"], from_, to)


def with_effects(folder):
    """The cell with what costs nothing that it does not use."""
    cell = folder / "effects.toml"
    cell.write_text((HERE / "cell.toml").read_text() + EFFECTS["gravity"] + EFFECTS["backlash"])
    return cell


EFFECTS = {
    "gravity": """
[[effect]]
kind = "gravity"
mass_kg = [0, 200, 150, 60, 30, 10]
first_moment_kg_m = [[0, 0, 0], [100, 0, 0], [30, 60, 0], [0, 0, 0], [0, 0, 0], [0, 0, 0]]
tool = true
""",
    "backlash": """
[[effect]]
kind = "backlash"
half_gap_rad = [1e-5, 2e-5, 2e-5, 3e-5, 3e-5, 5e-5]
""",
    "gear_harmonic": """
[[effect]]
kind = "gear_harmonic"
terms = [{ joint = 1, order = 1.0, cos_rad = 1e-5, sin_rad = 2e-5 }, { joint = 2, order = 2.0, cos_rad = 1e-5, sin_rad = 2e-5 }]
""",
    "tool_wear": """
[[effect]]
kind = "tool_wear"
per_m = 0.0001
""",
    "zero_offset": """
[[effect]]
kind = "zero_offset"
offset_rad = [1e-5, 2e-5, 1e-5, 2e-5, 1e-5, 2e-5]
""",
    "tool_frame": """
[[effect]]
kind = "tool_frame"
d_mm = [0.01, 0.02, 0.03]
d_rad = [1e-5, 1e-5, 1e-5]
""",
}


def table(args, folder):
    program = folder / "part.mod"
    generate(program, args.targets)
    jobs = {}
    anchors = pathlib.Path(args.anchors or "").resolve()
    floor = anchors / "target/release/pipeline_floor"
    if args.anchors and floor.exists():
        for threads in (1, 4):
            command = [floor, "job", program, folder / "floor.mod", folder / "floor.csv", threads, "e"]
            jobs[f"floor (explicit inverse, forward check), {threads} thr"] = lambda c=command: run(c)
    else:
        print("the floor is left out: no --anchors with target/release/pipeline_floor", file=sys.stderr)
    if args.anchors and args.python:
        # It keeps its force table there.
        (folder / "work/data").mkdir(parents=True)
        command = [args.python, anchors / "python_job.py", program, folder / "python.mod", folder / "python.csv"]
        jobs["Python and NumPy, 1 thr"] = lambda c=command: run(c, cwd=folder)
    for threads in (1, 4):
        jobs[f"deflex, {threads} thr"] = lambda t=threads: run(compensate(program, folder, t))
    jobs["deflex, gravity and backlash, 1 thr"] = lambda: run(compensate(program, folder, 1, with_effects(folder)))
    jobs["deflex, pipe to pipe, 4 thr"] = lambda: piped(program, folder, 4)
    for name, text, make in KINDS[1:]:
        make(folder / text, args.targets)
        for threads in (1, 4):
            command = compensate(folder / text, folder, threads)
            jobs[f"deflex, {name}, {threads} thr"] = lambda c=command: run(c)
    got = in_turn(jobs, args.runs, [folder / f"{name}.{end}" for name in ("out", "floor") for end in ("mod", "csv")])
    print(f"{args.targets:,} targets, {program.stat().st_size / 1e6:.0f} MB of RAPID, median of {args.runs} runs\n")
    print("| | ns a target | over the floor, same threads | peak MiB |\n|---|---|---|---|")
    for name, (seconds, memory) in got.items():
        floors = [s for other, (s, _) in got.items() if other.startswith("floor") and other.endswith(name[-5:])]
        ratio = f"{seconds / floors[0]:.2f}" if floors else "–"
        print(f"| {name} | {1e9 * seconds / args.targets:,.0f} | {ratio} | {memory:.0f} |")
    speed_up = got["deflex, 1 thr"][0] / got["deflex, 4 thr"][0]
    print(f"\nFour threads are {speed_up:.1f} times as fast as one.")
    if "Python and NumPy, 1 thr" in got:
        slower = [got["Python and NumPy, 1 thr"][0] / got[f"deflex, {threads} thr"][0] for threads in (1, 4)]
        print(f"The Python job takes {slower[0]:.0f} times as long as one thread, {slower[1]:.0f} times as long as four.")


def memory(args, folder):
    """Peak MiB of each command on each kind of program, report included, on 4 threads."""
    cell = ["--cell", HERE / "cell.toml", "--report", folder / "out.csv", "--jobs", 4, "--quiet"]
    print(f"{args.targets:,} targets, peak MiB on 4 threads\n")
    print("| | compensate | predict | check | check, against the original |\n|---|---|---|---|---|")
    for name, file, make in KINDS:
        program, out = folder / file, folder / "out.mod"
        make(program, args.targets)
        check = [DEFLEX, "check", "--max-error", 1, "--max-correction", 5, *cell]
        commands = (
            [DEFLEX, "compensate", program, "-o", out, *cell],
            [DEFLEX, "predict", program, *cell],
            [*check, program],
            [*check, out, "--against", program],
        )
        print(f"| {name} |", " | ".join(f"{run(command)[1]:.0f}" for command in commands), "|", flush=True)
        program.unlink()


PATH_LAW = """
[controller.path]
zone_share = 0.87
smoothing_s = [0.058, 0.058]
acceleration_mm_s2 = 8000.0
passing_acceleration_mm_s2 = 16000.0
corner_acceleration_mm_s2 = 4000.0
"""


def processor_time(command):
    """User and system time of one run, s."""
    with subprocess.Popen([str(c) for c in command], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as job:
        _, status, usage = os.wait4(job.pid, 0)
        job.returncode = os.waitstatus_to_exitcode(status)
    if job.returncode:
        sys.exit(f"{command} ended with {job.returncode}")
    return usage.ru_utime + usage.ru_stime


def driven(args, folder):
    """Processor time on one thread without and with the law of the driven path, the least of the runs."""
    surface, stock = folder / "surface.mod", ROOT / "samples/stock"
    generate(surface, 50_000)
    print("| run | without `[controller.path]` | with it | ratio |\n|---|---|---|---|")
    jobs = [("surface", surface, HERE / "cell.toml", command) for command in ("predict", "compensate")]
    jobs += [("samples/stock", stock / "part.mod", stock / "cell.toml", command) for command in ("predict", "compensate", "simulate")]
    for name, program, cell, command in jobs:
        with_law = folder / "with.toml"
        with_law.write_text(cell.read_text() + PATH_LAW)
        output = ["-o", folder / "out.mod"] if command == "compensate" else []
        report = [] if command == "simulate" else ["--report", folder / "out.csv"]
        least = [min(processor_time([DEFLEX, command, program, "--cell", c, *report, *output, "--jobs", 1, "--quiet"]) for _ in range(args.runs))
                 for c in (cell, with_law)]
        print(f"| `{command}`, {name} | {least[0]:.2f} s | {least[1]:.2f} s | {least[1] / least[0]:.2f} |", flush=True)


def figure(args, folder):
    """Panels of (x, seconds, MiB)."""
    panels = []
    kinds = {
        "RAPID, 1 thread": ("part.mod", generate, 1, args.largest),
        "RAPID, 4 threads": ("part.mod", generate, 4, args.largest),
        "CL to RAPID, 4 threads": ("part.cl", generate_cl, 4, args.largest),
        # An index of the declarations is held.
        "RAPID with declared targets, 4 threads": ("part.mod", generate_declared, 4, args.largest // 10),
    }
    for name, (file, make, threads, largest) in kinds.items():
        points, targets = [], 1000
        while targets <= largest:
            program = folder / file
            make(program, targets)
            # Short runs are at the mercy of their neighbours.
            job = lambda: run(compensate(program, folder, threads))
            seconds, memory = in_turn({name: job}, 3)[name] if targets <= 100_000 else job()
            points.append((targets, seconds, memory))
            print(f"{name}, {targets} targets: {seconds:.3f} s, {memory:.0f} MiB", file=sys.stderr)
            targets *= 10
        panels.append((f"targets: {name}", points, True))

    generate(folder / "part.mod", 100_000)
    points, cell = [], (HERE / "cell.toml").read_text()
    for count, kind in enumerate(["", *EFFECTS]):
        cell += EFFECTS.get(kind, "")
        (folder / "cell.toml").write_text(cell)
        points.append((count, *run(compensate(folder / "part.mod", folder, 1, folder / "cell.toml"))))
    panels.append(("effects besides springs and cut (10⁵ targets, 1 thread)", points, False))

    points = []
    for count in (1, 2, 4, 8, 16, 32):
        batch, out = folder / "batch", folder / "corrected"
        for old in (batch, out):
            shutil.rmtree(old, ignore_errors=True)
            old.mkdir()
        for i in range(count):
            generate(batch / f"part{i}.mod", 20_000)
            text = (batch / f"part{i}.mod").read_text()
            (batch / f"part{i}.mod").write_text(text.replace("MODULE Mill", f"MODULE Mill{i}", 1))
        inputs = sorted(batch.iterdir())
        outputs = ["--out-dir", out, "--report", folder / "batch.csv"]
        command = [DEFLEX, "compensate", *inputs, "--cell", HERE / "cell.toml", *outputs, "--jobs", 4, "--quiet"]
        points.append((count, *run(command)))
    panels.append(("programs in a batch (2·10⁴ targets each, 4 threads)", points, True))

    points = identification(args, folder)
    panels.append(("measured rows of an identification", points, True))
    pathlib.Path(args.figure).write_text(svg(panels))
    for name, points, _ in panels:
        print(name)
        for x, seconds, memory in points:
            print(f"  {x:>10,}  {seconds:8.3f} s  {memory:6.0f} MiB")


def identification(args, folder):
    """The closed-loop sample's program over and over; what a cell with its backlash would measure there, with fresh noise."""
    sample = ROOT / "samples/closed-loop"
    lines = (sample / "part.mod").read_text().splitlines(keepends=True)
    moves = [i for i, line in enumerate(lines) if line.lstrip().startswith("MoveL")]
    header, *rows = [line.split(",") for line in (sample / "measured.csv").read_text().splitlines()]
    force = header.index("fx_n")
    (folder / "true.toml").write_text(
        (sample / "cell.toml").read_text() + '\n[[effect]]\nkind = "backlash"\nhalf_gap_rad = [0, 6e-5, 0, 0, 1.6e-4, 0]\n'
    )
    noise = random.Random(6660)
    points = []
    for times in (t for t in (1, 3, 10, 30, 100, 658, 3289) if t * len(rows) <= args.rows):
        program, forces, measured = folder / "long.mod", folder / "forces.csv", folder / "long.csv"
        body = [lines[i] for i in moves] * times
        program.write_text("".join(lines[: moves[0]] + body + lines[moves[-1] + 1 :]))
        loads = [row[force : force + 3] for row in rows] * times
        forces.write_text("target,fx_n,fy_n,fz_n\n" + "".join(f"{i + 1},{','.join(f)}\n" for i, f in enumerate(loads)))
        run([DEFLEX, "predict", program, "--cell", folder / "true.toml", "--forces", forces, "--report", folder / "true.csv", "--quiet"])
        with open(measured, "w") as out, open(folder / "true.csv") as true:
            out.write("target,x_mm,y_mm,z_mm,fx_n,fy_n,fz_n\n")
            for row, load in zip(csv.DictReader(true), loads):
                place = [float(row[f"{k}_mm"]) + float(row[f"error_{k}_mm"]) + noise.gauss(0, 0.012) for k in "xyz"]
                out.write(",".join([row["target"], *(f"{x:.4f}" for x in place), *load]) + "\n")
        command = [DEFLEX, "identify", "--run", program, measured, "--cell", sample / "cell.toml", "--quiet"]
        points.append((len(loads), *run(command)))
        print(f"{points[-1][0]} rows: {points[-1][1]:.2f} s, {points[-1][2]:.0f} MiB", file=sys.stderr)
    return points


def svg(panels):
    """Time in blue, memory in orange; log-log where x is a size, so that a straight line of slope one is cost as work."""
    width, height, gap, left, columns = 300, 190, 110, 60, 4
    rows = math.ceil(len(panels) / columns)
    out = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{left + len(panels[:columns]) * (width + gap)}" height="{rows * (height + gap) + 20}" '
        'font-family="sans-serif" font-size="11">',
        '<rect width="100%" height="100%" fill="white"/>',
    ]
    for i, (name, points, logarithmic) in enumerate(panels):
        x0, y0 = left + (i % columns) * (width + gap), 30 + (i // columns) * (height + gap)
        out.append(f'<text x="{x0}" y="{y0 - 10}" font-weight="bold">{name}</text>')
        out.append(f'<rect x="{x0}" y="{y0}" width="{width}" height="{height}" fill="none" stroke="#888"/>')
        if not points:
            continue
        xs = [math.log10(p[0]) if logarithmic else p[0] for p in points]
        span = (xs[-1] - xs[0]) or 1
        for column, colour, unit, side in ((1, "#1f5fbf", "s", "start"), (2, "#d9770a", "MiB", "end")):
            ys = [math.log10(p[column]) for p in points]
            low, high = math.floor(min(ys)), math.ceil(max(ys) + 1e-9)
            high += high == low
            place = lambda x, y: (x0 + 12 + (width - 24) * (x - xs[0]) / span, y0 + height - height * (y - low) / (high - low))
            dots = [place(x, y) for x, y in zip(xs, ys)]
            out.append(f'<polyline fill="none" stroke="{colour}" stroke-width="1.5" points="{" ".join(f"{a:.1f},{b:.1f}" for a, b in dots)}"/>')
            out += [f'<circle cx="{a:.1f}" cy="{b:.1f}" r="3" fill="{colour}"/>' for a, b in dots]
            for tick in range(low, high + 1):
                y = place(0, tick)[1]
                x, anchor = (x0 - 4, "end") if side == "start" else (x0 + width + 4, "start")
                out.append(f'<text x="{x}" y="{y + 4:.1f}" text-anchor="{anchor}" fill="{colour}">{10.0 ** tick:g} {unit}</text>')
        for x, p in zip(xs, points):
            at = x0 + 12 + (width - 24) * (x - xs[0]) / span
            label = f"10{'⁰¹²³⁴⁵⁶⁷⁸'[round(math.log10(p[0]))]}" if logarithmic and p[0] >= 1000 and math.log10(p[0]).is_integer() else f"{p[0]:,}"
            out.append(f'<text x="{at:.1f}" y="{y0 + height + 15}" text-anchor="middle">{label}</text>')
    return "\n".join(out + ["</svg>", ""])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--anchors", default=os.environ.get("ANCHORS"))
    parser.add_argument("--python", help="interpreter with NumPy, SciPy and py-opw-kinematics")
    parser.add_argument("--targets", type=int, default=1_000_000)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--figure")
    parser.add_argument("--largest", type=int, default=10_000_000)
    parser.add_argument("--rows", type=int, default=10_000, help="most measured rows of an identification; 1000000 for the largest")
    parser.add_argument("--identification", action="store_true", help="only how an identification grows")
    parser.add_argument("--memory", action="store_true", help="only peak memory")
    parser.add_argument("--driven", action="store_true", help="only what the driven path costs")
    parser.add_argument("--generate", metavar="FILE", help="only write the program of --targets")
    args = parser.parse_args()
    if args.generate:
        return generate(args.generate, args.targets)
    if not os.access("/usr/bin/time", os.X_OK):
        sys.exit("/usr/bin/time is needed for the peak memory: apt-get install time")
    subprocess.run(["cargo", "build", "--release", "--quiet"], cwd=ROOT, check=True)
    with tempfile.TemporaryDirectory(dir=os.environ.get("DATA")) as folder:
        what = figure if args.figure else memory if args.memory else driven if args.driven else identification if args.identification else table
        what(args, pathlib.Path(folder))


if __name__ == "__main__":
    main()
