#!/usr/bin/env python3
"""Plays the scene of a pad with a lump: a sphere is pressed on it above the lump and beside it, and feels the difference;
a cut through the lump shows it."""
import os
import sys

import rospy
from geometry_msgs.msg import WrenchStamped

sys.path.insert(0, os.path.dirname(os.path.realpath(__file__)))
from surgery_client import Play  # noqa: E402

RADIUS = 0.010
TOP = 0.060


def force_at(surgeon, x, y, depth):
    """[N] upwards, of the pad on a sphere pressed `depth` into it."""
    surgeon.push((x, y, TOP + RADIUS + 0.005), radius=RADIUS)
    surgeon.push((x, y, TOP + RADIUS - depth), radius=RADIUS, speed=0.05)
    heard = []
    topic = rospy.Subscriber('/deformer/push/measured_cf', WrenchStamped, heard.append, queue_size=10)
    surgeon.live(1.5)
    topic.unregister()
    surgeon.lift_push()
    surgeon.live(1.0)
    return abs(heard[-1].wrench.force.z) if heard else 0.0


def scenario(surgeon, play):
    surgeon.live(1.0)
    info = [body for body in surgeon.info().bodies if body.name == 'pad'][0]
    play.check(list(info.region_materials) == ['lump'] and 0.005 < info.region_shares[0] < 0.02,
               "the lump is %.1f %% of the pad" % (100 * sum(info.region_shares)))
    above, beside = force_at(surgeon, 0.015, 0.010, 0.004), force_at(surgeon, -0.030, -0.015, 0.004)
    play.check(above > 1.2 * beside > 0.0,
               "4 mm deep, the pad pushes back with %.3f N above the lump and %.3f N beside it" % (above, beside))
    cut = surgeon.cut(pivot=(-0.2, 0.012, 0.04), reach=(1, 0, 0), normal=(0, 1, 0))
    surgeon.live(1.0)
    shares = [share for body in surgeon.info().bodies for share in body.region_shares]
    play.check(len(cut.new_bodies) == 2 and all(share > 0.003 for share in shares),
               "cut through the lump, both pieces have a part of it: %s %%"
               % ", ".join("%.1f" % (100 * share) for share in shares))


if __name__ == "__main__":
    play = Play(__doc__)
    sys.exit(play.run(scenario))
