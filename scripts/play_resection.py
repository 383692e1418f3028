#!/usr/bin/env python3
"""Plays the resection scene: a lump is marked in a liver, a plane planned around it in the rest shape, carried over to the
liver as it lies now, cut, and the cut compared with the plan."""
import os
import sys

sys.path.insert(0, os.path.dirname(os.path.realpath(__file__)))
import numpy  # noqa: E402
import rospy  # noqa: E402
from surgery_client import Play, lowest  # noqa: E402
from geometry_msgs.msg import Point  # noqa: E402
from visualization_msgs.msg import Marker, MarkerArray  # noqa: E402

# In the rest shape as the scene places it [m].
LUMP, RADIUS = (-0.068, -0.005, 0.06), 0.012
PLAN_POINT, PLAN_NORMAL = (-0.045, 0.0, 0.06), (0.9578263, 0.0, 0.2873479)


def dot(a, b):
    return sum(x * y for x, y in zip(a, b))


def height(v):
    return dot((v.x - PLAN_POINT[0], v.y - PLAN_POINT[1], v.z - PLAN_POINT[2]), PLAN_NORMAL)


def carried_over(rest, now):
    """Point and normal of the plan in the present shape: the plane nearest to where its vertices near the plan are."""
    r = numpy.array([(v.x, v.y, v.z) for v in rest])
    x = numpy.array([(v.x, v.y, v.z) for v in now])
    h = (r - numpy.array(PLAN_POINT)) @ numpy.array(PLAN_NORMAL)
    near = numpy.abs(h) < 0.01
    # x of the plan's points: the affine map from rest to present of the vertices near by.
    centre_r, centre_x = r[near].mean(axis=0), x[near].mean(axis=0)
    map_, *_ = numpy.linalg.lstsq(r[near] - centre_r, x[near] - centre_x, rcond=None)
    point = centre_x + (numpy.array(PLAN_POINT) - centre_r) @ map_
    normal = numpy.linalg.solve(map_, numpy.array(PLAN_NORMAL))
    return point, normal / numpy.linalg.norm(normal)


def mark(publisher, point, normal):
    lump = Marker(ns="lump", type=Marker.SPHERE)
    lump.header.frame_id = "world"
    lump.pose.position = Point(*LUMP)
    lump.pose.orientation.w = 1.0
    lump.scale.x = lump.scale.y = lump.scale.z = 2 * RADIUS
    lump.color.r, lump.color.g, lump.color.a = 0.9, 0.8, 0.9
    plan = Marker(ns="plan", type=Marker.ARROW)
    plan.header.frame_id = "world"
    plan.pose.orientation.w = 1.0
    plan.points = [Point(*point), Point(*(point + 0.03 * normal))]
    plan.scale.x, plan.scale.y = 0.002, 0.005
    plan.color.b, plan.color.a = 1.0, 1.0
    publisher.publish(MarkerArray(markers=[lump, plan]))


def scenario(surgeon, play):
    publisher = rospy.Publisher("resection/plan", MarkerArray, queue_size=1, latch=True)
    surgeon.live(3.0)
    with surgeon.still():
        rest, now = surgeon.body("liver", rest=True), surgeon.body("liver")
        point, normal = carried_over(rest.surface.vertices, now.surface.vertices)
        mark(publisher, point, normal)
        play.say("the plan lies at (%.3f, %.3f, %.3f) now" % tuple(point))
        # From above, reaching down: blades that pivot over the liver.
        reach = (0.0, 0.0, -1.0)
        reach = tuple(r - dot(reach, normal) * n for r, n in zip(reach, normal))
        cut = surgeon.cut(pivot=tuple(point - 1.0 * numpy.array(reach)), reach=reach, normal=tuple(normal),
                          bodies=["liver"])
        pieces = {name: surgeon.body(name, rest=True) for name in cut.new_bodies}
    play.check(len(pieces) == 2, "cut the liver into %s in %.1f ms" % (" and ".join(pieces), 1e3 * cut.duration))
    lump_side = [name for name, b in pieces.items()
                 if sum(height(v) for v in b.surface.vertices) < 0]
    play.check(len(lump_side) == 1, "the lump is in %s" % ", ".join(lump_side))
    piece = pieces[lump_side[0]]
    old = {(v.x, v.y, v.z) for v in rest.surface.vertices}
    # The vertices that the blades made.
    made = [height(v) for v in piece.surface.vertices if (v.x, v.y, v.z) not in old]
    rms = (sum(h * h for h in made) / len(made)) ** 0.5
    worst = max(abs(h) for h in made)
    play.check(rms < 0.003, "deviation from the plan: RMS %.2f mm, worst %.2f mm over %d points" % (
        1e3 * rms, 1e3 * worst, len(made)))
    margin = min(height(Point(*(c + RADIUS * n for c, n in zip(LUMP, PLAN_NORMAL)))) + 0.0, 0.0)
    play.check(-margin - worst > 0.0, "%.1f mm of tissue were planned around the lump, %.1f mm are left at the least" % (
        -1e3 * margin, 1e3 * (-margin - worst)))
    volume = 1e6 * piece.volume
    play.check(2 < volume < 0.5e6 * rest.volume, "resected %.1f ml of %.1f ml, cap %.1f cm^2" % (
        volume, 1e6 * rest.volume, 1e4 * cut.cap_area))
    surgeon.live(1.5)
    least = lowest(surgeon.body(lump_side[0]).surface.vertices)
    off, = [body.collision_distance for body in surgeon.info().bodies if body.name == lump_side[0]]
    play.check(least > -1e-4 - off, "it lies on the table, its lowest point %.3f mm over it; contact's surface is up to %.3f mm off" % (
        1e3 * least, 1e3 * off))
    play.say("real-time factor %.2f" % surgeon.state().real_time_factor)


if __name__ == "__main__":
    play = Play(__doc__)
    sys.exit(play.run(scenario))
