#!/usr/bin/env python3
"""Truth by CalculiX (Debian: calculix-ccx): a rigid, frictionless sphere pressed into a block that is held at its bottom.

    bench/truth/calculix_press.py [--out FOLDER] [part of a case's name]

Elements as in calculix.py; the part of the block that symmetry leaves. Contact is surface to surface with a stiff
penalty. Each case is solved with small strains on two meshes, the second 1.5 times as fine. The force with large
strains (NLGEOM: St. Venant-Kirchhoff) on the coarser mesh says how much the law matters. Writes CASE.csv: the forces,
and the displacements of points of the surface.
"""
import argparse
import pathlib
import subprocess
import sys
import tempfile

from calculix import Block, Mesh, even, graded, joined

RADIUS = 0.025              # [m] of the sphere
HALF, HEIGHT = 0.05, 0.05   # [m] of the block
YOUNG = 5000.0              # [Pa]
PENALTY = 4e4 * YOUNG       # [Pa/m]: under 1 kPa the faces lie 5 um in each other
GRID = 0.005                # [m] between the points of the surface
BALL, BALL_CENTRE, STIFFER = 0.01, 0.035, 5.0  # [m] radius, [m] height, times the block's stiffness


def ball_place(p):
    """A cube of lines becomes a ball, and what lies around it up to a cube of 15 mm makes way."""
    inner, outer = 0.8 * BALL, HEIGHT - BALL_CENTRE
    q = (p[0], p[1], p[2] - BALL_CENTRE)
    away = max(map(abs, q))
    if away >= outer or away < 1e-9:
        return p
    length = sum(v * v for v in q) ** 0.5
    if away <= inner:
        # Straight lines in the middle, spheres at the border.
        share = (away / inner) ** 2
        scale = (1.0 - share) * 0.9 + share * BALL * away / (inner * length)
    else:
        share = (away - inner) / (outer - inner)
        scale = (1.0 - share) * BALL / length + share * outer / away
    return (scale * q[0], scale * q[1], scale * q[2] + BALL_CENTRE)


class Press:
    """`at` is the sphere's place along x [m]. Without a ball and in the middle, a quarter of the block is meshed."""

    def __init__(self, name, depth, nu, at=0.0, ball=False):
        self.name, self.depth, self.nu, self.at, self.ball = name, depth, nu, at, ball

    def block(self, level):
        """Lines for `level` 2, the coarser mesh, or 3."""
        many = lambda count: max(1, round(count * level / 3))
        contact = (RADIUS * self.depth) ** 0.5
        if not self.ball:
            line = joined(even(0, contact, many(6)), graded(contact, HALF, many(5), 1.45 ** (3 / level)))
            down = joined(even(0, 0.5 * contact, many(3)),
                          graded(0.5 * contact, HEIGHT, many(5), 1.5 ** (3 / level)))
            return Block([line, line, [HEIGHT - v for v in reversed(down)]])
        inner, outer = 0.8 * BALL, HEIGHT - BALL_CENTRE
        low, high = BALL_CENTRE - inner, BALL_CENTRE + inner
        z = joined(even(0, 0.02, many(3)), even(0.02, low, many(2)), even(low, high, many(5)),
                   even(high, HEIGHT, many(4)))
        y = joined(even(0, inner, many(4)), even(inner, outer, many(3)), graded(outer, HALF, many(4), 1.5))
        if self.at == 0.0:
            return Block([y, y, z], ball_place)
        near, far = self.at - inner, self.at + inner
        x = joined(even(-HALF, -outer, many(3)), even(-outer, -inner, many(2)), even(-inner, inner, many(6)),
                   even(inner, near, many(2)), even(near, far, many(8)), graded(far, HALF, many(4), 1.5))
        return Block([x, y, z], ball_place)

    def copies(self):
        return 4 if self.at == 0.0 else 2

    def points(self):
        """Of the top and of the side x = HALF."""
        low = 0.0 if self.at == 0.0 else -HALF
        across = even(0.0, HALF, round(HALF / GRID))
        points = [(x, y, HEIGHT) for x in even(low, HALF, round((HALF - low) / GRID)) for y in across]
        return points + [(HALF, y, z) for y in across for z in across[:-1]]


def write_nodes(out, mesh, first):
    for n, p in enumerate(mesh.places):
        out.write("%d, %.12g, %.12g, %.12g\n" % (first + n, *p))


