#!/usr/bin/env python3
"""With use_sim_time the world steps by /clock, and services answer while the clock stands still."""
import os
import sys
import threading
import time
import unittest

import rospy
from geometry_msgs.msg import Point
from meshless_surgery.msg import State
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Header

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from deformer_support import Deformer, run  # noqa: E402


class ClockTest(unittest.TestCase):

    def setUp(self):
        # rospy's own waiting sleeps by the clock that this test holds: it must tick.
        self.now = 100.0
        self.publisher = rospy.Publisher('/clock', Clock, queue_size=10)
        self.done = threading.Event()
        self.thread = threading.Thread(target=self._tick)
        self.thread.start()
        self.deformer = Deformer()
        self.states = self.deformer.recorder('state', State)

    def tearDown(self):
        self.done.set()
        self.thread.join()
        self.states.close()

    def _tick(self):
        while not self.done.wait(0.005):
            self.publisher.publish(Clock(clock=rospy.Time.from_sec(self.now)))

    def settled(self):
        """The step at which the world rests while the clock does."""
        while True:
            step = self.states.next().step
            since = self.states.count()
            last = self.states.wait(since=since + 20)
            if last.step == step:
                return step

    def test_steps_follow_the_clock(self):
        first = self.settled()
        self.now = 101.0
        # Ten seconds of backlog would be dropped beyond its bound; a second in small ticks is not.
        begun = self.settled()
        for _ in range(100):
            self.now += 0.01
            time.sleep(0.02)
        self.assertGreater(begun, first)
        self.assertAlmostEqual(begun + 120, self.settled(), delta=2)

    def test_services_answer_while_the_clock_stands_still(self):
        before = self.settled()
        answer = self.deformer.call('pick', point=Point(0, 0, 0.05), max_distance=1.0)
        self.assertTrue(answer.success, answer.message)
        refused = self.deformer.call('pick', header=Header(frame_id='no_such_frame'))
        self.assertFalse(refused.success)
        self.assertIn('no_such_frame', refused.message)
        stepped = self.deformer.call('step', steps=5)
        self.assertTrue(stepped.success, stepped.message)
        self.assertEqual(before + 5, self.settled())


if __name__ == '__main__':
    run('clock', ClockTest)
