#!/usr/bin/env python3
"""Parameters: what they change, and that the node says what is wrong with them and ends."""
import os
import subprocess
import sys
import tempfile
import time
import unittest

import genpy
import roslib.message
import roslib.packages
import rospy
import tf2_ros
from geometry_msgs.msg import Point, PoseStamped, TransformStamped
from meshless_surgery.msg import State
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import MarkerArray

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from deformer_support import LONG, Deformer, Recorder, header, pose_stamped, run  # noqa: E402

SCENES = os.path.join(os.path.dirname(os.path.abspath(__file__)), 'scenes')
BOXES = os.path.join(SCENES, 'boxes.yaml')


class Node:
    """A deformer_node of its own, with these private parameters; stopped at the end of the block."""

    count = 0

    def __init__(self, **parameters):
        Node.count += 1
        self.name = 'deformer%d' % Node.count
        for key, value in parameters.items():
            rospy.set_param('/%s/%s' % (self.name, key.replace('__', '/')), value)
        binary = roslib.packages.find_node('meshless_surgery', 'deformer_node')
        self.log = tempfile.TemporaryFile(mode='w+')
        self.process = subprocess.Popen([binary[0], '__name:=' + self.name], stdout=self.log, stderr=self.log)

    def output(self):
        self.log.seek(0)
        return self.log.read()

    def __enter__(self):
        deformer = Deformer('/' + self.name)
        rospy.wait_for_service('/%s/pause' % self.name, LONG)
        return deformer

    def __exit__(self, *unused):
        self.process.terminate()
        self.process.wait(LONG)
        self.log.close()


class RefusalTest(unittest.TestCase):

    def refused(self, words, **parameters):
        node = Node(**parameters)
        code = node.process.wait(LONG)
        said = node.output()
        node.log.close()
        self.assertNotEqual(0, code, said)
        for word in words:
            self.assertIn(word, said)

    def test_scenes(self):
        self.refused(['no_such_scene', 'accepted'], scene='no_such_scene')
        self.refused(['~data_folders', "'[/tmp]'", 'one without brackets'], scene=BOXES, data_folders='[/tmp]')
        self.refused(['/no/such/file.yaml'], scene='/no/such/file.yaml')
        self.refused(['scene'], scene='')
        self.refused(['broken.yaml:2', 'step_rat', 'step_rate'], scene=os.path.join(SCENES, 'broken.yaml'))
        self.refused(['package://no_such_package/x.yaml'], scene='package://no_such_package/x.yaml')

    def test_numbers(self):
        for key, bad, word in (('markers_rate', 31.0, '30'), ('markers_rate', 0, '0.1'), ('state_rate', -1.0, '-1'),
                               ('points_rate', float('nan'), 'nan'), ('tools_rate', float('inf'), 'inf'),
                               ('max_backlog', -0.1, '-0.1'), ('tools__push__max_speed', 0.0, '0'),
                               ('tools__push__radius', -1.0, '-1'), ('tools__pick__stiffness', float('nan'), 'nan'),
                               ('tools__pick__max_distance', 0.0, '0'), ('tools__scissors__length', 0.0, '0')):
            self.refused(['~' + key.replace('__', '/'), word, 'accepted'], scene=BOXES, **{key: bad})

    def test_types(self):
        self.refused(['~state_rate', 'a number'], scene=BOXES, state_rate='fast')
        self.refused(['~paused', 'true or false'], scene=BOXES, paused=1)
        self.refused(['~scene', 'a string'], scene=[1, 2])
        self.refused(['~data_folders', 'list'], scene=BOXES, data_folders=3)

    def test_folders_and_frames(self):
        self.refused(['/no/such/folder'], scene=BOXES, data_folders=['/no/such/folder'])
        self.refused(['~world_frame'], scene=BOXES, world_frame='')
        for name in ('world_frame', 'tf_prefix', 'tools__pick__follow_frame'):
            self.refused(['~' + name.replace('__', '/'), "is '//'", "accepted: a frame's name"], scene=BOXES, **{name: '//'})


