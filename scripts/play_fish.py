#!/usr/bin/env python3
"""Plays the fish scene (Mueller et al. 2005, Fig. 2): a fish held bent by two locked springs, then let go."""
import os
import sys

sys.path.insert(0, os.path.dirname(os.path.realpath(__file__)))
from surgery_client import Play, distance  # noqa: E402


def scenario(surgeon, play):
    rest = surgeon.body("fish", rest=True)
    head = max(rest.surface.vertices, key=lambda v: v.x)
    tail = min(rest.surface.vertices, key=lambda v: v.x)
    length = distance(head, tail)
    picks = []
    for end in (head, tail):
        pick = surgeon.pick((end.x, end.y, end.z), body="fish", stiffness=2000)
        surgeon.lock(pick.pick_id, (0.65 * end.x, end.y, end.z))
        picks.append(pick)
    surgeon.live(10.0)  # it first bends one way and then finds the other
    bent = surgeon.body("fish")
    # Of all its girth: any one vertex may be on either side of it.
    girth = [v for v in bent.surface.vertices if abs(v.x) < 0.05 * length]
    y, z = (sum(getattr(v, axis) for v in girth) / len(girth) for axis in "yz")
    h, t = (max(bent.surface.vertices, key=lambda v: v.x), min(bent.surface.vertices, key=lambda v: v.x))
    sagitta = ((0.5 * (h.y + t.y) - y) ** 2 + (0.5 * (h.z + t.z) - z) ** 2) ** 0.5
    play.check(sagitta > 0.1 * length, "held bent: its middle lies %.0f mm off the line of its ends, %.0f mm apart of %.0f" % (
        1e3 * sagitta, 1e3 * distance(h, t), 1e3 * length))
    locked = [p for p in surgeon.state().picks if p.locked]
    play.check(len(locked) == 2, "two locks hold, with %s N" % ", ".join(
        "%.2f" % (p.force.x ** 2 + p.force.y ** 2 + p.force.z ** 2) ** 0.5 for p in locked))
    surgeon.clear()
    surgeon.live(6.0)
    free = surgeon.body("fish")
    h, t = (max(free.surface.vertices, key=lambda v: v.x), min(free.surface.vertices, key=lambda v: v.x))
    play.check(abs(free.volume / rest.rest_volume - 1) < 0.02,
               "let go it is itself again: volume %.2f %% of rest" % (100 * free.volume / rest.rest_volume))


if __name__ == "__main__":
    play = Play(__doc__)
    sys.exit(play.run(scenario))
