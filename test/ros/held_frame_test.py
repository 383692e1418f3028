#!/usr/bin/env python3
"""Tissue that is fixed to a frame of tf: it goes where the frame goes, from where both were when the run began."""
import os
import sys
import tempfile
import time
import unittest

import rospy
import tf2_ros
from geometry_msgs.msg import TransformStamped
from meshless_surgery.msg import Event

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from deformer_support import LONG, OwnNode, Recorder, run  # noqa: E402

SCENE = """
world: {gravity: [0, 0, 0], ground: none}
bodies:
  - {name: bar, primitive: {box: [0.2, 0.04, 0.04]}, material: elastic_liver, pose: {position: [0, 0, 0.5]},
     fixed: [{box: {min: [-1, -1, -1], max: [-0.07, 1, 1]}, follows: arm}]}
"""


class HeldFrameTest(unittest.TestCase):

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = folder.name
        self.scene = os.path.join(folder.name, 'scene.yaml')
        with open(self.scene, 'w', encoding='ascii') as file:
            file.write(SCENE)
        self.broadcaster = tf2_ros.TransformBroadcaster()
        self.timer = None

    def arm(self, x, y, z, quarter=False):
        """From now on it is there, with a quarter turn about z or without."""
        if self.timer:
            self.timer.shutdown()
        at = TransformStamped(child_frame_id='arm')
        at.header.frame_id = 'world'
        at.transform.translation.x, at.transform.translation.y, at.transform.translation.z = x, y, z
        at.transform.rotation.z, at.transform.rotation.w = (0.5 ** 0.5, 0.5 ** 0.5) if quarter else (0.0, 1.0)

        def send(_):
            at.header.stamp = rospy.Time.now()
            self.broadcaster.sendTransform(at)
        self.timer = rospy.Timer(rospy.Duration(0.01), send)
        self.addCleanup(self.timer.shutdown)

    def held(self, node):
        """The corner of the bar that is held, farthest from what is not."""
        vertices = node.good('get_body', name='bar').surface.vertices
        if self.corner is None:
            self.corner = min(range(len(vertices)), key=lambda n: [round(x, 4) for x in (vertices[n].x, vertices[n].y, vertices[n].z)])
        v = vertices[self.corner]
        return v.x, v.y, v.z

    def comes_to(self, node, *place):
        end = time.monotonic() + LONG
        while max(abs(a - b) for a, b in zip(self.held(node), place)) > 1e-5:
            self.assertLess(time.monotonic(), end, '%s is not %s' % (self.held(node), place))
            rospy.sleep(0.05)

    def test_it_goes_where_the_frame_goes(self):
        self.corner = None
        self.arm(1, 2, 3)
        with OwnNode(scene=self.scene, session_directory=self.folder).wait() as node:
            events = Recorder(node.name + '/events', Event)
            self.comes_to(node, -0.1, -0.02, 0.48)
            rospy.sleep(0.5)
            self.arm(1.03, 2.01, 3.02)
            self.comes_to(node, -0.07, -0.01, 0.50)
            self.arm(0, 0, 3, quarter=True)  # (x, y) from the arm's (1, 2) becomes (-y, x) from (0, 0)
            self.comes_to(node, 2.02, -1.1, 0.48)
            node.good('save', file='turned')
            self.arm(0, 0, 3.05, quarter=True)
            self.comes_to(node, 2.02, -1.1, 0.53)
            node.good('load', file='turned')  # from there on with the arm, wherever that is
            self.comes_to(node, 2.02, -1.1, 0.48)
            rospy.sleep(0.5)
            self.arm(0, 0.01, 3.05, quarter=True)
            self.comes_to(node, 2.02, -1.09, 0.48)
            node.good('reset')
            self.comes_to(node, -0.1, -0.02, 0.48)
            rospy.sleep(0.5)
            self.arm(0, 0.01, 3.07, quarter=True)
            self.comes_to(node, -0.1, -0.02, 0.50)
            self.assertNotIn(Event.CLAMP_MOVED, [event.type for event in events.messages])

    def test_a_frame_that_nobody_sends_is_said(self):
        with OwnNode(scene=self.scene).wait() as node:
            rospy.sleep(4.0)
            self.assertEqual(0, node.end(2))
            self.assertIn("entry 0 of `fixed` follows the frame 'arm', which tf does not know", node.output())


if __name__ == '__main__':
    run('held_frame', HeldFrameTest)
