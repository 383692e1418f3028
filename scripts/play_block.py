#!/usr/bin/env python3
"""Plays the block scene (Mueller et al. 2005, Fig. 7): a block of 32 triangles falls, is cut in two, the halves roll
apart, and are cut again."""
import os
import sys

sys.path.insert(0, os.path.dirname(os.path.realpath(__file__)))
from surgery_client import Play  # noqa: E402


def named(state, name):
    return [b for b in state.bodies if b.name == name][0]


def scenario(surgeon, play):
    block = surgeon.body("block")
    play.check(block.tetrahedra > 0, "the block has %d tetrahedra" % block.tetrahedra)
    surgeon.live(0.1)
    with surgeon.still():
        before = surgeon.body("block")
        centre = named(surgeon.state(), "block").centre_of_mass
        cut = surgeon.cut(pivot=(centre.x, centre.y - 1, centre.z), reach=(0, 1, 0), normal=(1, 0, 0.35))
        pieces = [surgeon.body(n) for n in cut.new_bodies]
    difference = abs(sum(p.volume for p in pieces) / before.volume - 1)
    play.check(len(pieces) == 2 and difference < 1e-9,
               "cut in two in the air: volumes add up to %.1e, masses to %.1e" % (
                   difference, abs(sum(p.mass for p in pieces) / before.mass - 1)))
    surgeon.live(3.0)
    state = surgeon.state()
    first, second = (named(state, n).centre_of_mass for n in cut.new_bodies)
    apart = ((first.x - second.x) ** 2 + (first.y - second.y) ** 2) ** 0.5
    play.check(apart > 0.03, "the halves lie %.0f mm apart" % (1e3 * apart))
    names = []
    for name in cut.new_bodies:
        with surgeon.still():
            whole = surgeon.body(name)
            centre = named(surgeon.state(), name).centre_of_mass
            again = surgeon.cut(pivot=(centre.x - 1, centre.y, centre.z), reach=(1, 0, 0), normal=(0, 1, 0),
                                bodies=[name])
            parts = [surgeon.body(n) for n in again.new_bodies]
        difference = abs(sum(p.volume for p in parts) / whole.volume - 1)
        play.check(difference < 1e-3, "%s cut again into %s: volumes add up to %.1e" % (
            name, ", ".join(again.new_bodies), difference))
        names += again.new_bodies
    surgeon.live(3.0)
    state = surgeon.state()
    play.check(sorted(b.name for b in state.bodies) == sorted(names), "%d quarters are left" % len(names))
    for b in state.bodies:
        play.check(abs(b.volume / b.rest_volume - 1) < 0.5 and b.centre_of_mass.z > 0,
                   "%s keeps %.0f %% of its volume above the ground" % (b.name, 100 * b.volume / b.rest_volume))


if __name__ == "__main__":
    play = Play(__doc__)
    sys.exit(play.run(scenario))
