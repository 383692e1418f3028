#!/usr/bin/env python3
"""Truth by CalculiX (Debian: calculix-ccx), for bodies as users have them: any shape, any placing, any clamp.

    bench/truth/calculix.py [--out FOLDER] [part of a case's name]

Structured meshes of 20-node hexahedra with reduced integration (C3D20R), small displacements. Each case is solved on two
meshes, the second with every element divided into eight, and says by how much they differ. Writes CASE.csv (rest place and
displacement of every vertex of the surface, in the body's own frame) and SHAPE.obj, the surface, with the same vertices.
"""
import argparse
import math
import pathlib
import subprocess
import sys
import tempfile

DENSITY = 1000.0  # [kg/m^3]
SMALL = 0.005     # largest displacement over the body's longest extent: as small as the theory takes it

CORNERS = ((0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0), (0, 0, 2), (2, 0, 2), (2, 2, 2), (0, 2, 2))
EDGES = ((1, 0, 0), (2, 1, 0), (1, 2, 0), (0, 1, 0), (1, 0, 2), (2, 1, 2), (1, 2, 2), (0, 1, 2),
         (0, 0, 1), (2, 0, 1), (2, 2, 1), (0, 2, 1))
# Corners of each side, seen from outside counter-clockwise.
SIDES = ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))


def even(low, high, count):
    return [low + (high - low) * k / count for k in range(count + 1)]


def graded(low, high, count, ratio):
    """Lines whose distances grow by `ratio`: what is clamped is singular at its edges."""
    steps = [ratio ** k for k in range(count)]
    lines = [low]
    for step in steps:
        lines.append(lines[-1] + (high - low) * step / sum(steps))
    lines[-1] = high
    return lines


def joined(*parts):
    lines = list(parts[0])
    for part in parts[1:]:
        lines += part[1:]
    return lines


def divided(lines, by):
    return [a + (b - a) * k / by for a, b in zip(lines, lines[1:]) for k in range(by)] + [lines[-1]]


class Block:
    """Lines along three parameters, and where a parameter lies in space [m]."""

    def __init__(self, lines, place=lambda p: p):
        self.lines, self.place = lines, place


def shares(at):
    """Of the 20 nodes of an element, at a place within -1..1."""
    result = []
    for node in CORNERS + EDGES:
        r = [n - 1 for n in node]
        value = 1.0
        for a, b in zip(at, r):
            value *= 1 + a * b if b else 1 - a * a
        if 0 not in r:
            result.append(0.125 * value * (sum(a * b for a, b in zip(at, r)) - 2))
        else:
            result.append(0.25 * value)
    return result


class Mesh:
    """`apart` says of a place and the middle of an element there whether it has a node of its own: beyond a cut."""

    def __init__(self, blocks, by, apart=lambda p, middle: False):
        self.places, self.elements, self.numbers, self.lines = [], [], {}, None
        for block in blocks:
            lines = [divided(divided(axis, by), 2) for axis in block.lines]
            self.lines = lines  # of the last one
            for i in range(0, len(lines[0]) - 2, 2):
                for j in range(0, len(lines[1]) - 2, 2):
                    for k in range(0, len(lines[2]) - 2, 2):
                        middle = block.place((lines[0][i + 1], lines[1][j + 1], lines[2][k + 1]))
                        places = [block.place((lines[0][i + a], lines[1][j + b], lines[2][k + c]))
                                  for a, b, c in CORNERS + EDGES]
                        self.elements.append([self.node(p, apart(p, middle)) for p in places])

    def node(self, place, apart=False):
        key = tuple(round(x * 1e7) for x in place)
        # What rounds the other way is the same node.
        for near in ((key[0] + a, key[1] + b, key[2] + c) for a in (0, -1, 1) for b in (0, -1, 1) for c in (0, -1, 1)):
            if (near, apart) in self.numbers:
                return self.numbers[near, apart]
        self.numbers[key, apart] = len(self.places)
        self.places.append(place)
        return len(self.places) - 1

    def interpolated(self, field, p):
        """At a place of a mesh of one block, where its lines lie in space as they are."""
        number, at = 0, []
        for axis, x in zip(self.lines, p):
            count = len(axis) // 2
            k = 0
            while k + 1 < count and x > axis[2 * k + 2]:
                k += 1
            number = number * count + k
            at.append(2 * (x - axis[2 * k]) / (axis[2 * k + 2] - axis[2 * k]) - 1)
        values = [field[n] for n in self.elements[number]]
        return tuple(sum(s * v[k] for s, v in zip(shares(at), values)) for k in range(3))

    def surface(self):
        sides = {}
        for element in self.elements:
            for side in SIDES:
                quad = [element[k] for k in side]
                key = tuple(sorted(quad))
                if key in sides:
                    sides[key] = None
                else:
                    sides[key] = quad
        return [quad for quad in sides.values() if quad]


