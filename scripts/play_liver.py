#!/usr/bin/env python3
"""Plays the liver scene: pick and lift a lobe, lock it, push the other one, cut the lobe off."""
import os
import sys

sys.path.insert(0, os.path.dirname(os.path.realpath(__file__)))
from surgery_client import Play, distance  # noqa: E402
from geometry_msgs.msg import Point  # noqa: E402


def scenario(surgeon, play):
    surgeon.live(1.0)
    liver = surgeon.body("liver")
    play.say("liver: %d triangles, %d clusters, %.0f g, %.1f ml of %.1f ml at rest" % (
        len(liver.surface.triangles), liver.clusters, 1e3 * liver.mass, 1e6 * liver.volume, 1e6 * liver.rest_volume))

    tip = min(liver.surface.vertices, key=lambda v: v.x)
    pick = surgeon.pick((tip.x, tip.y, tip.z))
    play.say("picked particle %d at (%.3f, %.3f, %.3f)" % (pick.particle, pick.position.x, pick.position.y,
                                                            pick.position.z))
    surgeon.lock(pick.pick_id, (pick.position.x, pick.position.y, pick.position.z + 0.06))
    surgeon.live(1.5)
    lifted = [p for p in surgeon.state().picks if p.pick_id == pick.pick_id][0]
    play.check(lifted.locked and lifted.position.z > pick.position.z + 0.02,
               "the lobe is lifted by %.0f mm and held with %.2f N" % (
                   1e3 * (lifted.position.z - pick.position.z), lifted.force.z))

    right = max(surgeon.body("liver").surface.vertices, key=lambda v: v.x)
    surgeon.push((right.x + 0.04, right.y, right.z), radius=0.015)
    centre = (right.x - 0.01, right.y, right.z)
    surgeon.push(centre, radius=0.015, speed=0.1)
    surgeon.live(1.0)
    nearest = min(distance(v, Point(*centre)) for v in surgeon.body("liver").surface.vertices)
    off = surgeon.info().bodies[0].collision_distance
    play.check(nearest >= 0.015 - 2e-3 - off,  # 1 % of the liver
               "the push sphere is not entered: nearest vertex at %.2f mm of 15 mm; contact's surface is up to %.2f mm off" % (
                   1e3 * nearest, 1e3 * off))
    surgeon.lift_push()
    surgeon.live(0.5)

    with surgeon.still():
        before = surgeon.body("liver")
        xs = [v.x for v in before.surface.vertices]
        cut = surgeon.cut(pivot=(min(xs) + 0.3 * (max(xs) - min(xs)), -1, 0.1), reach=(0, 1, 0), normal=(1, 0, 0.2))
        after = [surgeon.body(name) for name in cut.new_bodies]
    mass = abs(sum(b.mass for b in after) / before.mass - 1)
    volume = abs(sum(b.volume for b in after) / before.volume - 1)
    play.check(len(after) >= 2 and mass < 1e-9 and volume < 5e-4,
               "cut %s into %s in %.1f ms; cap %.1f cm^2; masses add up to %.1e, volumes to %.1e" % (
                   cut.cut_bodies[0], ", ".join(cut.new_bodies), 1e3 * cut.duration, 1e4 * cut.cap_area, mass, volume))
    surgeon.live(1.5)
    state = surgeon.state()
    holder = [p for p in state.picks if p.pick_id == pick.pick_id][0].body
    play.check(holder in cut.new_bodies, "the spring followed its piece: %s" % holder)
    surgeon.clear()
    surgeon.live(1.0)
    play.check(not surgeon.state().picks, "all springs are let go")
    play.say("real-time factor %.2f" % surgeon.state().real_time_factor)


if __name__ == "__main__":
    play = Play(__doc__)
    sys.exit(play.run(scenario))
