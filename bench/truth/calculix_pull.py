#!/usr/bin/env python3
"""Truth by CalculiX (Debian: calculix-ccx): a block that is held at its bottom, and pulled up at the middle of its top.

    bench/truth/calculix_pull.py [--out FOLDER] [part of a case's name]

A grasp pulls with a force in the tissue around its middle: of a share that falls with the distance d as (1 - (d/r)^2)^2
within its radius r, changed linearly with the depth so that its mean is the grasped point (src/tools/grasp.cpp). A
quarter of the block, elements as in calculix.py, small strains, two meshes.
"""
import argparse
import pathlib
import subprocess
import sys
import tempfile

from calculix import Block, Mesh, even, graded, joined, shares

RADIUS, FORCE = 0.02, 0.02        # [m] [N] small: 1 mm
HALF, HEIGHT, YOUNG = 0.05, 0.05, 5000.0
GRID = 0.005                      # [m] between the points of the surface
# Of half a ball with those shares, over r: the mean depth, and by how much shares fall with the depth to have none.
DEEP = 35 / 128
SLOPE = DEEP / (1 / 9 - DEEP ** 2)
GAUSS = ((-0.6 ** 0.5, 5 / 9), (0.0, 8 / 9), (0.6 ** 0.5, 5 / 9))


def solve(nu, level, folder):
    many = lambda count: round(count * level / 2)
    line = joined(even(0, RADIUS, many(6)), graded(RADIUS, HALF, many(4), 1.2))
    down = joined(even(0, RADIUS, many(6)), even(RADIUS, HEIGHT, many(4)))
    mesh = Mesh([Block([line, line, [HEIGHT - v for v in reversed(down)]])], 1)
    loads = [0.0] * len(mesh.places)
    for element in mesh.elements:
        low, high = mesh.places[element[0]], mesh.places[element[6]]
        for x, u in GAUSS:
            for y, v in GAUSS:
                for z, w in GAUSS:
                    at = [0.5 * (a + b + (b - a) * s) for a, b, s in zip(low, high, (x, y, z))]
                    far = (at[0] ** 2 + at[1] ** 2 + (at[2] - HEIGHT) ** 2) / RADIUS ** 2
                    if far >= 1.0:
                        continue
                    volume = u * v * w
                    for a, b in zip(low, high):
                        volume *= 0.5 * (b - a)
                    volume *= (1 - far) ** 2 * (1 + SLOPE * (DEEP - (HEIGHT - at[2]) / RADIUS))
                    for n, share in zip(element, shares((x, y, z))):
                        loads[n] += volume * share
    scale = 0.25 * FORCE / sum(loads)
    with open(folder / "case.inp", "w") as out:
        out.write("*NODE, NSET=ALL\n")
        for n, p in enumerate(mesh.places):
            out.write("%d, %.12g, %.12g, %.12g\n" % (n + 1, *p))
        out.write("*ELEMENT, TYPE=C3D20R, ELSET=BODY\n")
        for n, nodes in enumerate(mesh.elements):
            numbers = [n + 1] + [node + 1 for node in nodes]
            out.write(", ".join(map(str, numbers[:16])) + ",\n" + ", ".join(map(str, numbers[16:])) + "\n")
        for name, chosen in (("HELD", lambda p: p[2] < 1e-9), ("XSYM", lambda p: p[0] < 1e-9),
                             ("YSYM", lambda p: p[1] < 1e-9)):
            out.write("*NSET, NSET=%s\n" % name)
            out.writelines("%d,\n" % (n + 1) for n, p in enumerate(mesh.places) if chosen(p))
        out.write("*MATERIAL, NAME=TISSUE\n*ELASTIC\n%g, %g\n*SOLID SECTION, ELSET=BODY, MATERIAL=TISSUE\n" % (YOUNG, nu))
        out.write("*BOUNDARY\nHELD, 1, 3\nXSYM, 1\nYSYM, 2\n*STEP\n*STATIC\n*CLOAD\n")
        out.writelines("%d, 3, %.10g\n" % (n + 1, scale * f) for n, f in enumerate(loads) if f != 0.0)
        out.write("*NODE PRINT, NSET=ALL\nU\n*END STEP\n")
    run = subprocess.run(["ccx", "case"], cwd=folder, capture_output=True, text=True)
    field = [None] * len(mesh.places)
    for line in (folder / "case.dat").read_text().splitlines():
        words = line.split()
        if len(words) == 4 and words[0].isdigit():
            field[int(words[0]) - 1] = tuple(map(float, words[1:]))
    if run.returncode or None in field:
        sys.exit("ccx failed\n%s" % run.stdout[-2000:])
    return mesh, field


def make(name, nu, out):
    with tempfile.TemporaryDirectory() as scratch:
        coarse, coarse_u = solve(nu, 2, pathlib.Path(scratch))
        fine, fine_u = solve(nu, 3, pathlib.Path(scratch))
    across = even(0.0, HALF, round(HALF / GRID))
    points = [(x, y, HEIGHT) for x in across for y in across] + [(HALF, y, z) for y in across for z in across[:-1]]
    u = [fine.interpolated(fine_u, p) for p in points]
    before = [coarse.interpolated(coarse_u, p) for p in points]
    largest = max(sum(x * x for x in v) for v in u) ** 0.5
    squares = sum(sum((a - b) ** 2 for a, b in zip(v, w)) for v, w in zip(u, before)) / len(u)
    keys = {"case": name, "load": "pull", "law": "linear elasticity", "units": "SI", "youngs_modulus": "%g" % YOUNG,
            "poissons_ratio": "%g" % nu, "density": "1000", "gravity": "0 0 0",
            "box_min": "%g %g 0" % (-HALF, -HALF), "box_max": "%g %g %g" % (HALF, HALF, HEIGHT),
            "held_plane_point": "0 0 0", "held_plane_normal": "0 0 1", "grasp_radius": "%g" % RADIUS,
            "grasp_middle": "0 0 %g" % HEIGHT, "pull_force": "%g" % FORCE,
            "elements": "C3D20R: %d, before %d" % (len(fine.elements), len(coarse.elements)),
            "convergence": "%.2e" % (squares ** 0.5 / largest)}
    with open(out / (name + ".csv"), "w") as csv:
        for key, value in keys.items():
            csv.write("# %s: %s\n" % (key, value))
        csv.write("x,y,z,ux,uy,uz\n")
        for p, v in zip(points, u):
            csv.write("%.9g,%.9g,%.9g,%.6g,%.6g,%.6g\n" % (*p, *v))
    print("%-24s largest %.5g m, two meshes differ by %.3f %%" % (name, largest, 100 * squares ** 0.5 / largest))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path(__file__).parent / "calculix")
    parser.add_argument("part", nargs="?", default="", help="of a case's name; all where left out")
    arguments = parser.parse_args()
    for name, nu in (("pull_nu30", 0.3), ("pull_nu45", 0.45)):
        if arguments.part in name:
            make(name, nu, arguments.out)


if __name__ == "__main__":
    main()
