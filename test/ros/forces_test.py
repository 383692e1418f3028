#!/usr/bin/env python3
"""The force on a hand: even and frequent whatever the step rate, felt before the next step, without jumps, and gone
once the tool is free. Times are the stamps' own."""
import math
import os
import signal
import sys
import threading
import time
import xmlrpc.client

import rosgraph
import rospy
from geometry_msgs.msg import PoseStamped, WrenchStamped

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from deformer_support import DeformerTestCase, by_the_clock, pose_stamped, run  # noqa: E402

STREAM = 200.0     # [Hz]
PERIOD = 0.002     # [s] of measured_cf
SETTLED = 0.05     # [s] after the processors stood still


def force(message):
    f = message.wrench.force
    return math.sqrt(f.x ** 2 + f.y ** 2 + f.z ** 2)


class ForcesTest(DeformerTestCase):
    step_rate = 120.0

    def setUp(self):
        super().setUp()
        self.open = []
        self.good('pause', data=False)

    def tearDown(self):
        for opened in self.open:
            opened.unregister()
        super().tearDown()

    def stream(self, topic):
        publisher = rospy.Publisher(self.node + '/' + topic, PoseStamped, queue_size=100)
        self.open.append(publisher)
        while publisher.get_num_connections() == 0:
            rospy.sleep(0.01)

        def say(place, seconds):
            """place(t) [m] at the rate, for so long."""
            rate = rospy.Rate(STREAM)
            for i in range(int(seconds * STREAM)):
                pose = pose_stamped(*place(i / STREAM))
                pose.header.stamp = rospy.Time.now()
                publisher.publish(pose)
                rate.sleep()
        return say

    def record(self, topic):
        recorder = self.deformer.recorder(topic, WrenchStamped)
        self.open.append(recorder.subscriber)
        return recorder

    def hold(self):
        """A pick in a hand that has kept still for a while: the pick, its forces from then on, and what moves it."""
        picked = self.pick_left()
        forces = self.record('pick/measured_cf')
        say = self.stream('pick/servo_cp')
        say(lambda t: (picked.position.x, picked.position.y, picked.position.z), 0.3)
        return picked, forces, say

    def spacing(self, messages):
        stamps = [m.header.stamp.to_sec() for m in messages]
        return sorted(other - one for one, other in zip(stamps, stamps[1:]))

    def largest_jump(self, messages, value):
        """Of value(message), from one to the next, where no processor stood still just before."""
        jumps = [abs(value(b) - value(a)) for a, b in zip(messages, messages[1:])
                 if self.standstill.quiet(a.header.stamp.to_sec() - SETTLED, b.header.stamp.to_sec() + PERIOD)]
        self.assertGreater(len(jumps), len(messages) // 5, 'the processors stood still most of the time')
        return max(jumps)

    def assert_frequent(self, messages):
        spaces = self.spacing(messages)
        self.assertGreater(len(spaces), 500)
        self.assertGreater(spaces[0], 0.0, 'stamps do not grow')
        # Two milliseconds, and what a double and two clocks that drift leave of them.
        self.assertLess(spaces[len(spaces) // 2], PERIOD + 2e-5)
        self.assertLess(spaces[int(0.99 * len(spaces))], PERIOD + 5e-4)

    @by_the_clock
    def test_a_pull_is_felt_at_500_hz_and_between_steps(self):
        picked, forces, say = self.hold()
        start = picked.position
        since = forces.count()
        say(lambda t: (start.x, start.y + 0.01 * (1.0 - math.cos(2 * math.pi * 2 * t)), start.z), 2.0)
        messages = forces.messages[since:]
        self.assert_frequent(messages)
        values = [m.wrench.force.y for m in messages]
        self.assertLess(min(values), -0.5)
        # Smooth: no part of a way that takes the hand many ticks is felt in one.
        self.assertLess(self.largest_jump(messages, lambda m: m.wrench.force.y), 0.15 * (max(values) - min(values)))
        # The straight line between two steps has one slope; a hand that is felt between them has many.
        slopes = sum(abs((c - b) - (b - a)) > 1e-9 for a, b, c in zip(values, values[1:], values[2:]))
        self.assertGreater(slopes, 3 * 2.0 * self.step_rate if self.step_rate < 60 else 2.0 * 2.0 * self.step_rate)
        # Let go: zero, and then nothing but the hand in the air.
        self.good('release', pick_id=picked.pick_id)
        say(lambda t: (start.x, start.y, start.z), 0.5)
        self.assertEqual([0.0] * 50, [force(m) for m in forces.messages[-50:]])

    @by_the_clock
    def test_a_node_that_stood_still_makes_no_jump_of_it(self):
        _, _, pid = xmlrpc.client.ServerProxy(rosgraph.Master('/test').lookupNode(self.node)).getPid('/test')
        picked, forces, say = self.hold()
        start = picked.position
        since = forces.count()

        def stand_still():
            time.sleep(0.4)
            for seconds in (0.02, 0.04, 0.06, 0.08, 0.1):
                os.kill(pid, signal.SIGSTOP)
                time.sleep(seconds)
                os.kill(pid, signal.SIGCONT)
                time.sleep(0.27)
        still = threading.Thread(target=stand_still)
        still.start()
        say(lambda t: (start.x, start.y + 0.01 * (1.0 - math.cos(2 * math.pi * 2 * t)), start.z), 2.4)
        still.join()
        values = [m.wrench.force.y for m in forces.messages[since:]]
        self.assertLess(min(values), -0.5)
        jump = max(abs(b - a) for a, b in zip(values, values[1:]))
        print('%s: stood still, its largest change in a tick is %.3f of all' % (self.node, jump / (max(values) - min(values))))
        self.assertLess(jump, 0.2 * (max(values) - min(values)))

    @by_the_clock
    def test_a_press_is_felt_from_the_touch_to_the_parting(self):
        self.good('lock', pick_id=self.pick_left().pick_id)  # of the far side: the box stays
        forces = self.record('push/measured_cf')
        say = self.stream('push/servo_cp')
        self.good('push', enable=True, radius=0.03, pose=pose_stamped(-0.30, 0.0, 0.1))
        say(lambda t: (-0.30, 0.0, 0.1), 0.3)
        in_air = forces.count()
        self.assertEqual([0.0] * in_air, [force(m) for m in forces.messages[:in_air]])
        say(lambda t: (-0.30 + 0.06 * math.sin(math.pi * t), 0.0, 0.1), 1.1)
        say(lambda t: (-0.30, 0.0, 0.1), 0.3)
        messages = forces.messages[in_air:]
        self.assert_frequent(messages)
        values = [m.wrench.force.x for m in messages]
        self.assertLess(min(values), -0.2, 'the sphere felt nothing')
        # It never pulls, is smooth, and zero when free.
        jump = self.largest_jump(messages, lambda m: m.wrench.force.x)
        print('%s: the press was %.2f N at most, its largest change in a tick %.2f N' % (self.node, -min(values), jump))
        self.assertLessEqual(max(values), 0.0)
        self.assertLess(jump, 0.5 * -min(values))
        self.assertEqual([0.0] * 50, [force(m) for m in forces.messages[-50:]])


class SlowForcesTest(ForcesTest):
    node = '/slow'
    step_rate = 30.0


if __name__ == '__main__':
    run('forces', ForcesTest, SlowForcesTest)
