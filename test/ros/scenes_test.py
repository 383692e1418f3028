#!/usr/bin/env python3
"""Every scene that is shipped starts, runs, is shown, and has its view for rviz."""
import math
import os
import subprocess
import sys
import unittest

import roslib.packages
import rospkg
import rospy
import yaml
from meshless_surgery.msg import State
from visualization_msgs.msg import Marker, MarkerArray

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from deformer_support import LONG, Deformer, run  # noqa: E402

CONFIG = os.path.join(rospkg.RosPack().get_path('meshless_surgery'), 'config')


class ScenesTest(unittest.TestCase):
    """A test for each file in config/scenes is added below."""

    def check(self, scene):
        node = 'deformer_' + scene
        rospy.set_param('/%s/scene' % node, scene)
        rospy.set_param('/%s/paused' % node, True)
        binary = roslib.packages.find_node('meshless_surgery', 'deformer_node')
        process = subprocess.Popen([binary[0], '__name:=' + node])
        try:
            rospy.wait_for_service('/%s/pause' % node, LONG)
            deformer = Deformer('/' + node)
            states = deformer.recorder('state', State)
            markers = deformer.recorder('markers', MarkerArray)
            start = states.wait()
            self.assertGreater(len(start.bodies), 0)
            shown = markers.wait()
            bodies = [m for m in shown.markers if m.ns == 'bodies' and m.action == Marker.ADD]
            self.assertEqual(len(start.bodies), len(bodies))
            deformer.call('step', steps=240)  # 2 s: what falls has fallen, and is itself again
            asked = rospy.Time.now()
            later = states.next(lambda s: s.header.stamp >= asked)
            self.assertEqual(240, later.step)
            for before, after in zip(start.bodies, later.bodies):
                centre = after.centre_of_mass
                for number in (centre.x, centre.y, centre.z, after.volume, after.area, after.kinetic_energy):
                    self.assertTrue(math.isfinite(number), after.name)
                self.assertGreater(after.volume, 0.5 * before.rest_volume, after.name)
                self.assertLess(after.volume, 1.5 * before.rest_volume, after.name)
            self.assertTrue(deformer.call('pause', data=False).success)
            states.wait(lambda s: s.step > 240)
            for recorder in (states, markers):
                recorder.close()
        finally:
            process.terminate()
            process.wait(LONG)

    def test_the_scenes_of_the_paper_are_there(self):
        for scene in ('liver', 'fish', 'skin', 'block', 'pile'):
            self.assertTrue(os.path.isfile(os.path.join(CONFIG, 'scenes', scene + '.yaml')), scene)

    def test_every_scene_has_a_view(self):
        for scene in ['default'] + SCENES:
            path = os.path.join(CONFIG, 'rviz', scene + '.rviz')
            with open(path) as file:
                config = yaml.safe_load(file)
            displays = config['Visualization Manager']['Displays']
            tissue = [d for d in displays if d['Class'] == 'meshless_surgery/Tissue']
            self.assertEqual([True], [d['Enabled'] for d in tissue], scene)
            self.assertEqual(['/deformer'], [d['Node'] for d in tissue], scene)
            tools = [t['Class'] for t in config['Visualization Manager']['Tools']]
            # A scene of one's own, which has the view `default`, may have vessels.
            for tool in ('Pick', 'Push', 'Cut') + ('Clip',) * (scene in ('default', 'vessel', 'abdomen')):
                self.assertIn('meshless_surgery/' + tool, tools, scene)
            self.assertIn('meshless_surgery/Control', [p['Class'] for p in config['Panels']], scene)
            shown = {d.get('Marker Topic', d.get('Topic')): d for d in displays}
            self.assertEqual('rviz/MarkerArray', shown['/deformer/markers']['Class'], scene)
            self.assertFalse(shown['/deformer/markers']['Enabled'], scene)  # the tissue would be drawn twice
            self.assertEqual('rviz/PointCloud2', shown['/deformer/points']['Class'], scene)


SCENES = sorted(file[:-5] for file in os.listdir(os.path.join(CONFIG, 'scenes')) if file.endswith('.yaml'))
for name in SCENES:
    setattr(ScenesTest, 'test_scene_' + name, lambda self, scene=name: self.check(scene))

if __name__ == '__main__':
    run('scenes', ScenesTest)
