#!/usr/bin/env python3
"""Plays the skin scene (Mueller et al. 2005, Fig. 6): a slab in 5 x 5 clusters, pulled up at one spot and pushed in at
another; only what is near gives way."""
import os
import sys

sys.path.insert(0, os.path.dirname(os.path.realpath(__file__)))
from surgery_client import Play, distance  # noqa: E402


def scenario(surgeon, play):
    surgeon.live(2.5)
    before = surgeon.body("skin")
    # What is held is groups of its own: those of the 16 along the rim.
    play.check(before.clusters == 25 + 16, "%d clusters" % before.clusters)
    pick = surgeon.pick((0.05, 0.05, 0.5), direction=(0, 0, -1))
    surgeon.lock(pick.pick_id, (pick.position.x, pick.position.y, pick.position.z + 0.05))
    surgeon.push((-0.05, -0.05, 0.16), radius=0.02)
    surgeon.push((-0.05, -0.05, 0.085), radius=0.02, speed=0.1)
    surgeon.live(2.0)
    after = surgeon.body("skin")
    moved = [(b.x, b.y, a.z - b.z) for b, a in zip(before.surface.vertices, after.surface.vertices)]
    near = lambda x, y: [dz for px, py, dz in moved if (px - x) ** 2 + (py - y) ** 2 < 0.015 ** 2]  # noqa: E731
    up, down = max(near(0.05, 0.05)), min(near(-0.05, -0.05))
    corner = max(abs(dz) for px, py, dz in moved if abs(px) > 0.096 and abs(py) > 0.096)
    play.check(up > 0.01, "pulled up by %.1f mm at one spot" % (1e3 * up))
    play.check(down < -0.005, "pushed in by %.1f mm at the other" % (-1e3 * down))
    play.check(corner < 1e-9, "the held rim stays: %.1e m" % corner)
    inside = min(distance(v, type(v)(-0.05, -0.05, 0.085)) for v in after.surface.vertices)
    play.check(inside >= 0.02 - 2e-4, "nothing is inside the push sphere: nearest vertex at %.2f mm" % (1e3 * inside))
    surgeon.lift_push()
    surgeon.clear()
    surgeon.live(4.0)
    back = surgeon.body("skin")
    left = max(distance(a, b) for a, b in zip(before.surface.vertices, back.surface.vertices))
    # Of the hollows that it may hang in, mirrored, which one it finds is chance.
    play.check(left < 0.01, "let go it returns to within %.1f mm" % (1e3 * left))


if __name__ == "__main__":
    play = Play(__doc__)
    sys.exit(play.run(scenario))
