#!/usr/bin/env python3
"""Makes the programs of samples/slot, samples/blade, samples/units and samples/wall: `python3 samples/make_paths.py` (needs NumPy).

The slot is the paper's (Tang et al., Section 3) in the one pose that reproduces its Tables 3 and 5; the blade is a
patch of a propeller's pressure side, milled in zig-zag with 8 degrees of lead; on units a turntable carries a ring under the
tool, and a track the robot along a beam; the wall is milled out of a block and yields to the cutter.
"""
import os
import numpy as np

HERE = os.path.dirname(os.path.abspath(__file__))


def rot(axis, a):
    c, s = np.cos(a), np.sin(a)
    return np.array({"x": [[1, 0, 0], [0, c, -s], [0, s, c]], "y": [[c, 0, s], [0, 1, 0], [-s, 0, c]],
                     "z": [[c, -s, 0], [s, c, 0], [0, 0, 1]]}[axis])


def quat(r):
    w = np.sqrt(max(0, 1 + np.trace(r))) / 2
    if w > 1e-3:
        q = np.array([w, (r[2, 1] - r[1, 2]) / 4 / w, (r[0, 2] - r[2, 0]) / 4 / w, (r[1, 0] - r[0, 1]) / 4 / w])
    else:
        vals, vecs = np.linalg.eigh(r + r.T)
        q = np.r_[0, vecs[:, 2]]
    return q / np.linalg.norm(q)


def fk(deg):
    rows = [(0, 0, 814.5, 0), (-90, 300, 0, -90), (0, 700, 0, 0), (-90, 280, 893, 0), (90, 0, 0, 0), (-90, 0, 200, 90)]
    q = np.radians(np.array(deg, float))
    q[2] -= q[1]
    t = np.eye(4)
    for (al, a, d, th), j in zip(rows, q):
        m = np.eye(4)
        m[:3, :3] = rot("x", np.radians(al)) @ rot("z", np.radians(th) + j)
        m[:3, 3] = np.array([a, 0, 0]) + rot("x", np.radians(al)) @ np.array([0, 0, d])
        t = t @ m
    return t


def f(values, digits):
    return ",".join(f"{v + 0.0:.{digits}f}" for v in values)


def slot():
    wobj = np.eye(4)
    wobj[:3, :3] = rot("z", 1.6898)
    wobj[:3, 3] = [1203.0, -6.6, 1079.3]
    tcp = np.eye(4)
    tcp[:3, :3] = rot("x", np.radians(10)) @ rot("y", np.radians(5)) @ rot("z", 1.6941) @ rot("x", np.pi)
    tcp[2, 3] = 0.047469441691881
    flange = fk([-4.865041939722, -28.968433398828, 25.272419853519, 126.136057269071, 23.151140052459, 134.252558097527])
    tool = np.linalg.inv(flange) @ wobj @ tcp
    with open(f"{HERE}/slot/slot.mod", "w") as out:
        out.write("%%%\n  VERSION:1\n  LANGUAGE:ENGLISH\n%%%\nMODULE Slot\n  ! The slot of Tang et al.: 25R5, depth 1.5 mm, lead 5, tilt 10 degrees\n")
        out.write(f"  PERS tooldata tMill:=[TRUE,[[{f(tool[:3, 3], 6)}],[{f(quat(tool[:3, :3]), 9)}]],[18,[0,0,120],[1,0,0,0],0,0,0]];\n")
        out.write(f'  PERS wobjdata wSlot:=[FALSE,TRUE,"",[[{f(wobj[:3, 3], 3)}],[{f(quat(wobj[:3, :3]), 9)}]],[[0,0,0],[1,0,0,0]]];\n')
        out.write("  PROC main()\n    ConfL\\Off;\n")
        for x in np.linspace(0, 80, 81):
            out.write(f"    MoveL [[{f([x, 0, tcp[2, 3]], 4)}],[{f(quat(tcp[:3, :3]), 8)}],[0,0,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]],v20,z0,tMill\\WObj:=wSlot;\n")
        out.write("  ENDPROC\nENDMODULE\n")


def blade():
    def surface(u, v):  # mm: twisted, cambered
        x, y = 320 * u, 220 * v
        return np.array([x, y, 30 * np.sin(np.pi * u) * (1 - 0.4 * v) + 0.14 * (x - 160) * (v - 0.5)])

    rows, columns, lead = 46, 50, np.radians(8)
    points = []
    for i in range(rows):
        v = i / (rows - 1)
        us = np.linspace(0, 1, columns)
        for u in us if i % 2 == 0 else us[::-1]:
            e = 1e-4
            du = surface(u + e, v) - surface(u - e, v)
            dv = surface(u, v + e) - surface(u, v - e)
            n = np.cross(du, dv)
            n /= np.linalg.norm(n)
            feed = du / np.linalg.norm(du) * (1 if i % 2 == 0 else -1)
            axis = np.cos(lead) * n + np.sin(lead) * feed
            points.append((surface(u, v), axis))
    with open(f"{HERE}/blade/blade.aptsource", "w") as out:
        out.write("PARTNO BLADE PATCH\nUNITS/MM\nMULTAX/ON\nCUTTER/ 25.000000, 5.000000\nLOADTL/1\nSPINDL/ 6000.000000,RPM,CLW\n")
        p, a = points[0]
        out.write(f"RAPID\nGOTO/{f(p + 50 * a, 5)},{f(a, 7)}\nFEDRAT/ 1200.000000,MMPM\n")
        for p, a in points:
            out.write(f"GOTO/{f(p, 5)},{f(a, 7)}\n")
        p, a = points[-1]
        out.write(f"RAPID\nGOTO/{f(p + 50 * a, 5)},{f(a, 7)}\nFINI\n")


