#!/usr/bin/env python3
"""Two stations in two namespaces do not see each other's worlds."""
import glob
import os
import re
import signal
import subprocess
import sys
import time
import unittest
from xmlrpc.client import ServerProxy

import rosgraph
import rospy
from diagnostic_msgs.msg import DiagnosticArray
from meshless_surgery.msg import State
from tf2_msgs.msg import TFMessage

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from deformer_support import LONG, TYPES, Deformer, Recorder, pose_stamped, run  # noqa: E402


class StationsTest(unittest.TestCase):

    def setUp(self):
        self.one = Deformer('/station1/deformer')
        self.two = Deformer('/station2/deformer')

    def bodies(self, station):
        states = station.recorder('state', State)
        asked = rospy.Time.now()
        names = sorted(b.name for b in states.next(lambda s: s.header.stamp >= asked).bodies)
        states.close()
        return names

    def test_each_has_its_own_world(self):
        self.assertEqual(['left', 'right'], self.bodies(self.one))
        self.assertEqual(['box'], self.bodies(self.two))
        self.assertTrue(self.one.call('remove', name='left').success)
        self.assertEqual(['right'], self.bodies(self.one))
        self.assertEqual(['box'], self.bodies(self.two))
        self.assertTrue(self.two.call('step', steps=3).success)
        self.assertAlmostEqual(1.0 / 120.0, self.one.call('step', steps=1).sim_time)

    def test_every_service_is_in_the_namespace(self):
        for station in (self.one, self.two):
            for service in TYPES:
                rospy.wait_for_service(station.node + '/' + service, 60.0)

    def test_frames_have_the_stations_prefix(self):
        heard = Recorder('/tf', TFMessage)
        for station in (self.one, self.two):
            self.assertTrue(station.call('push', enable=True, pose=pose_stamped(0, 0, 1)).success)
        for frame in ('station1/push_sphere', 'station2/push_sphere'):
            heard.wait(lambda m, frame=frame: any(t.child_frame_id == frame for t in m.transforms))
        self.assertFalse(any(t.child_frame_id == 'push_sphere' for m in heard.messages for t in m.transforms))
        heard.close()

    def test_every_topic_of_a_view_is_led_to_the_station(self):
        checkout = os.path.join(os.path.dirname(os.path.abspath(__file__)), '..', '..')
        with open(os.path.join(checkout, 'launch', 'training.launch')) as file:
            led = re.findall('<remap from="(/deformer[^"]*)"', file.read())
        named = set()
        for view in glob.glob(os.path.join(checkout, 'config', 'rviz', '*.rviz')):
            with open(view) as file:
                named.update(re.findall(r'Topic: (/deformer/\S+)', file.read()))
        self.assertIn('/deformer/markers', named)
        self.assertEqual(set(), named - set(led))

    def test_diagnostics_tell_them_apart(self):
        heard = Recorder('/diagnostics', DiagnosticArray)
        for station in ('station1', 'station2'):
            heard.wait(lambda a, station=station: any(station in s.name for s in a.status))
        heard.close()


class DeadStationTest(unittest.TestCase):

    def test_the_others_go_on(self):
        # A launch of its own, which a required node would end.
        scenes = os.path.join(os.path.dirname(os.path.abspath(__file__)), 'scenes')
        launch = subprocess.Popen(['roslaunch', os.path.join(scenes, 'two_stations.launch')], stdout=subprocess.DEVNULL,
                                  stderr=subprocess.STDOUT)
        try:
            dead, alive = Deformer('/dies/deformer'), Deformer('/lives/deformer')
            self.assertTrue(dead.call('step', steps=1).success)
            self.assertTrue(alive.call('step', steps=1).success)
            pid = ServerProxy(rosgraph.Master('/test').lookupNode(dead.node)).getPid('/test')[2]
            os.kill(pid, signal.SIGKILL)
            for _ in range(30):  # roslaunch looks ten times a second
                time.sleep(0.1)
                self.assertTrue(alive.call('step', steps=1).success)
            self.assertIsNone(launch.poll())
        finally:
            launch.send_signal(signal.SIGINT)
            launch.wait(LONG)


if __name__ == '__main__':
    run('stations', StationsTest, DeadStationTest)
