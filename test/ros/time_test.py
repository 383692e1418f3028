#!/usr/bin/env python3
"""A world that cannot keep up says so, stays at work, and never stretches its step."""
import os
import sys
import unittest

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import Point
from meshless_surgery.msg import Event, State

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from deformer_support import Deformer, run  # noqa: E402


class OverrunTest(unittest.TestCase):

    def setUp(self):
        self.deformer = Deformer()

    def test_state_events_and_diagnostics_report_it(self):
        states = self.deformer.recorder('state', State)
        state = states.wait(lambda s: s.step > 100)
        self.assertLess(state.real_time_factor, 0.95)
        self.assertAlmostEqual(state.step / 10000.0, state.sim_time)
        events = self.deformer.recorder('events', Event)
        event = events.wait(lambda e: e.type == 'over budget')
        self.assertIn('ms', event.text)
        diagnostics = self.deformer.recorder('/diagnostics', DiagnosticArray)
        warned = diagnostics.wait(lambda a: any(s.level == DiagnosticStatus.WARN for s in a.status))
        values = {v.key: v.value for s in warned.status for v in s.values}
        self.assertGreater(int(values['overruns']), 0)
        self.assertGreater(float(values['dropped [s]']), 0.0)
        self.assertLess(float(values['real-time factor']), 0.95)
        for recorder in (states, events, diagnostics):
            recorder.close()

    def test_services_are_not_starved(self):
        for _ in range(20):
            answer = self.deformer.call('pick', point=Point(0.0, 0.0, 0.1), max_distance=1.0)
            self.assertTrue(answer.success, answer.message)
        self.assertTrue(self.deformer.call('clear_picks').success)

    def test_pausing_stands_still(self):
        self.assertTrue(self.deformer.call('pause', data=True).success)
        states = self.deformer.recorder('state', State)
        first = states.wait()
        later = states.wait(lambda s: s.header.stamp > first.header.stamp)
        self.assertEqual(first.step, later.step)
        before = first.sim_time
        after = self.deformer.call('step', steps=7).sim_time
        self.assertAlmostEqual(before + 7 / 10000.0, after)
        self.assertTrue(self.deformer.call('pause', data=False).success)
        states.wait(lambda s: s.step > first.step + 7)
        states.close()


if __name__ == '__main__':
    run('time', OverrunTest)