def units():
    down, lines = [0, 1, 0, 0], []

    def move(kind, place, quat, wobj, track, table, speed):
        lines.append(f"    {kind} [[{f(place, 3)}],[{f(quat, 8)}],[0,0,0,0],[{f([track, table], 3)},9E9,9E9,9E9,9E9]],"
                     f"{speed},z0,tMill\\WObj:={wobj};\n")

    for k in range(73):
        e = np.radians(5 * k)
        # The tool stays where it is, the table turns the ring under it.
        place = [-250 * np.cos(e), 250 * np.sin(e), 0]
        quat = [0, np.cos(e / 2), -np.sin(e / 2), 0]
        if k == 0:
            move("MoveJ", np.add(place, [0, 0, 50]), quat, "wRing", 300, 0, "v200")
        move("MoveL", place, quat, "wRing", 300, 5 * k, "v20")
    move("MoveL", np.add(place, [0, 0, 50]), quat, "wRing", 300, 360, "v200")
    move("MoveJ", [0, 0, 50], down, "wBeam", 0, 360, "v200")
    for y in np.linspace(0, 1500, 76):
        move("MoveL", [0, y, 0], down, "wBeam", y, 360, "v20")
    move("MoveL", [0, 1500, 50], down, "wBeam", 1500, 360, "v200")
    with open(f"{HERE}/units/units.mod", "w") as out:
        out.write("%%%\n  VERSION:1\n  LANGUAGE:ENGLISH\n%%%\nMODULE Units\n  ! A ring on a turntable, then a groove in a beam from the track\n")
        out.write("  PERS tooldata tMill:=[TRUE,[[0,0,300],[1,0,0,0]],[18,[0,0,120],[1,0,0,0],0,0,0]];\n")
        out.write('  PERS wobjdata wRing:=[FALSE,FALSE,"STN1",[[0,0,0],[1,0,0,0]],[[0,0,150],[1,0,0,0]]];\n')
        out.write('  PERS wobjdata wBeam:=[FALSE,TRUE,"",[[1250,0,650],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];\n')
        out.write("  PROC main()\n    ConfL\\Off;\n")
        out.write("    MoveAbsJ [[0,0,20,0,70,0],[300,0,9E9,9E9,9E9,9E9]]\\NoEOffs,v200,fine,tMill;\n")
        out.writelines(lines)
        out.write("  ENDPROC\nENDMODULE\n")


def wall():
    """A wall of 1 mm, 24 mm high, out of a block: roughed to 2 mm level by level, then each side is finished at its full depth."""
    ext = "[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]"
    lines = ["%%%", "  VERSION:1", "  LANGUAGE:ENGLISH", "%%%", "MODULE Wall",
             "  ! A wall of 1 mm, 24 mm high, out of a block.",
             "  PERS tooldata tEnd:=[TRUE,[[0,0,300],[1,0,0,0]],[18,[0,0,120],[1,0,0,0],0,0,0]];",
             '  PERS wobjdata wBlock:=[FALSE,TRUE,"",[[1250,-120,620],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];',
             "  PROC main()", "    ConfL\\Off;",
             f"    MoveAbsJ [[-5,20,20,0,60,0],{ext}]\\NoEOffs,v500,z0,tEnd;"]

    def move(word, x, y, z, speed):
        lines.append(f"    {word} [[{x:.3f},{y:.3f},{z:.3f}],[0,0,1,0],[0,0,0,0],{ext}],{speed},z0,tEnd\\WObj:=wBlock;")

    def cut(y, z, word="MoveL"):
        move(word, -8, y, 20, "v500")
        move("MoveL", -8, y, z, "v200")
        for x in range(-4, 45, 4):
            move("MoveL", x, y, z, "v20")
        move("MoveL", 44, y, 20, "v200")

    for level in range(1, 7):
        for y in (13, 1):
            cut(y, -4 * level, "MoveJ" if level == 1 and y == 13 else "MoveL")
    cut(12.5, -24)
    cut(1.5, -24)
    with open(f"{HERE}/wall/wall.mod", "w") as out:
        out.write("\n".join(lines + ["  ENDPROC", "ENDMODULE", ""]))


slot()
blade()
units()
wall()