def write_elements(out, mesh, name, first, first_node, chosen):
    out.write("*ELEMENT, TYPE=C3D20R, ELSET=%s\n" % name)
    for n in chosen:
        numbers = [first + n] + [node + first_node for node in mesh.elements[n]]
        out.write(", ".join(map(str, numbers[:16])) + ",\n" + ", ".join(map(str, numbers[16:])) + "\n")


def in_ball(mesh, element):
    corners = [mesh.places[n] for n in element[:8]]
    middle = [sum(p[k] for p in corners) / 8 for k in range(3)]
    return middle[0] ** 2 + middle[1] ** 2 + (middle[2] - BALL_CENTRE) ** 2 < (0.97 * BALL) ** 2


def solve(case, level, large, folder):
    """Displacements of the block's nodes [m] and the force on the sphere [N]."""
    mesh = Mesh([case.block(level)], 1)
    # The sphere: a layer whose outer side is side S1 of its elements. It need not be fine: its sides are curved.
    def place(p):
        length = (p[0] ** 2 + p[1] ** 2 + 1.0) ** 0.5
        r = RADIUS * (1.0 - 0.2 * p[2])
        return (case.at + r * p[0] / length, r * p[1] / length, HEIGHT + RADIUS - r / length)
    wide = even(0, 1.2, 10)
    both = joined([-v for v in reversed(wide)], wide)
    cap = Mesh([Block([wide if case.at == 0.0 else both, wide, [0.0, 1.0]], place)], 1)
    first = len(mesh.places) + 1
    with open(folder / "case.inp", "w") as out:
        out.write("*NODE, NSET=ALL\n")
        write_nodes(out, mesh, 1)
        out.write("*NODE, NSET=SPHERE\n")
        write_nodes(out, cap, first)
        stiff = [n for n, e in enumerate(mesh.elements) if case.ball and in_ball(mesh, e)]
        inside = set(stiff)
        write_elements(out, mesh, "BODY", 1, 1, [n for n in range(len(mesh.elements)) if n not in inside])
        if stiff:
            write_elements(out, mesh, "BALL", 1, 1, stiff)
        write_elements(out, cap, "CAP", len(mesh.elements) + 1, first, range(len(cap.elements)))
        out.write("*SURFACE, NAME=TOP\n")
        near = 1.6 * (RADIUS * case.depth) ** 0.5
        for n, e in enumerate(mesh.elements):
            corners = [mesh.places[k] for k in e[4:8]]
            if all(abs(p[2] - HEIGHT) < 1e-9 for p in corners) and \
                    min((p[0] - case.at) ** 2 + p[1] ** 2 for p in corners) < near ** 2:
                out.write("%d, S2\n" % (n + 1))
        out.write("*SURFACE, NAME=ROUND\nCAP, S1\n")
        for name, nodes in (("HELD", [n for n, p in enumerate(mesh.places) if p[2] < 1e-9]),
                            ("XSYM", [n for n, p in enumerate(mesh.places) if case.at == 0.0 and p[0] < 1e-9]),
                            ("YSYM", [n for n, p in enumerate(mesh.places) if p[1] < 1e-9])):
            if nodes:
                out.write("*NSET, NSET=%s\n" % name + "".join("%d,\n" % (n + 1) for n in nodes))
        for elements, name, young in (("BODY", "TISSUE", YOUNG), ("BALL", "STIFF", STIFFER * YOUNG),
                                      ("CAP", "STEEL", 1e6 * YOUNG)):
            if elements != "BALL" or stiff:
                out.write("*MATERIAL, NAME=%s\n*ELASTIC\n%g, %g\n" % (name, young, case.nu))
                out.write("*SOLID SECTION, ELSET=%s, MATERIAL=%s\n" % (elements, name))
        out.write("*SURFACE INTERACTION, NAME=SLIPPERY\n*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR\n%g\n" % PENALTY)
        out.write("*CONTACT PAIR, INTERACTION=SLIPPERY, TYPE=SURFACE TO SURFACE\nTOP, ROUND\n")
        out.write("*BOUNDARY\nHELD, 1, 3\n" + ("XSYM, 1\n" if case.at == 0.0 else "") + "YSYM, 2\n")
        out.write("*STEP, INC=1000%s\n*STATIC\n%g, 1.\n*BOUNDARY\nSPHERE, 1, 2\nSPHERE, 3, 3, %.12g\n" %
                  (", NLGEOM" if large else "", 0.5 if large else 1.0, -case.depth))
        out.write("*NODE PRINT, NSET=ALL, FREQUENCY=1000\nU\n*NODE PRINT, NSET=SPHERE, FREQUENCY=1000, TOTALS=ONLY\nRF\n")
        out.write("*END STEP\n")
    run = subprocess.run(["ccx", "case"], cwd=folder, capture_output=True, text=True)
    text = (folder / "case.dat").read_text() if run.returncode == 0 else ""
    displacements, force, total = [None] * len(mesh.places), None, False
    for line in text.splitlines():
        words = line.split()
        if "total force" in line:
            total = True
        elif total and len(words) == 3:
            force, total = -case.copies() * float(words[2]), False
        elif len(words) == 4 and words[0].isdigit() and int(words[0]) < first:
            displacements[int(words[0]) - 1] = tuple(map(float, words[1:]))
    if force is None or None in displacements:
        sys.exit("%s: ccx failed\n%s" % (case.name, run.stdout[-2000:]))
    return mesh, displacements, force


