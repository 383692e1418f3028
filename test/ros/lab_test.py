#!/usr/bin/env python3
"""lab.launch: two stations with a machine each, their diagnostics, and what record.launch records of one."""
import glob
import os
import signal
import subprocess
import sys
import tempfile
import time
import unittest

import numpy
import rosbag
import rospkg
import rospy
import yaml
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from deformer_support import LONG, Deformer, Recorder, pose_stamped, run  # noqa: E402
from meshless_surgery.surfaces import SurfaceReader  # noqa: E402

SCENES = os.path.join(os.path.dirname(os.path.abspath(__file__)), 'scenes')


class LabTest(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.launch = subprocess.Popen(
            ['roslaunch', 'meshless_surgery', 'lab.launch', 'rviz:=false', 'paused:=true', 'record:=true',
             'scene1:=' + os.path.join(SCENES, 'boxes.yaml'), 'scene2:=' + os.path.join(SCENES, 'falling.yaml')],
            env=dict(os.environ, ROS_HOME=cls.folder.name), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        cls.stations = [Deformer('/station%d/deformer' % number) for number in (1, 2)]
        for station in cls.stations:
            rospy.wait_for_service(station.node + '/load', LONG)

    @classmethod
    def tearDownClass(cls):
        cls.launch.send_signal(signal.SIGINT)
        cls.launch.wait(LONG)
        cls.folder.cleanup()

    def test_the_aggregators_groups_are_what_the_stations_say(self):
        with open(os.path.join(rospkg.RosPack().get_path('meshless_surgery'), 'config', 'diagnostics.yaml')) as file:
            analyzers = yaml.safe_load(file)['analyzers']
        heard = Recorder('/diagnostics', DiagnosticArray)
        for number in (1, 2):
            begin = analyzers['station%d' % number]['startswith'][0]
            heard.wait(lambda array, begin=begin: any(s.name.startswith(begin) for s in array.status))
        groups = [[name for name, a in analyzers.items() if s.name.startswith(tuple(a['startswith']))]
                  for array in heard.messages for s in array.status]
        self.assertEqual([], [g for g in groups if len(g) != 1])
        heard.close()

    def test_what_was_recorded_shows_the_station_again(self):
        station = self.stations[0]
        stream = rospy.Publisher(station.node + '/push/servo_cp', PoseStamped, queue_size=10)
        end = time.monotonic() + LONG
        while stream.get_num_connections() < 2:  # the node, and who records
            self.assertLess(time.monotonic(), end, 'nobody records the stream')
            time.sleep(0.05)
        measured = Recorder(station.node + '/push/measured_cp', PoseStamped)
        stream.publish(pose_stamped(0.0, 0.0, 1.0))
        measured.wait(lambda m: m.pose.position.z == 1.0)
        answer = station.call('cut', blades=pose_stamped(-0.2, -1.0, 0.1, (0.5, 0.5, 0.5, 0.5)), bodies=['left'])
        self.assertTrue(answer.success, answer.message)
        volumes = {name: station.call('get_body', name=name).volume for name in ('left.1', 'left.2', 'right')}
        time.sleep(2.0)  # until all of it has been said and recorded
        recorder = subprocess.run(['rosnode', 'kill', '/station1/record'], stdout=subprocess.DEVNULL, check=True)
        self.assertEqual(0, recorder.returncode)
        pattern = os.path.join(self.folder.name, 'station1_*.bag')
        while not glob.glob(pattern):
            self.assertLess(time.monotonic(), end, os.listdir(self.folder.name))
            time.sleep(0.1)
        reader, topics = SurfaceReader(), set()
        with rosbag.Bag(glob.glob(pattern)[0]) as bag:
            for topic, message, _ in bag.read_messages():
                topics.add(topic)
                reader.hear(message)
        for name in ('info', 'topology', 'vertices', 'state', 'events', 'push/servo_cp', 'push/measured_cp',
                     'push/operating_state'):
            self.assertIn(station.node + '/' + name, topics)
        self.assertIn('/diagnostics', topics)
        surfaces = reader.surfaces()
        self.assertEqual(sorted(volumes), sorted(surfaces))
        for name, surface in surfaces.items():
            a, b, c = (surface.vertices[surface.triangles[:, k]] for k in range(3))
            volume = float((a * numpy.cross(b, c)).sum() / 6.0)
            self.assertAlmostEqual(volumes[name], volume, delta=1e-3 * volumes[name])


if __name__ == '__main__':
    run('lab', LabTest)
