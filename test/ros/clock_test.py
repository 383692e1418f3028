#!/usr/bin/env python3
"""With use_sim_time the world steps by /clock, and services answer while the clock stands still."""
import os
import sys

from geometry_msgs.msg import Point
from std_msgs.msg import Header

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from deformer_support import InStepTestCase, run  # noqa: E402


class ClockTest(InStepTestCase):
    scene = 'falling'

    def settled(self):
        """The step at which the world rests while the clock does. Each state asks the thread that steps."""
        while True:
            since = self.states.count()
            step = self.states.wait(since=since + 1).step
            if self.states.wait(since=since + 20).step == step:
                return step

    def test_steps_follow_the_clock(self):
        begun = self.settled()
        self.pass_time(1.0)
        self.assertAlmostEqual(begun + 120, self.settled(), delta=1)
        # Beyond the backlog time is dropped.
        begun = self.settled()
        self.runs_since = None
        self.clock.advance(10.0)
        self.assertAlmostEqual(begun + 13, self.settled(), delta=2)

    def test_a_clock_that_is_set_back_goes_on(self):
        begun = self.settled()
        self.clock.now -= 500.0
        self.runs_since = None
        self.clock.advance(0.0)
        self.assertAlmostEqual(begun, self.settled(), delta=1)
        begun = self.settled()
        for n in range(1, 11):
            self.clock.advance(0.05)
            self.states.wait(lambda state: state.step >= begun + 6 * n - 2)  # a busy machine hears the clock late
        self.assertAlmostEqual(begun + 60, self.settled(), delta=2)
        self.clock.now += 500.0

    def test_services_answer_while_the_clock_stands_still(self):
        before = self.settled()
        answer = self.deformer.call('pick', point=Point(0, 0, 0.05), max_distance=1.0)
        self.assertTrue(answer.success, answer.message)
        refused = self.deformer.call('pick', header=Header(frame_id='no_such_frame'))
        self.assertFalse(refused.success)
        self.assertIn('no_such_frame', refused.message)
        stepped = self.deformer.call('step', steps=5)
        self.assertTrue(stepped.success, stepped.message)
        self.states.wait(lambda state: state.step >= before + 5)  # older ones may still be under way
        self.assertEqual(before + 5, self.settled())


if __name__ == '__main__':
    run('clock', ClockTest)