def make(case, out):
    with tempfile.TemporaryDirectory() as scratch:
        folder = pathlib.Path(scratch)
        coarse, coarse_u, coarse_force = solve(case, 2, False, folder)
        large_force = solve(case, 2, True, folder)[2]
        fine, fine_u, force = solve(case, 3, False, folder)
    points = case.points()
    u = [fine.interpolated(fine_u, p) for p in points]
    before = [coarse.interpolated(coarse_u, p) for p in points]
    squares = sum(sum((a - b) ** 2 for a, b in zip(v, w)) for v, w in zip(u, before)) / len(u)
    keys = {"case": case.name, "load": "sphere", "law": "linear elasticity", "units": "SI",
            "youngs_modulus": "%g" % YOUNG, "poissons_ratio": "%g" % case.nu, "density": "1000",
            "gravity": "0 0 0", "box_min": "%g %g 0" % (-HALF, -HALF), "box_max": "%g %g %g" % (HALF, HALF, HEIGHT),
            "held_plane_point": "0 0 0", "held_plane_normal": "0 0 1", "sphere_radius": "%g" % RADIUS,
            "sphere_depth": "%g" % case.depth, "sphere_at": "%g 0" % case.at,
            "sphere_contact": "rigid, frictionless, on the face z = %g" % HEIGHT}
    if case.ball:
        keys.update({"ball_center": "0 0 %g" % BALL_CENTRE, "ball_radius": "%g" % BALL,
                     "ball_youngs_modulus": "%g" % (STIFFER * YOUNG)})
    keys.update({"indentation_force": "%.6g" % force, "indentation_force_coarser": "%.6g" % coarse_force,
                 "large_strain_over_small": "%.5g" % (large_force / coarse_force),
                 "elements": "C3D20R: %d, before %d" % (len(fine.elements), len(coarse.elements)),
                 "convergence": "%.2e" % (squares ** 0.5 / case.depth)})
    with open(out / (case.name + ".csv"), "w") as csv:
        for key, value in keys.items():
            csv.write("# %s: %s\n" % (key, value))
        csv.write("x,y,z,ux,uy,uz\n")
        for p, v in zip(points, u):
            csv.write("%.9g,%.9g,%.9g,%.6g,%.6g,%.6g\n" % (*p, *v))
    print("%-24s %.5f N, before %.5f; with large strains %.4f times; displacements differ by %.3f %%" %
          (case.name, force, coarse_force, large_force / coarse_force, 100 * squares ** 0.5 / case.depth), flush=True)


def cases():
    for nu in (0.3, 0.45):
        for depth in (1, 3, 8):
            yield Press("press_%d_nu%02d" % (depth, 100 * nu), 0.001 * depth, nu)
    yield Press("ball_above", 0.003, 0.3, ball=True)
    yield Press("ball_above_1", 0.001, 0.3, ball=True)  # strains between sphere and ball are small
    yield Press("ball_beside", 0.003, 0.3, at=0.02, ball=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path(__file__).parent / "calculix")
    parser.add_argument("part", nargs="?", default="", help="of a case's name; all where left out")
    arguments = parser.parse_args()
    for case in cases():
        if arguments.part in case.name:
            make(case, arguments.out)


if __name__ == "__main__":
    main()
