#!/usr/bin/env python3
"""The force on a hand: even and frequent whatever the step rate, reported before the next step, without jumps, and gone
once the tool is free. By a clock that the test moves; force_stream_test.cpp has the same laws in a time of its own, with nodes that
stand still. On the wall's clock only what a standstill cannot break."""
import math
import os
import sys
import time

import rospy
from geometry_msgs.msg import PoseStamped, WrenchStamped

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from deformer_support import LONG, DeformerTestCase, InStepTestCase, pose_stamped, run  # noqa: E402

PERIOD = 0.002     # [s] of measured_cf, and of the hand's messages


def force(message):
    f = message.wrench.force
    return math.sqrt(f.x ** 2 + f.y ** 2 + f.z ** 2)


def steepest(values):
    return max(abs(b - a) for a, b in zip(values, values[1:]))


def spacing(messages):
    stamps = [m.header.stamp.to_sec() for m in messages]
    return sorted(other - one for one, other in zip(stamps, stamps[1:]))


class ForcesTest(InStepTestCase):
    PERIOD = PERIOD

    def setUp(self):
        super().setUp()
        self.forces = None

    def record_forces(self, tool):
        self.forces = self.record(tool + '/measured_cf', WrenchStamped)

    def advance(self, seconds=None):
        state = super().advance(seconds)
        if getattr(self, 'forces', None) and self.forces.count():
            last = self.clock.stamp() - rospy.Duration(PERIOD + 1e-6)
            self.forces.wait(lambda m: m.header.stamp >= last, self.forces.count() - 1)
        return state

    def assert_even(self, messages, seconds):
        self.assertAlmostEqual(seconds / PERIOD, len(messages), delta=3)
        spaces = spacing(messages)
        self.assertAlmostEqual(PERIOD, spaces[0], delta=1e-6)
        self.assertAlmostEqual(PERIOD, spaces[-1], delta=1e-6)

    def test_a_pull_is_reported_at_500_hz_and_between_steps(self):
        picked = self.pick_left()
        start = picked.position
        self.record_forces('pick')
        self.say('pick/servo_cp', [pose_stamped(start.x, start.y, start.z) for _ in range(150)])
        since = self.forces.count()
        self.say('pick/servo_cp', [pose_stamped(start.x, start.y + 0.01 * (1.0 - math.cos(2 * math.pi * 2 * i * PERIOD)), start.z)
                                   for i in range(1000)])
        messages = self.forces.messages[since:]
        self.assert_even(messages, 1000 * PERIOD)
        values = [m.wrench.force.y for m in messages]
        self.assertLess(min(values), -0.5)
        # Smooth: no part of a way that takes the hand many ticks is reported in one.
        print('%g Hz: the steepest tick has %.3f of the range' % (self.step_rate, steepest(values) / (max(values) - min(values))))
        self.assertLess(steepest(values), 0.1 * (max(values) - min(values)))
        # The straight line between two steps has one slope; a hand that is followed between them has many.
        slopes = sum(abs((c - b) - (b - a)) > 1e-9 for a, b, c in zip(values, values[1:], values[2:]))
        print('%g Hz: %d slopes of %d' % (self.step_rate, slopes, len(values)))
        self.assertGreater(slopes, (3.0 if self.step_rate < 60 else 1.5) * 2.0 * self.step_rate)
        # Let go: zero, and then nothing but the hand in the air.
        self.good('release', pick_id=picked.pick_id)
        self.say('pick/servo_cp', [pose_stamped(start.x, start.y, start.z) for _ in range(200)])
        self.assertEqual([0.0] * 50, [force(m) for m in self.forces.messages[-50:]])

    def test_a_press_is_reported_from_the_touch_to_the_parting(self):
        self.good('lock', pick_id=self.pick_left().pick_id)  # of the far side: the box stays
        self.record_forces('push')
        self.good('push', enable=True, radius=0.03, pose=pose_stamped(-0.30, 0.0, 0.1))
        self.say('push/servo_cp', [pose_stamped(-0.30, 0.0, 0.1) for _ in range(100)])
        in_air = self.forces.count()
        self.assertEqual([0.0] * in_air, [force(m) for m in self.forces.messages[:in_air]])
        self.say('push/servo_cp', [pose_stamped(-0.30 + 0.06 * math.sin(math.pi * min(1.0, i * PERIOD)), 0.0, 0.1)
                                   for i in range(700)])
        messages = self.forces.messages[in_air:]
        self.assert_even(messages, 700 * PERIOD)
        values = [m.wrench.force.x for m in messages]
        self.assertLess(min(values), -0.2, 'the sphere reported nothing')
        # It never pulls, is smooth, and zero when free.
        print('%g Hz: the press was %.2f N at most, the steepest tick has %.3f of it' % (
            self.step_rate, -min(values), steepest(values) / -min(values)))
        self.assertLessEqual(max(values), 0.0)
        self.assertLess(steepest(values), 0.25 * -min(values))
        self.assertEqual([0.0] * 50, [force(m) for m in self.forces.messages[-50:]])


class SlowForcesTest(ForcesTest):
    scene = 'boxes_at_30'
    step_rate = 30.0


class RealTimeTest(DeformerTestCase):
    """By the system's clock: however long anybody stands still, no two ticks are closer than their period, a sphere never
    pulls, and the force of what is free is zero. How even and smooth it was here is printed."""

    def setUp(self):
        super().setUp()
        self.good('pause', data=False)
        self.publisher = rospy.Publisher(self.node + '/pick/servo_cp', PoseStamped, queue_size=100)
        self.forces = self.deformer.recorder('pick/measured_cf', WrenchStamped)

    def tearDown(self):
        self.publisher.unregister()
        self.forces.close()
        super().tearDown()

    def wave(self, start, done):
        """The hand moves until done()."""
        begun = time.monotonic()
        while not done():
            passed = time.monotonic() - begun
            self.assertLess(passed, LONG, 'the force did not follow the hand')
            pose = pose_stamped(start.x, start.y + 0.01 * (1.0 - math.cos(2 * math.pi * 2 * passed)), start.z)
            pose.header.stamp = rospy.Time.now()
            self.publisher.publish(pose)
            time.sleep(0.005)

    def test_ticks_are_no_closer_than_their_period_and_the_hand_feels(self):
        picked = self.pick_left()
        self.wave(picked.position, lambda: self.forces.count() > 1000 and
                  min(m.wrench.force.y for m in self.forces.messages) < -0.3)
        messages = list(self.forces.messages)
        spaces, values = spacing(messages), [m.wrench.force.y for m in messages]
        print('ticks: the shortest %.3f ms, half below %.3f ms, 99 of 100 below %.3f ms, the longest %.1f ms; the steepest tick '
              'has %.3f of the range' % (1e3 * spaces[0], 1e3 * spaces[len(spaces) // 2], 1e3 * spaces[int(0.99 * len(spaces))],
                                         1e3 * spaces[-1], steepest(values) / (max(values) - min(values))))
        self.assertGreaterEqual(spaces[0], PERIOD - 1e-5)
        self.good('release', pick_id=picked.pick_id)
        self.wave(picked.position, lambda: [force(m) for m in self.forces.messages[-50:]] == [0.0] * 50)


if __name__ == '__main__':
    run('forces', ForcesTest, SlowForcesTest, RealTimeTest)
