#!/usr/bin/env python3
"""Tracked tools: a stream of 200 Hz drives each of them while the world runs, with poses that jump, come late, are
missing or are no numbers; a tool whose stream falls silent is lifted off."""
import math
import os
import sys

import rospy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Point, PoseStamped
from meshless_surgery.msg import Event
from sensor_msgs.msg import JointState

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from deformer_support import ACROSS_X, DeformerTestCase, by_the_clock, pose_stamped, run  # noqa: E402

RATE = 200.0
SPEED = 0.5      # tools/pick/max_speed
TICK = 0.05      # [s] that a tool makes up for at most in one go


def distance(a, b):
    return math.sqrt((a.x - b.x) ** 2 + (a.y - b.y) ** 2 + (a.z - b.z) ** 2)


class StreamsTest(DeformerTestCase):

    def setUp(self):
        super().setUp()
        self.events = self.deformer.recorder('events', Event)
        self.good('pause', data=False)
        self.publishers = {}

    def tearDown(self):
        for publisher in self.publishers.values():
            publisher.unregister()
        self.events.close()
        super().tearDown()

    def publisher(self, topic, kind=PoseStamped):
        name = self.node + '/' + topic
        if name not in self.publishers:
            self.publishers[name] = rospy.Publisher(name, kind, queue_size=100)
            while self.publishers[name].get_num_connections() == 0:
                rospy.sleep(0.01)
        return self.publishers[name]

    def say(self, topic, poses):
        """One pose after the other, stamped, at the rate."""
        publisher, rate = self.publisher(topic), rospy.Rate(RATE)
        for pose in poses:
            if pose.header.stamp.is_zero():
                pose.header.stamp = rospy.Time.now()
            publisher.publish(pose)
            rate.sleep()

    def lifted(self, tool):
        event = self.events.wait(lambda e: e.type == 'lifted' and tool in e.text)
        self.assertIn('silent', event.text)
        return event

    def rejected(self, name):
        """How often an input was rejected, as the diagnostics say."""
        array = rospy.wait_for_message('/diagnostics', DiagnosticArray, 60)
        return sum(int(v.value) for s in array.status for v in s.values if v.key == 'rejected by ' + name)

    @by_the_clock
    def test_the_pick_follows_a_circle_and_is_let_go_when_the_stream_ends(self):
        picked = self.pick_left()
        start = picked.position
        circle = [pose_stamped(start.x, start.y + 0.02 * math.sin(a), start.z + 0.02 * (1 - math.cos(a)))
                  for a in (2 * math.pi * i / RATE for i in range(int(1.25 * RATE)))]
        self.states.wait()
        since = self.states.count()
        self.say('pick/servo_cp', circle)
        end = circle[-1].pose.position
        self.states.wait(lambda s: s.picks and distance(s.picks[0].target, end) < 1e-6, since)
        # All around, and the tissue too.
        for axis, low, high in (('y', -0.018, 0.018), ('z', 0.002, 0.038)):
            targets = [getattr(p.target, axis) - getattr(start, axis) for s in self.states.messages[since:] for p in s.picks]
            self.assertLess(min(targets), low)
            self.assertGreater(max(targets), high)
            held = [getattr(p.position, axis) - getattr(start, axis) for s in self.states.messages[since:] for p in s.picks]
            self.assertGreater(max(held), 0.4 * high)
        event = self.lifted('pick')
        self.assertEqual(picked.pick_id, event.pick_id)
        self.assertEqual([], self.state().picks)

    @by_the_clock
    def test_a_jump_is_made_at_a_bounded_speed(self):
        start = self.pick_left().position
        self.say('pick/servo_cp', [pose_stamped(start.x, start.y, start.z) for _ in range(20)])
        since = self.states.count()
        far = pose_stamped(start.x, start.y, start.z + 0.3)
        arrived = []
        while not arrived:
            self.say('pick/servo_cp', [pose_stamped(far.pose.position.x, far.pose.position.y, far.pose.position.z)
                                       for _ in range(20)])
            arrived = [s for s in self.states.messages[since:] if s.picks and s.picks[0].target.z > start.z + 0.2999]
        states = [s for s in self.states.messages[since:] if s.picks]
        for one, other in zip(states, states[1:]):
            passed = (other.header.stamp - one.header.stamp).to_sec()
            self.assertLessEqual(distance(one.picks[0].target, other.picks[0].target), SPEED * (passed + TICK) + 1e-9)
        self.assertGreater(len({s.picks[0].target.z for s in states}), 10)

    @by_the_clock
    def test_late_and_broken_messages_change_nothing(self):
        start = self.pick_left().position
        before = self.rejected('~pick/servo_cp')
        poses = []
        for i in range(100):
            now = rospy.Time.now() + rospy.Duration(i / RATE)
            good = pose_stamped(start.x, start.y + 0.01, start.z)
            good.header.stamp = now
            late = pose_stamped(start.x, start.y - 1.0, start.z)
            late.header.stamp = now - rospy.Duration(0.1)
            poses += [good, late, pose_stamped(float('nan'), start.y, start.z)]
        since = self.states.count()
        self.say('pick/servo_cp', poses)
        self.states.wait(lambda s: s.picks and abs(s.picks[0].target.y - start.y - 0.01) < 1e-6, since)
        for state in self.states.messages[since:]:
            for pick in state.picks:
                self.assertGreaterEqual(pick.target.y, start.y - 1e-6)
        self.assertEqual(200, self.rejected('~pick/servo_cp') - before)

    @by_the_clock
    def test_gaps_below_the_silence_lift_nothing(self):
        start = self.pick_left().position
        for _ in range(4):
            self.say('pick/servo_cp', [pose_stamped(start.x, start.y + 0.01, start.z)] * 5)
            rospy.sleep(0.25)  # fifty messages are missing
        self.assertEqual(1, len(self.state().picks))
        self.assertEqual([], [e for e in self.events.messages if e.type == 'lifted'])

    @by_the_clock
    def test_sphere_and_scissors_bear_late_broken_and_jumping_poses(self):
        for tool, speed in (('push', 0.5), ('scissors', 2.0)):
            topic = tool + '/servo_cp'
            before = self.rejected('~' + topic)
            measured = self.deformer.recorder(tool + '/measured_cp', PoseStamped)
            self.say(topic, [pose_stamped(0.0, 0.0, 1.0) for _ in range(20)])
            measured.wait()
            poses = []
            for i in range(60):
                good = pose_stamped(0.0, 0.0, 1.3)  # a jump
                good.header.stamp = rospy.Time.now() + rospy.Duration(i / RATE)
                late = pose_stamped(0.0, 5.0, 1.0)
                late.header.stamp = good.header.stamp - rospy.Duration(0.1)
                poses += [good, late, pose_stamped(float('nan'), 0.0, 1.0)]
            self.say(topic, poses)
            measured.wait(lambda m: m.pose.position.z > 1.2999)
            measured.close()
            self.assertEqual(120, self.rejected('~' + topic) - before)
            places = measured.messages
            self.assertEqual(0.0, max(abs(m.pose.position.y) for m in places))
            for one, other in zip(places, places[1:]):
                passed = (other.header.stamp - one.header.stamp).to_sec()
                self.assertLessEqual(other.pose.position.z - one.pose.position.z, speed * (passed + 2 * TICK) + 1e-9, tool)
            self.assertGreater(len({m.pose.position.z for m in places}), 5, tool)
            self.lifted(tool)
            self.events.messages.clear()

    @by_the_clock
    def test_a_locked_pick_and_one_that_others_move_are_not_lifted(self):
        start = self.pick_left()
        self.say('pick/servo_cp', [pose_stamped(start.position.x, start.position.y + 0.01, start.position.z)] * 20)
        self.good('lock', pick_id=start.pick_id)
        free = self.pick_left()
        self.good('move_pick', pick_id=free.pick_id, target=Point(-0.15, 0.0, 0.12))
        rospy.sleep(1.5)
        self.assertEqual({start.pick_id, free.pick_id}, {p.pick_id for p in self.state().picks})
        self.assertEqual([], [e for e in self.events.messages if e.type == 'lifted'])

    @by_the_clock
    def test_the_sphere_pushes_and_is_lifted_off(self):
        before = [b for b in self.state().bodies if b.name == 'left'][0].centre_of_mass
        self.good('push', enable=True, radius=0.03, pose=pose_stamped(-0.32, 0.0, 0.1))
        # 0.2 m/s from outside into the box.
        self.say('push/servo_cp', [pose_stamped(-0.32 + 0.2 * i / RATE, 0.0, 0.1) for i in range(int(0.5 * RATE))])
        self.events.wait(lambda e: e.type == 'touched')
        self.states.next(lambda s: [b for b in s.bodies if b.name == 'left'][0].centre_of_mass.x > before.x + 0.005)
        self.lifted('push')
        measured = self.deformer.recorder('push/measured_cp', PoseStamped)
        rospy.sleep(0.5)
        measured.close()
        self.assertEqual(0, measured.count())

    @by_the_clock
    def test_a_sphere_that_a_service_placed_stays(self):
        self.say('push/servo_cp', [pose_stamped(0.0, 0.0, 1.0)] * 20)
        self.good('push', enable=True, pose=pose_stamped(0.0, 0.0, 1.2))
        rospy.sleep(1.5)
        measured = self.deformer.recorder('push/measured_cp', PoseStamped)
        self.assertEqual(1.2, measured.wait().pose.position.z)
        measured.close()
        self.assertEqual([], [e for e in self.events.messages if e.type == 'lifted'])

    @by_the_clock
    def test_the_scissors_come_close_cut_once_and_are_lifted_off(self):
        jaw = self.publisher('scissors/jaw/servo_js', JointState)
        poses, rate = self.publisher('scissors/servo_cp'), rospy.Rate(RATE)
        count = int(1.5 * RATE)
        for i in range(count):
            pose = pose_stamped(-0.19, -0.15 - 0.3 * max(0.0, 1.0 - 2.0 * i / count), 0.1, ACROSS_X)
            pose.header.stamp = rospy.Time.now()
            poses.publish(pose)
            opening = 0.6 if i < count / 2 else 0.6 * max(0.0, 1.0 - 3.0 * (i - count / 2) / count)
            jaw.publish(JointState(name=['jaw'], position=[opening]))
            rate.sleep()
        self.events.wait(lambda e: e.type == 'cut')
        self.assertEqual({'left.1', 'left.2', 'right'}, {b.name for b in self.state().bodies})
        self.lifted('scissors')
        measured = self.deformer.recorder('scissors/measured_cp', PoseStamped)
        rospy.sleep(0.5)
        measured.close()
        self.assertEqual(0, measured.count())
        self.assertEqual(1, len([e for e in self.events.messages if e.type == 'cut']))


if __name__ == '__main__':
    run('streams', StreamsTest)
