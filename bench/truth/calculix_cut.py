#!/usr/bin/env python3
"""Truth by CalculiX (Debian: calculix-ccx): bodies with a wound, under their own weight.

    bench/truth/calculix_cut.py [--out FOLDER] [part of a case's name]

Elements, loads and files as in calculix.py. The wound has no width, and a node on each of its faces. Lines are dense at
its tip, where the strain is singular. SHAPE.obj is the body before the cut; rows are its vertices, but for those on the
blade. `mouth_opening` is the distance of the wound's lips at the middle of the mouth.
"""
import argparse
import math
import pathlib
import tempfile

from calculix import Block, Case, Mesh, SMALL, even, graded, joined, solve


def towards(low, high, count, ratio):
    return [low + high - v for v in reversed(graded(low, high, count, ratio))]


class Cut:
    """A box, held where x = 0, with its middle at y = z = 0: cut at x = `at` from the top to `depth`, and where `width` is
    given, no farther than half of it to the sides."""

    def __init__(self, name, shape, size, at, depth, width=0.0):
        self.name, self.shape, self.size, self.at, self.depth, self.width = name, shape, size, at, depth, width
        length, wide, high = size
        tip = 0.5 * high - depth
        x = joined(graded(0, 0.5 * at, 4, 1.3), towards(0.5 * at, at, 6, 2), graded(at, 0.5 * (at + length), 6, 2),
                   even(0.5 * (at + length), length, 2))
        z = joined(towards(-0.5 * high, tip, 4, 2), graded(tip, 0.5 * high, 4, 2))
        if width:
            right = joined(towards(0, 0.5 * width, 3, 2), graded(0.5 * width, 0.5 * wide, 3, 2))
            y = joined([-v for v in reversed(right)], right)
        else:
            y = even(-0.5 * wide, 0.5 * wide, 4)
        self.case = Case(name, shape, [Block([x, y, z])], lambda p: p[0] <= 1e-9)
        self.case.apart = lambda p, middle: (middle[0] > at and abs(p[0] - at) < 1e-9 and p[2] > tip + 1e-9 and
                                             (not width or abs(p[1]) < 0.5 * width - 1e-9))

    def on_blade(self, p):
        return abs(p[0] - self.at) < 1e-6

    def keys(self):
        if not self.width:  # the blade reaches out of the sides
            y, length = -0.6 * self.size[1], 1.2 * self.size[1]
        else:
            y, length = -0.5 * self.width, self.width
        over = 0.1 * self.size[2]
        return {"held_plane_point": "0 0 0", "held_plane_normal": "1 0 0",
                "blade_origin": "%.9g %.9g %.9g" % (self.at, y, 0.5 * self.size[2] + over), "blade_x_axis": "0 1 0",
                "blade_y_axis": "0 0 1", "blade_length": "%.9g" % length, "blade_depth": "%.9g" % (self.depth + over),
                "mouth_place": "%.9g 0 %.9g" % (self.at, 0.5 * self.size[2])}


def make(cut, out):
    case, size = cut.case, cut.size
    with tempfile.TemporaryDirectory() as scratch:
        folder = pathlib.Path(scratch)
        coarse, coarse_u = solve(case, 1, folder)
        fine, fine_u = solve(case, 2, folder)
    counts = [round(length / 0.01) for length in size]
    shape = Mesh([Block([even(0, size[0], counts[0]), even(-0.5 * size[1], 0.5 * size[1], counts[1]),
                         even(-0.5 * size[2], 0.5 * size[2], counts[2])])], 1)
    quads = shape.surface()
    used = sorted({n for quad in quads for n in quad})
    number = {n: k + 1 for k, n in enumerate(used)}
    with open(out / (cut.shape + ".obj"), "w") as obj:
        obj.write("# made by bench/truth/calculix_cut.py; metres\n")
        for n in used:
            obj.write("v %.9g %.9g %.9g\n" % tuple(shape.places[n]))
        for a, b, c, d in quads:
            for t in ((a, b, c), (a, c, d)):
                obj.write("f %d %d %d\n" % tuple(number[n] for n in t))
    points = [shape.places[n] for n in used if not cut.on_blade(shape.places[n])]
    norm = lambda v: math.sqrt(sum(x * x for x in v))
    u = [fine.interpolated(fine_u, p) for p in points]
    before = [coarse.interpolated(coarse_u, p) for p in points]
    largest = max(map(norm, u))
    gravity = SMALL * size[0] / largest

    def opening(mesh, field):
        lips = [mesh.interpolated(field, (cut.at + side, 0.0, 0.5 * size[2])) for side in (-1e-12, 1e-12)]
        return norm([a - b for a, b in zip(*lips)])

    mouth, mouth_before = gravity * opening(fine, fine_u), gravity * opening(coarse, coarse_u)
    convergence = math.sqrt(sum(norm([a - b for a, b in zip(v, w)]) ** 2 for v, w in zip(u, before)) / len(u)) / largest
    keys = {"case": cut.name, "load": "gravity", "law": "linear elasticity", "units": "SI, the body's own frame",
            "surface": cut.shape + ".obj", "youngs_modulus": "5000", "poissons_ratio": "%g" % case.nu,
            "density": "1000", "gravity": "0 0 %.9g" % -gravity}
    keys.update(cut.keys())
    keys.update({"mouth_opening": "%.6g" % mouth, "mouth_opening_coarser": "%.6g" % mouth_before,
                 "elements": "C3D20R: %d, before %d" % (len(fine.elements), len(coarse.elements)),
                 "convergence": "%.2e" % convergence})
    with open(out / (cut.name + ".csv"), "w") as csv:
        for key, value in keys.items():
            csv.write("# %s: %s\n" % (key, value))
        csv.write("x,y,z,ux,uy,uz\n")
        for p, v in zip(points, u):
            csv.write("%.9g,%.9g,%.9g,%.6g,%.6g,%.6g\n" % (*p, *(gravity * x for x in v)))
    print("%-24s mouth %.4f of the largest displacement, before %.4f; two meshes differ by %.3f %%, %d elements" %
          (cut.name, mouth / (gravity * largest), mouth_before / (gravity * largest), 100 * convergence,
           len(fine.elements)), flush=True)


def cases():
    # The tip at parts of an eighth of the height, which is a cell's edge with eight cells of height.
    for quarters in (0, 1, 2, 3):
        bar, slab = 0.05 / 8, 0.04 / 8
        yield Cut("half_cut_%d" % quarters, "half_cut", (0.2, 0.05, 0.05), 0.1, 0.025 + 0.25 * quarters * bar)
        yield Cut("incision_%d" % quarters, "incision", (0.12, 0.08, 0.04), 0.06, 0.02 + 0.25 * quarters * slab, 0.04)
    # And the blade within a cell.
    yield Cut("half_cut_within", "half_cut", (0.2, 0.05, 0.05), 0.1 + 0.4 * 0.05 / 8, 0.025)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path(__file__).parent / "calculix")
    parser.add_argument("part", nargs="?", default="", help="of a case's name; all where left out")
    arguments = parser.parse_args()
    for cut in cases():
        if arguments.part in cut.name:
            make(cut, arguments.out)


if __name__ == "__main__":
    main()
