#!/usr/bin/python3
"""How stiff a layer bends that lies askew in its cells: a plate of 6 x 30 mm, 60 mm of it free, sticks out of a cube of
60 mm, along whose faces the lattice lies, at an angle to them, and is pressed by its weight. Prints how many times as
stiff as a beam it is, by angle, spacing and where the lattice lies. Needs a roscore:

    source scripts/setup.bash
    bench/slanted_layer.py
"""
import argparse
import os
import tempfile

import numpy
import rospy
from meshless_surgery.testing import RunningScene

THICKNESS, WIDTH = 0.006, 0.0302  # [m]
YOUNG, DENSITY = 1e4, 1000.0      # [Pa], [kg/m^3]
SINKS = 0.018                     # of its length: so far a beam would
SCENE = """world: {ground: none, gravity: [0, 0, 0], contact: none, sleep: false}
bodies:
  - name: plate
    file: plate.stl
    spacing: %g
    material: {youngs_modulus: %g, poissons_ratio: 0, density: %g, damping: 10}
    fixed: [{plane: {point: [%.9g, 0, %.9g], normal: [%.9g, 0, %.9g]}}]
"""


def box(low, high, parts):
    """Triangles of a closed box, so many squares along each axis."""
    triangles = []
    for axis in range(3):
        u, v = [other for other in range(3) if other != axis]
        for side in (0, 1):
            i, j = numpy.mgrid[0:parts[u], 0:parts[v]].reshape(2, -1)
            corners = []
            for di, dj in ((0, 0), (1, 0), (1, 1), (0, 1)):
                place = numpy.empty((i.size, 3))
                place[:, axis] = (low, high)[side][axis]
                place[:, u] = low[u] + (high[u] - low[u]) * (i + di) / parts[u]
                place[:, v] = low[v] + (high[v] - low[v]) * (j + dj) / parts[v]
                corners.append(place)
            for order in ((0, 1, 2), (0, 2, 3)):
                if (axis == 1) == bool(side):
                    order = order[::-1]
                triangles.append(numpy.stack([corners[k] for k in order], 1))
    return numpy.concatenate(triangles)


def write(name, triangles):
    data = numpy.zeros(len(triangles), [('normal', '<3f4'), ('corners', '<f4', (3, 3)), ('unused', '<u2')])
    data['corners'] = triangles
    with open(name, 'wb') as file:
        file.write(bytes(80) + numpy.uint32(len(data)).tobytes() + data.tobytes())


def stiffness(folder, angle, spacing, beside, cube, free):
    """Over that of a beam. The plate's middle is `beside` the cube's, by a part of the spacing."""
    root = 5 / 6 * cube                               # from the cube's middle to where the plate is free
    gravity = SINKS * YOUNG * THICKNESS ** 2 / (1.5 * DENSITY * free ** 3)
    along = numpy.array((numpy.cos(angle), 0.0, numpy.sin(angle)))
    across = numpy.array((-numpy.sin(angle), 0.0, numpy.cos(angle)))
    turn = numpy.stack((along, (0, 1, 0), across))
    shift = beside * spacing * across
    plate = box((0.001, -WIDTH / 2, -THICKNESS / 2), (root + free, WIDTH / 2, THICKNESS / 2), (36, 10, 2)) @ turn + shift
    block = box((-cube / 2,) * 3, (cube / 2,) * 3, (10, 10, 10))
    write(os.path.join(folder, 'plate.stl'), numpy.concatenate((block, plate)))
    held = root * along
    with open(os.path.join(folder, 'scene.yaml'), 'w') as file:
        file.write(SCENE % (spacing, YOUNG, DENSITY, held[0], held[2], along[0], along[2]))
    scene = RunningScene(os.path.join(folder, 'scene.yaml'), listens=False)
    try:
        surgeon = scene.surgeon

        def places(at_rest):
            return numpy.array([(v.x, v.y, v.z) for v in surgeon.body('plate', at_rest).surface.vertices])
        rest = places(True)
        end = rest @ along > root + free - 1e-4
        surgeon.set_gravity(tuple(-gravity * across))
        sunk, before = 0.0, -1.0
        for _ in range(30):                           # until it rests
            surgeon.live(2.0)
            now = places(False)
            before, sunk = sunk, ((rest - now) @ across)[end].mean()
            if abs(sunk - before) < 1e-3 * sunk:
                break
    finally:
        scene.close()
    return SINKS * free / sunk


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--angles', type=float, nargs='+', default=[0.0, 30.0, 45.0], help='[degrees]')
    parser.add_argument('--spacings', type=float, nargs='+', default=[0.5, 1.0, 1.5, 2.0], help='in thicknesses')
    parser.add_argument('--beside', type=float, nargs='+', default=[0.0, 0.25, 0.5], help='in spacings')
    parser.add_argument('--cube', type=float, default=0.06, help='[m] its edge')
    parser.add_argument('--free', type=float, default=0.06, help='[m] of the plate')
    options = parser.parse_args()
    rospy.init_node('slanted_layer')
    print('angle  spacing over thickness  times as stiff as a beam, by where the lattice lies', flush=True)
    with tempfile.TemporaryDirectory() as folder:
        for angle in options.angles:
            for spacing in options.spacings:
                found = [stiffness(folder, numpy.radians(angle), spacing * THICKNESS, beside, options.cube, options.free)
                         for beside in options.beside]
                print('%5.0f  %22.2f  %s' % (angle, spacing, '  '.join('%.2f' % value for value in found)), flush=True)


if __name__ == '__main__':
    main()