class Case:
    def __init__(self, name, shape, blocks, held, gravity=(0, 0, -1), nu=0.3, surface=1, keys=(), by=1):
        self.name, self.shape, self.blocks, self.held = name, shape, blocks, held
        self.gravity, self.nu, self.surface, self.keys, self.by = gravity, nu, surface, dict(keys), by
        self.apart = lambda p, middle: False


def solve(case, by, folder):
    """Displacements for a gravity of 1 m/s^2 and 5 kPa."""
    mesh = Mesh(case.blocks, by, case.apart)
    with open(folder / "case.inp", "w") as out:
        out.write("*NODE, NSET=ALL\n")
        for n, p in enumerate(mesh.places):
            out.write("%d, %.12g, %.12g, %.12g\n" % (n + 1, *p))
        out.write("*ELEMENT, TYPE=C3D20R, ELSET=BODY\n")
        for n, nodes in enumerate(mesh.elements):
            numbers = [n + 1] + [node + 1 for node in nodes]
            out.write(", ".join(map(str, numbers[:16])) + ",\n" + ", ".join(map(str, numbers[16:])) + "\n")
        out.write("*NSET, NSET=HELD\n")
        for n, p in enumerate(mesh.places):
            if case.held(p):
                out.write("%d,\n" % (n + 1))
        length = math.sqrt(sum(x * x for x in case.gravity))
        out.write("*MATERIAL, NAME=TISSUE\n*ELASTIC\n5000., %g\n*DENSITY\n%g\n" % (case.nu, DENSITY))
        out.write("*SOLID SECTION, ELSET=BODY, MATERIAL=TISSUE\n*BOUNDARY\nHELD, 1, 3\n*STEP\n*STATIC\n*DLOAD\n")
        out.write("BODY, GRAV, 1., %.12g, %.12g, %.12g\n" % tuple(x / length for x in case.gravity))
        out.write("*NODE PRINT, NSET=ALL\nU\n*END STEP\n")
    run = subprocess.run(["ccx", "case"], cwd=folder, capture_output=True, text=True)
    displacements = [None] * len(mesh.places)
    for line in (folder / "case.dat").read_text().splitlines():
        words = line.split()
        if len(words) == 4 and words[0].isdigit():
            displacements[int(words[0]) - 1] = tuple(map(float, words[1:]))
    if run.returncode or None in displacements:
        sys.exit("%s: ccx failed\n%s" % (case.name, run.stdout[-2000:]))
    return mesh, displacements


