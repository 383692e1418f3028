#!/usr/bin/env python3
"""Plays the incision scene: skin is opened along a line and spread with two locked picks."""
import os
import sys

sys.path.insert(0, os.path.dirname(os.path.realpath(__file__)))
from surgery_client import Play, distance  # noqa: E402


def scenario(surgeon, play):
    surgeon.live(1.5)
    with surgeon.still():
        before = surgeon.body("skin")
        # The skin hangs a little in its frame: the blade goes by what lies below it.
        top = max(v.z for v in before.surface.vertices if abs(v.x) < 0.04 and abs(v.y) < 0.003)
        opened = surgeon.incise(start=(-0.04, 0, top + 0.01), along=(1, 0, 0), out=(0, 0, 1), length=0.08,
                                depth=0.01 + 0.013, bodies=["skin"])
        after = surgeon.body("skin")
    play.check(opened.cut_bodies == ["skin"] and not opened.new_bodies,
               "opened the skin by %.1f cm^2 in %.1f ms" % (1e4 * opened.opened_area, 1e3 * opened.duration))
    play.check(0.8 < opened.opened_area / (0.08 * 0.013) < 1.1, "8 cm long and 13 mm deep")
    change = abs(after.volume / before.volume - 1)
    play.check(change < 1e-3, "its volume is the same to %.1e" % change)
    for side in (-1, 1):
        pick = surgeon.pick((0, 0.008 * side, top), body="skin", stiffness=400)
        p = pick.position
        surgeon.lock(pick.pick_id, (p.x, p.y + 0.012 * side, p.z))
    surgeon.live(3.0)
    spread = surgeon.body("skin")
    wound_faces = [[v for v in spread.surface.vertices if abs(v.x) < 0.004 and side * v.y > 0 and v.z > top - 0.004]
                   for side in (-1, 1)]
    gap = min(distance(a, b) for a in wound_faces[0] for b in wound_faces[1])
    play.check(gap > 0.006, "spread by two locks its wound faces are %.1f mm apart" % (1e3 * gap))
    held = [p.force.y for p in surgeon.state().picks]
    play.check(len(held) == 2 and all(abs(f) > 0.01 for f in held), "they hold it with %s N" % ", ".join(
        "%.2f" % abs(f) for f in held))
    surgeon.clear()
    surgeon.live(4.0)
    free = surgeon.body("skin")
    play.check(abs(free.volume / before.volume - 1) < 0.02, "let go it closes: volume %.2f %% of before" % (
        100 * free.volume / before.volume))


if __name__ == "__main__":
    play = Play(__doc__)
    sys.exit(play.run(scenario))
