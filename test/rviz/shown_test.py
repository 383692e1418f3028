#!/usr/bin/env python3
"""The training launch, with rviz on a virtual display and the scene's own configuration, shows the tissue where it is: the
middles of triangles, projected by the configuration's camera, have the tissue's colour in the picture, and another one
once the body is removed."""
import os
import sys
import unittest

import numpy
import rospy
import rostest

sys.path.insert(0, os.path.dirname(os.path.realpath(__file__)))
from rviz_view import BACKGROUND, configured_view, project, view_rectangle  # noqa: E402
from virtual_display import VirtualDisplay, stop, wait_until  # noqa: E402

from meshless_surgery.srv import GetBody, Remove  # noqa: E402
from std_srvs.srv import SetBool  # noqa: E402
from visualization_msgs.msg import MarkerArray  # noqa: E402


def call(service, kind, **fields):
    name = '/deformer/' + service
    rospy.wait_for_service(name, 60)
    reply = rospy.ServiceProxy(name, kind)(**fields)
    assert reply.success, reply.message
    return reply


def has_colour(pixels, colour):
    """Which pixels are the colour in some light, and not the background."""
    pixels = pixels.astype(float)
    length = numpy.linalg.norm(pixels, axis=1)
    along = pixels.dot(colour) / numpy.linalg.norm(colour)
    empty = (numpy.abs(pixels - BACKGROUND) < 12).all(axis=1)
    return (along > 0.95 * length) & ~empty


class ShownTest(unittest.TestCase):
    def test_tissue_is_shown_where_it_is(self):
        scene, body = rospy.get_param('~scene'), rospy.get_param('~body')
        view = configured_view(scene)
        display = VirtualDisplay()
        self.addCleanup(display.close)
        launch = display.start_rviz(['roslaunch', 'meshless_surgery', 'training.launch', 'scene:=' + scene],
                                    lambda: view_rectangle(display.screenshot()) is not None)
        self.addCleanup(stop, launch)
        call('pause', SetBool, data=True)
        surface = call('get_body', GetBody, name=body).surface
        vertices = numpy.array([[v.x, v.y, v.z] for v in surface.vertices])
        middles = vertices[numpy.array([t.vertex_indices for t in surface.triangles])].mean(axis=1)
        array = rospy.wait_for_message('/deformer/markers', MarkerArray, 60)
        marker = [m for m in array.markers if m.ns == 'bodies'][0]
        colour = numpy.array([marker.color.r, marker.color.g, marker.color.b])

        def pixels_of_tissue(picture):
            rectangle = view_rectangle(picture)
            if rectangle is None or rectangle[1] - rectangle[0] < 300 or rectangle[3] - rectangle[2] < 300:
                return None
            pixels = project(middles, view, rectangle)
            top, bottom, left, right = rectangle
            seen = pixels[(pixels[:, 0] >= top) & (pixels[:, 0] < bottom) & (pixels[:, 1] >= left) & (pixels[:, 1] < right)]
            if len(seen) < 0.9 * len(pixels):
                return None
            return picture[seen[:, 0], seen[:, 1]].astype(int)

        def share_shown():
            pixels = pixels_of_tissue(display.screenshot())
            return 0.0 if pixels is None else has_colour(pixels, colour).mean()

        shown = wait_until(lambda: share_shown() > 0.9, 90)
        file = os.path.join(os.environ.get('ROS_HOME', '/tmp'), 'shown_%s.png' % scene)
        display.save(file)
        print('picture: %s, share of triangles shown where they are: %.3f' % (file, share_shown()))
        self.assertTrue(shown, 'only %.0f %% of the triangles have the tissue\'s colour' % (100 * share_shown()))

        before = pixels_of_tissue(display.screenshot())
        call('remove', Remove, name=body)

        # The colour alone does not tell: lines of the grid can be of a pale tissue's.
        def share_changed():
            after = pixels_of_tissue(display.screenshot())
            return 0.0 if after is None or len(after) != len(before) else (numpy.abs(after - before).max(axis=1) > 12).mean()

        self.assertTrue(wait_until(lambda: share_changed() > 0.9, 30), 'a removed body is still shown')


if __name__ == '__main__':
    rospy.init_node('shown_test')
    rostest.rosrun('meshless_surgery', 'shown', ShownTest, sys.argv)
