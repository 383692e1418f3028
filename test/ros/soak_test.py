#!/usr/bin/env python3
"""A node with random commands for a long time: its memory does not grow, nor the processor time of a
step at the start of the scene, and that ends where it did at first.
MESHLESS_SURGERY_SOAK_MINUTES sets how long; half a minute without it."""
import os
import random
import shutil
import sys
import tempfile
import time
import unittest

from geometry_msgs.msg import Point
from meshless_surgery.msg import State
from shape_msgs.msg import SolidPrimitive

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from deformer_support import ACROSS_X, OwnNode, Recorder, pose_stamped, run  # noqa: E402

SCENES = os.path.join(os.path.dirname(os.path.abspath(__file__)), 'scenes')
MINUTES = float(os.environ.get('MESHLESS_SURGERY_SOAK_MINUTES') or 0.5)
ROWS = 12 if MINUTES > 2.0 else 4  # of the table at the least
MOST_GROWTH = 64 << 20             # [bytes] from the first half of the rows to the last
MOST_SLOWDOWN = 3.0                # of a step's processor time, the same way


def say(line):
    """Shown at once; what is printed otherwise ends in the result file."""
    print(line, file=sys.__stdout__, flush=True)


class SoakTest(unittest.TestCase):

    def setUp(self):
        self.folder = tempfile.mkdtemp(prefix='meshless_soak_')

    def tearDown(self):
        shutil.rmtree(self.folder, ignore_errors=True)

    def memory(self, node):
        with open('/proc/%d/statm' % node.process.pid, encoding='ascii') as file:
            return int(file.read().split()[1]) * os.sysconf('SC_PAGE_SIZE')

    def processor_time(self, node):
        """[s] of all of the node's threads: what others do on the machine hardly counts."""
        with open('/proc/%d/stat' % node.process.pid, encoding='ascii') as file:
            fields = file.read().rsplit(')', 1)[1].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')

    def round(self, node, rng):
        """Some seconds of a session, that ends where it began."""
        for _ in range(5):
            pick = node.call('pick', point=Point(rng.choice([-0.2, 0.2, 0.11]), 0.0, 0.1), max_distance=0.2)
            if pick.success:
                at = pick.position
                node.good('move_pick', pick_id=pick.pick_id,
                          target=Point(at.x, at.y + rng.uniform(-0.03, 0.03), at.z + 0.03))
            # Pieces are left alone: cut again and again they would be work without end.
            node.call('cut', blades=pose_stamped(rng.uniform(-0.25, 0.25), -1.0, 0.0, ACROSS_X),
                      bodies=[rng.choice(['left', 'right', 'middle'])])
            node.call('incise', blade=pose_stamped(rng.uniform(-0.25, 0.25), 0.0, 0.1), length=0.05, depth=0.05)
            node.good('push', enable=True, pose=pose_stamped(rng.uniform(-0.2, 0.2), 0.0, 0.05), speed=0.2)
            node.good('step', steps=30)
            if rng.random() < 0.3:
                node.call('undo_cut')
            node.call('spawn', name='guest', scale=1.0, pose=pose_stamped(0.0, 0.0, 0.3),
                      primitive=SolidPrimitive(type=SolidPrimitive.BOX, dimensions=[0.05, 0.05, 0.05]))
            node.good('step', steps=30)
            node.good('clear_picks')
            node.good('save', file='soak')
        node.good('load', file='soak')
        node.good('step', steps=30)
        node.good('reset')

    def test_nothing_grows(self):
        rng = random.Random(1)
        node = OwnNode(scene=os.path.join(SCENES, 'fuzz.yaml'), paused=True, session_directory=self.folder,
                       autosave_period=0.5, command_log='log').wait()
        states = Recorder(node.name + '/state', State)
        rows = []
        ends = set()
        try:
            began = time.monotonic()
            end = began + 60.0 * MINUTES
            say('  minute  rounds  memory [MB]  step at the start [ms]')
            rounds = 0
            while time.monotonic() < end or len(rows) < ROWS:
                until = time.monotonic() + 60.0 * MINUTES / max(ROWS, MINUTES)
                while True:
                    self.round(node, rng)
                    rounds += 1
                    if time.monotonic() >= until:
                        break
                # The scene as it was at the start: the same work each time.
                times = []
                for _ in range(5):
                    start = self.processor_time(node)
                    node.good('step', steps=60)
                    times.append((self.processor_time(node) - start) / 60)
                    ends.add(node.hash())
                    node.good('reset')
                with states.changed:
                    del states.messages[:]
                rows.append((self.memory(node), min(times)))
                say('%8.1f %7d %12.1f %23.2f' % ((time.monotonic() - began) / 60, rounds, rows[-1][0] / 2 ** 20,
                                                 1e3 * rows[-1][1]))
            settled = max(memory for memory, _ in rows[:len(rows) // 2])
            self.assertLess(rows[-1][0], settled + MOST_GROWTH)
            self.assertLess(rows[-1][1], MOST_SLOWDOWN * max(seconds for _, seconds in rows[:len(rows) // 2]))
            self.assertEqual(1, len(ends), 'the scene goes another way after a reset')
        finally:
            states.close()
            node.__exit__()


if __name__ == '__main__':
    run('soak', SoakTest)
