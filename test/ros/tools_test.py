#!/usr/bin/env python3
"""Streams and tf frames that move the tools, and what the tools say back."""
import math
import os
import sys
import threading

import rospy
import tf2_ros
from geometry_msgs.msg import Point, PoseStamped, WrenchStamped
from sensor_msgs.msg import JointState
from visualization_msgs.msg import Marker, MarkerArray

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from deformer_support import ACROSS_X, LONG, DeformerTestCase, Recorder, pose_stamped, run  # noqa: E402

NAN = float('nan')


class Stream:
    """Says a message again and again until it is closed, as a tracker does."""

    def __init__(self, topic, message):
        self.message = message
        self.publisher = rospy.Publisher(topic, type(message), queue_size=10)
        self.done = threading.Event()
        self.thread = threading.Thread(target=self._run)
        self.thread.start()

    def _run(self):
        while not self.done.wait(0.01):
            self.publisher.publish(self.message)

    def stop(self):
        self.done.set()
        self.thread.join()

    def close(self):
        self.stop()
        rospy.sleep(0.2)  # what is under way arrives before the next test's reset
        self.publisher.unregister()


class StreamTest(DeformerTestCase):

    def setUp(self):
        super().setUp()
        self.open = []
        self.tf = tf2_ros.Buffer()
        self.listener = tf2_ros.TransformListener(self.tf)

    def tearDown(self):
        for opened in self.open:
            opened.close()
        self.listener.unregister()
        super().tearDown()

    def stream(self, topic, message):
        opened = Stream(self.node + '/' + topic, message)
        self.open.append(opened)
        return opened

    def record(self, topic, message_type):
        opened = self.deformer.recorder(topic, message_type)
        self.open.append(opened)
        return opened

    def frame(self, name, wanted):
        end = rospy.Time.now() + rospy.Duration(LONG)
        while rospy.Time.now() < end:
            try:
                found = self.tf.lookup_transform('world', name, rospy.Time(0)).transform
                if wanted(found.translation):
                    return found
            except tf2_ros.TransformException:
                pass
            rospy.sleep(0.01)
        self.fail('no such frame: ' + name)

    def test_the_pick_in_hand_moves_and_locked_ones_do_not(self):
        locked = self.pick_left().pick_id
        self.good('lock', pick_id=locked)
        free = self.pick_left()
        measured = self.record('pick/measured_cp', PoseStamped)
        self.stream('pick/servo_cp', pose_stamped(-0.1, 0.05, 0.15))
        state = self.states.next(lambda s: any(abs(p.target.y - 0.05) < 1e-9 for p in s.picks))
        targets = {p.pick_id: p.target for p in state.picks}
        self.assertAlmostEqual(-0.1, targets[free.pick_id].x)
        self.assertNotAlmostEqual(0.05, targets[locked].y)
        pose = measured.wait(lambda m: abs(m.pose.position.y - 0.05) < 1e-9)
        self.assertEqual('world', pose.header.frame_id)
        self.frame('here/pick_cursor', lambda t: abs(t.y - 0.05) < 1e-9)

    def test_the_force_on_the_hand_is_minus_that_on_the_tissue(self):
        pick = self.pick_left().pick_id
        self.good('move_pick', pick_id=pick, target=Point(0.0, 0.0, 0.1))
        self.good('step', steps=3)
        on_tissue = self.state().picks[0].force
        self.assertGreater(on_tissue.x, 0.0)
        forces = self.record('pick/measured_cf', WrenchStamped)
        # It goes to a step's force while the next step's time passes.
        reported = forces.wait(lambda m: abs(m.wrench.force.x + on_tissue.x) < 1e-9)
        self.assertEqual('world', reported.header.frame_id)
        self.assertAlmostEqual(-on_tissue.x, reported.wrench.force.x)
        self.assertAlmostEqual(-on_tissue.y, reported.wrench.force.y)
        self.assertAlmostEqual(-on_tissue.z, reported.wrench.force.z)

    def test_the_push_sphere_appears_where_the_stream_is_and_then_travels(self):
        measured = self.record('push/measured_cp', PoseStamped)
        stream = self.stream('push/servo_cp', pose_stamped(0.0, 0.0, 1.0))
        measured.wait(lambda m: m.pose.position.z == 1.0)
        self.frame('here/push_sphere', lambda t: t.z == 1.0)
        stream.message = pose_stamped(0.0, 0.0, 2.0)
        # The target is known once a step moved the sphere; from then on at 0.5 m/s at most.
        heights = [1.0]
        for _ in range(1000):
            self.good('step', steps=1)
            now = rospy.Time.now()
            heights.append(measured.next(lambda m: m.header.stamp >= now).pose.position.z)
            if heights[-1] >= 1.1:
                break
        self.assertGreaterEqual(heights[-1], 1.1)
        for low, high in zip(heights, heights[1:]):
            self.assertLessEqual(high - low, 0.5 / 120.0 + 1e-9)

    def test_the_push_sphere_reports_the_force_of_what_it_pushes(self):
        forces = self.record('push/measured_cf', WrenchStamped)
        self.good('push', enable=True, radius=0.03, pose=pose_stamped(-0.3, 0.0, 0.1))
        self.good('push', enable=True, radius=0.03, pose=pose_stamped(-0.2, 0.0, 0.1), speed=0.3)
        for _ in range(60):
            self.good('step', steps=1)
            now = rospy.Time.now()
            if forces.next(lambda m: m.header.stamp >= now).wrench.force.x < 0.0:
                return
        self.fail('the sphere went into the box and reported nothing')

    def test_the_scissors_cut_when_the_jaw_closes(self):
        measured = self.record('scissors/measured_cp', PoseStamped)
        self.stream('scissors/servo_cp', pose_stamped(-0.19, -0.15, 0.1, ACROSS_X))
        measured.wait(lambda m: abs(m.pose.position.x + 0.19) < 1e-9)
        self.frame('here/scissors', lambda t: abs(t.x + 0.19) < 1e-9)
        jaw = self.stream('scissors/jaw/servo_js', JointState(name=['jaw'], position=[0.0]))
        # A jaw that was never open does not cut.
        markers = self.record('markers', MarkerArray)
        markers.wait(lambda a: any(m.ns == 'instruments' and m.action == Marker.ADD for m in a.markers))
        self.assertEqual(['left', 'right'], sorted(b.name for b in self.state().bodies))
        jaw.message = JointState(name=['jaw'], position=[0.4])
        # Seen by the opening of the blades that are drawn.
        def opened(array):
            blades = [m.pose.orientation for m in array.markers if m.ns == 'instruments' and 'blade' in m.mesh_resource]
            along = [(1 - 2 * (q.y ** 2 + q.z ** 2), 2 * (q.x * q.y + q.w * q.z), 2 * (q.x * q.z - q.w * q.y)) for q in blades]
            return len(along) == 2 and abs(math.dist(*along) - 2 * math.sin(0.2)) < 1e-6
        markers.next(opened)
        jaw.message = JointState(name=['jaw'], position=[0.0])
        state = self.states.next(lambda s: len(s.bodies) == 3)
        self.assertEqual(['left.1', 'left.2', 'right'], sorted(b.name for b in state.bodies))
        # And once only.
        self.assertEqual(['left.1', 'left.2', 'right'], sorted(b.name for b in self.state().bodies))

    def test_the_scissors_are_taken_away(self):
        measured = self.record('scissors/measured_cp', PoseStamped)
        stream = self.stream('scissors/servo_cp', pose_stamped(0.0, 0.0, 3.0, ACROSS_X))
        measured.wait()
        # All that it has said is heard once its last pose is.
        stream.stop()
        stream.publisher.publish(pose_stamped(0.0, 0.0, 4.0, ACROSS_X))
        measured.wait(lambda m: m.pose.position.z == 4.0)
        self.good('lift_scissors')
        lifted = rospy.Time.now()
        rospy.sleep(1.0)
        self.assertEqual([], [m for m in measured.messages if m.header.stamp > lifted])

    def test_bad_streams_change_nothing(self):
        pick = self.pick_left()
        before = self.picture()
        self.stream('pick/servo_cp', pose_stamped(NAN, 0.0, 0.0))
        self.stream('push/servo_cp', pose_stamped(0.0, float('inf'), 0.0))
        self.stream('scissors/servo_cp', pose_stamped(quaternion=(0, 0, 0, NAN)))
        self.stream('scissors/jaw/servo_js', JointState())
        from diagnostic_msgs.msg import DiagnosticArray
        diagnostics = Recorder('/diagnostics', DiagnosticArray)
        self.open.append(diagnostics)

        def refused(array):
            for status in array.status:
                values = {v.key: v.value for v in status.values}
                if all('rejected by ~' + topic in values for topic in
                       ('pick/servo_cp', 'push/servo_cp', 'scissors/servo_cp', 'scissors/jaw/servo_js')):
                    return True
            return False
        diagnostics.wait(refused)
        self.assertEqual(before, self.picture())
        self.assertEqual(pick.pick_id, self.state().picks[0].pick_id)

    def test_frames_are_sent_only_while_the_tools_exist(self):
        heard = Recorder('/tf', __import__('tf2_msgs.msg', fromlist=['TFMessage']).TFMessage)
        self.open.append(heard)
        self.good('push', enable=True, pose=pose_stamped(0.0, 0.0, 1.0))

        def has(message):
            return any(t.child_frame_id == 'here/push_sphere' for t in message.transforms)
        heard.wait(has)
        self.good('push', enable=False)
        begun = rospy.Time.now()
        rospy.sleep(1.5)
        late = [m for m in heard.messages if has(m) and m.transforms[0].header.stamp > begun]
        self.assertEqual([], late)


if __name__ == '__main__':
    run('tools', StreamTest)