def make(case, out):
    with tempfile.TemporaryDirectory() as scratch:
        folder = pathlib.Path(scratch)
        coarse, coarse_u = solve(case, case.by, folder)
        fine, fine_u = solve(case, 2 * case.by, folder)
    shape = Mesh(case.blocks, case.surface)
    quads = shape.surface()
    used = sorted({n for quad in quads for n in quad})
    number = {n: k + 1 for k, n in enumerate(used)}
    with open(out / (case.shape + ".obj"), "w") as obj:
        obj.write("# made by bench/truth/calculix.py; metres\n")
        for n in used:
            obj.write("v %.9g %.9g %.9g\n" % tuple(shape.places[n]))
        for a, b, c, d in quads:
            for t in ((a, b, c), (a, c, d)):
                obj.write("f %d %d %d\n" % tuple(number[n] for n in t))
    u = [fine_u[fine.node(shape.places[n])] for n in used]
    # What is a corner or the middle of an edge of the coarse mesh too.
    both = [(v, coarse_u[k]) for v, k in zip(u, (coarse.node(shape.places[n]) for n in used)) if k < len(coarse_u)]
    norm = lambda v: math.sqrt(sum(x * x for x in v))
    largest = max(map(norm, u))
    convergence = math.sqrt(sum(norm([a - b for a, b in zip(v, w)]) ** 2 for v, w in both) / len(both)) / largest
    extent = max(max(p[k] for p in shape.places) - min(p[k] for p in shape.places) for k in range(3))
    gravity = SMALL * extent / largest
    unit = [x / norm(case.gravity) for x in case.gravity]
    keys = {"case": case.name, "load": "gravity", "law": "linear elasticity", "units": "SI, the body's own frame",
            "surface": case.shape + ".obj", "youngs_modulus": "5000", "poissons_ratio": "%g" % case.nu,
            "density": "%g" % DENSITY, "gravity": "%.9g %.9g %.9g" % tuple(gravity * x for x in unit)}
    keys.update(case.keys)
    keys.update({"elements": "C3D20R: %d, before %d" % (len(fine.elements), len(coarse.elements)),
                 "convergence": "%.2e" % convergence})
    with open(out / (case.name + ".csv"), "w") as csv:
        for key, value in keys.items():
            csv.write("# %s: %s\n" % (key, value))
        csv.write("x,y,z,ux,uy,uz\n")
        for n, v in zip(used, u):
            csv.write("%.9g,%.9g,%.9g,%.6g,%.6g,%.6g\n" % (*shape.places[n], *(gravity * x for x in v)))
    print("%-24s largest %.3f of the extent at 1 m/s^2, two meshes differ by %.3f %%, %d elements" %
          (case.name, largest / extent, 100 * convergence, len(fine.elements)), flush=True)


def turned(v, rpy_degrees):
    """The vector in the frame of a body that is turned about the fixed x, then y, then z axis."""
    r, p, y = (math.radians(a) for a in rpy_degrees)
    x0, y0, z0 = v
    x1, y1, z1 = math.cos(y) * x0 + math.sin(y) * y0, -math.sin(y) * x0 + math.cos(y) * y0, z0
    x2, y2, z2 = math.cos(p) * x1 - math.sin(p) * z1, y1, math.sin(p) * x1 + math.cos(p) * z1
    return x2, math.cos(r) * y2 + math.sin(r) * z2, -math.sin(r) * y2 + math.cos(r) * z2


def bar(name, shape, length, side, clamp, **more):
    lines = graded(clamp, length, 12, 1.12)
    if clamp > 0:
        lines = joined(even(0, clamp, 2), lines)
    across = even(-0.5 * side, 0.5 * side, 4)
    keys = {"held_plane_point": "%g 0 0" % clamp, "held_plane_normal": "1 0 0"}
    keys.update(more.pop("keys", {}))
    return Case(name, shape, [Block([lines, across, across])], lambda p: p[0] <= clamp + 1e-9, keys=keys, **more)


def cook():
    """Cook's membrane, 1 mm a unit and twice that, 30 mm thick."""
    place = lambda p: (0.002 * 48 * p[0], 0.002 * (44 * p[1] + p[0] * (44 - 28 * p[1])), p[2])
    block = Block([graded(0, 1, 9, 1.12), even(0, 1, 8), even(-0.015, 0.015, 3)], place)
    return Case("taper", "taper", [block], lambda p: p[0] <= 1e-9, gravity=(0, -1, 0),
                keys={"held_plane_point": "0 0 0", "held_plane_normal": "1 0 0"})


def ring(name, angles, radii, heights, held, keys, place, **more):
    return Case(name, name, [Block([radii, angles, heights], place)], held, keys=keys, **more)


def tube():
    """Along x, 150 mm long, 50 mm wide, a wall of 8 mm."""
    place = lambda p: (p[2], p[0] * math.cos(p[1]), p[0] * math.sin(p[1]))
    heights = joined(even(0, 0.02, 2), graded(0.02, 0.15, 11, 1.12))
    return ring("tube", even(0, 2 * math.pi, 24), even(0.017, 0.025, 1), heights, lambda p: p[0] <= 0.02 + 1e-9,
                {"held_plane_point": "0.02 0 0", "held_plane_normal": "1 0 0"}, place, surface=2)


def curved():
    """A quarter of a ring of 100 mm, 30 mm thick; held where y <= 0."""
    place = lambda p: (p[0] * math.cos(p[1]), p[0] * math.sin(p[1]), p[2])
    return ring("curved", graded(0, 0.5 * math.pi, 14, 1.08), even(0.085, 0.115, 3), even(-0.015, 0.015, 3),
                lambda p: p[1] <= 1e-9, {"held_plane_point": "0 0 0", "held_plane_normal": "0 1 0"}, place,
                gravity=(0, -1, -1), surface=2)