class EffectTest(unittest.TestCase):

    def test_world_frame(self):
        with Node(scene=BOXES, paused=True, world_frame='table') as deformer:
            states = deformer.recorder('state', State)
            self.assertEqual('table', states.wait().header.frame_id)
            markers = deformer.recorder('markers', MarkerArray)
            self.assertEqual({'table'}, {m.header.frame_id for m in markers.wait().markers})
            picked = deformer.call('pick', header=header('table'), point=Point(-0.15, 0.0, 0.1))
            self.assertTrue(picked.success, picked.message)
            refused = deformer.call('pick', header=header('world'), point=Point(-0.15, 0.0, 0.1))
            self.assertFalse(refused.success)
            self.assertIn("'world'", refused.message)
            for recorder in (states, markers):
                recorder.close()

    def frames_of(self, message):
        """All names of frames in it, of lists of numbers and points none."""
        if isinstance(message, list) and message and hasattr(message[0], 'header'):
            return [frame for one in message for frame in self.frames_of(one)]
        if not isinstance(message, genpy.Message):
            return []
        named = [getattr(message, slot) for slot in message.__slots__ if slot in ('frame_id', 'child_frame_id', 'world_frame')]
        return named + [frame for slot in message.__slots__ for frame in self.frames_of(getattr(message, slot))]

    def test_no_frame_is_published_with_a_slash_before_its_name(self):
        # As tf1 wrote them, and as people still do. tf2 and rviz do not know such a name.
        with Node(scene=BOXES, world_frame='/table', tf_prefix='/left', tools__push__follow_frame='/ball') as deformer:
            heard = []
            kinds = {topic: roslib.message.get_message_class(kind) for topic, kind in rospy.get_published_topics(deformer.node)}
            kinds['/tf'] = TFMessage
            for topic, kind in kinds.items():
                if kind:  # not of crtk_msgs, which need not be there
                    heard.append(Recorder(topic, kind, wait=topic != '/tf'))
            picked = deformer.call('pick', header=header('//table'), point=Point(-0.15, 0.0, 0.1))
            self.assertTrue(picked.success, picked.message)
            ball = TransformStamped(header=header('/table'), child_frame_id='/ball')
            ball.transform.translation.z, ball.transform.rotation.w = 1.0, 1.0
            broadcaster = tf2_ros.TransformBroadcaster()
            wanted = {'state', 'markers', 'points', 'surfaces', 'topology', 'vertices', 'info', 'events', 'clusters', 'contacts', 'contact_forces', 'task',
                      'pick/measured_cp', 'pick/measured_cf', 'push/measured_cp', 'push/setpoint_cp', 'left/pick_cursor',
                      'left/push_sphere'}
            found, end = set(), time.monotonic() + LONG
            while not wanted <= found:
                self.assertLess(time.monotonic(), end, wanted - found)
                ball.header.stamp = rospy.Time.now()
                broadcaster.sendTransform(ball)
                time.sleep(0.02)
                for recorder in heard:
                    for message in recorder.messages[-1:]:
                        if recorder.topic == '/tf':
                            found.update(t.child_frame_id for t in message.transforms)
                            continue
                        for frame in self.frames_of(message):
                            self.assertIn(frame, ('table', ''), recorder.topic)  # '': those of actions are of no place
                            found.update([recorder.topic[len(deformer.node) + 1:]] if frame else [])
            self.assertLessEqual({name for name in found if name.startswith('/')}, {'/ball'})
            for recorder in heard:
                recorder.close()

    def test_tool_defaults(self):
        with Node(scene=BOXES, paused=True, tools__pick__max_distance=0.2, tools__push__radius=0.07) as deformer:
            far = deformer.call('pick', point=Point(0.0, 0.0, 0.1))  # 0.15 m from both boxes
            self.assertTrue(far.success, far.message)
            markers = deformer.recorder('markers', MarkerArray)
            self.assertTrue(deformer.call('push', enable=True, pose=pose_stamped(0, 0, 1)).success)
            shown = markers.wait(lambda a: any(m.ns == 'tools' and m.id == 2 for m in a.markers))
            sphere = [m for m in shown.markers if m.ns == 'tools' and m.id == 2][0]
            self.assertAlmostEqual(0.14, sphere.scale.x)
            markers.close()

    def test_data_folders_allow_reading_there_and_nowhere_else(self):
        obj = open(os.path.join(SCENES, 'tetrahedron.obj')).read()
        with tempfile.TemporaryDirectory() as allowed, tempfile.TemporaryDirectory() as other:
            for folder in (allowed, other):
                with open(os.path.join(folder, 'shape.obj'), 'w') as file:
                    file.write(obj)
            os.symlink(os.path.join(other, 'shape.obj'), os.path.join(allowed, 'link.obj'))
            with Node(scene=BOXES, paused=True, data_folders=[allowed]) as deformer:
                def spawn(path):
                    return deformer.call('spawn', file=path, pose=pose_stamped(0, 0, 1))
                good = spawn(os.path.join(allowed, 'shape.obj'))
                self.assertTrue(good.success, good.message)
                for bad in (os.path.join(other, 'shape.obj'), os.path.join(allowed, 'link.obj'),
                            os.path.join(allowed, '..', os.path.basename(other), 'shape.obj')):
                    answer = spawn(bad)
                    self.assertFalse(answer.success, bad)

    def test_it_runs_unless_paused(self):
        with Node(scene=BOXES) as deformer:
            states = deformer.recorder('state', State)
            states.wait(lambda s: s.step > 0)
            states.close()

    def test_a_misspelt_parameter_is_named(self):
        node = Node(scene=BOXES, paused=True, state_rat=10.0)
        with node:
            self.assertIn('~state_rat', node.output())

    def test_no_other_frame_no_tf(self):
        with Node(scene=BOXES, paused=True) as deformer:
            self.assertTrue(deformer.call('pick', header=header('world'), point=Point(-0.15, 0.0, 0.1)).success)
            import rosgraph
            me = rosgraph.Master('/parameters_test')

            def listens():
                _, subscribers, _ = me.getSystemState()
                return [nodes for topic, nodes in subscribers if topic == '/tf' and deformer.node in nodes]
            self.assertEqual([], listens())
            self.assertFalse(deformer.call('pick', header=header('no_such_frame')).success)
            self.assertNotEqual([], listens())

    def test_the_measured_topics_exist_for_each_tool(self):
        with Node(scene=BOXES, paused=True) as deformer:
            for tool in ('pick', 'push', 'scissors'):
                recorder = Recorder('%s/%s/measured_cp' % (deformer.node, tool), PoseStamped)
                recorder.close()


if __name__ == '__main__':
    run('parameters', RefusalTest, EffectTest)