def angle():
    """An L: a standing leg, held at its lower 10 mm, and a lying one."""
    x, legs = even(0, 0.04, 3), even(0.04, 0.13, 8)
    z = joined(even(0, 0.01, 1), graded(0.01, 0.09, 8, 1.05))
    y = even(-0.02, 0.02, 3)
    top = even(0.09, 0.13, 3)
    blocks = [Block([x, y, joined(z, top)]), Block([legs, y, top])]
    return Case("angle", "angle", blocks, lambda p: p[2] <= 0.01 + 1e-9,
                keys={"held_plane_point": "0 0 0.01", "held_plane_normal": "0 0 1"})


def oblique():
    """A bar held below a plane that cuts it at 30 degrees, across all axes."""
    side, clamp, length = 0.047, 0.03, 0.193
    slope = (math.tan(math.radians(30)) * 0.8, math.tan(math.radians(30)) * 0.6)

    def place(p):
        # The lines near the clamp follow its plane, those at the ends stand upright.
        share = p[0] / clamp if p[0] < clamp else (length - p[0]) / (length - clamp)
        return (p[0] + share * (slope[0] * p[1] + slope[1] * p[2]), p[1], p[2])

    across = even(-0.5 * side, 0.5 * side, 4)
    lines = joined(even(0, clamp, 2), graded(clamp, length, 12, 1.12))
    held = lambda p: p[0] - slope[0] * p[1] - slope[1] * p[2] <= clamp + 1e-9
    return Case("bar_oblique_clamp", "bar_oblique_clamp", [Block([lines, across, across], place)], held,
                keys={"held_plane_point": "%g 0 0" % clamp,
                      "held_plane_normal": "1 %.9g %.9g" % (-slope[0], -slope[1])})


def skins():
    """A sheet of 60 x 60 x 3 mm: held at one edge, and at all of them."""
    half, thick = 0.03, even(-0.0015, 0.0015, 1)
    rim = graded(-half, 0, 6, 1.25)
    both = joined(rim, [-v for v in reversed(rim)])
    across = even(-half, half, 8)
    yield Case("skin_edge", "skin_edge", [Block([graded(-half, half, 12, 1.12), across, thick])],
               lambda p: p[0] <= -half + 1e-9,
               keys={"held_plane_point": "%g 0 0" % -half, "held_plane_normal": "1 0 0"})
    keys = {}
    for k, (x, y) in enumerate(((1, 0), (-1, 0), (0, 1), (0, -1))):
        number = "_%d" % (k + 1) if k else ""
        keys["held_plane_point" + number] = "%g %g 0" % (-half * x, -half * y)
        keys["held_plane_normal" + number] = "%d %d 0" % (x, y)
    yield Case("skin_rim", "skin_rim", [Block([both, both, thick])],
               lambda p: max(abs(p[0]), abs(p[1])) >= half - 1e-9, keys=keys)


def cases():
    yield bar("bar", "bar", 0.2, 0.05, 0.0)
    yield bar("bar_fine", "bar_fine", 0.2, 0.05, 0.0, surface=4, by=2)
    yield bar("bar_nu45", "bar", 0.2, 0.05, 0.0, nu=0.45)
    yield bar("bar_nu49", "bar", 0.2, 0.05, 0.0, nu=0.49)
    rpy = (30, 20, 0)
    yield bar("bar_turned", "bar", 0.2, 0.05, 0.0, gravity=turned((0, 0, -1), rpy),
              keys={"placed_rpy_degrees": "%g %g %g" % rpy})
    for clamp in (0, 26, 28.2, 32.2):
        tenths = round(10 * clamp)
        yield bar("bar_awkward_%03d" % tenths, "bar_awkward_%03d" % tenths, 0.193, 0.047, 0.001 * clamp)
    yield oblique()
    yield cook()
    yield tube()
    yield curved()
    yield angle()
    yield from skins()


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path(__file__).parent / "calculix")
    parser.add_argument("part", nargs="?", default="", help="of a case's name; all where left out")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    for case in cases():
        if arguments.part in case.name:
            make(case, arguments.out)


if __name__ == "__main__":
    main()
