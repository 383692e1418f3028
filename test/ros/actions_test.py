#!/usr/bin/env python3
"""The actions: the same as the services, several side by side, and one of them cancelled without the others."""
import atexit
import os
import random
import struct
import sys
import tempfile
import threading
import unittest

from meshless_surgery import Cancelled, ErrorCode, Refused, Surgeon, Unanswered
from meshless_surgery.msg import CutFeedback, SpawnActionFeedback, SpawnFeedback, StepFeedback

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, HERE)
from deformer_support import LONG, OwnNode, Recorder, run  # noqa: E402

BOXES = os.path.join(HERE, 'scenes', 'boxes.yaml')
MOST_STEPS = 100000
LEFT = dict(pivot=(-0.2, -1, 0.1), reach=(0, 1, 0), normal=(1, 0, 0), bodies=['left'])
RIGHT = dict(LEFT, pivot=(0.2, -1, 0.1), bodies=['right'])
INTO_RIGHT = dict(start=(0.17, 0.0, 0.15), along=(1, 0, 0), out=(0, 0, 1), length=0.06, depth=0.03, bodies=['right'])


class Heard:
    """The feedback of a goal."""

    def __init__(self):
        self.messages = []
        self.changed = threading.Condition()

    def __call__(self, message):
        with self.changed:
            self.messages.append(message)
            self.changed.notify_all()

    def wait(self, wanted):
        """Until wanted(messages) holds."""
        with self.changed:
            if not self.changed.wait_for(lambda: wanted(self.messages), LONG):
                raise AssertionError('not among %d messages: %s' % (len(self.messages), self.messages[-3:]))

    def wait_for_phase(self, phase):
        self.wait(lambda messages: any(message.phase == phase for message in messages))


class ActionCase(unittest.TestCase):
    """One node for all of them."""

    running = None

    @classmethod
    def setUpClass(cls):
        case = ActionCase
        if case.running is None:
            case.folder = tempfile.TemporaryDirectory()
            case.running = OwnNode(scene=BOXES, paused=True, state_rate=200, data_folders=[case.folder.name],
                                   session_directory=os.path.join(case.folder.name, 'session')).wait()
            case.surgeon = Surgeon(case.running.name, LONG)
            atexit.register(case.running.__exit__)
            atexit.register(case.folder.cleanup)

    def setUp(self):
        self.surgeon.stepped()
        self.surgeon.reset()

    def present(self, name):
        try:
            return bool(self.surgeon.body(name))
        except Refused as refused:
            self.assertEqual(ErrorCode.UNKNOWN_NAME, refused.code)
            return False

    def cancelled(self, goal):
        with self.assertRaises(Cancelled) as cancelled:
            goal.result(LONG)
        return cancelled.exception.result


class SameAsServicesTest(ActionCase):

    BAD = (('cut', dict(LEFT, roughness=-0.5)), ('cut', dict(LEFT, bodies=['spleen'])), ('cut', dict(LEFT, length=float('nan'))),
           ('cut', dict(LEFT, pivot=(9, 9, 9), length=0.1)), ('cut', dict(LEFT, frame='nowhere')), ('cut', dict(LEFT, close_time=61.0)),
           ('incise', dict(INTO_RIGHT, depth=0.0)), ('incise', dict(INTO_RIGHT, start=(5, 5, 5))), ('step', dict(steps=0)),
           ('step', dict(steps=MOST_STEPS + 1)), ('spawn', dict(name='left', sphere=0.1)), ('spawn', dict(file='/etc/hostname')),
           ('spawn', dict(name='a/b', sphere=0.1)), ('spawn', dict(name='x', box=(0.1, 0.1, -0.1))),
           ('spawn', dict(file='dirty.obj', material='none')))

    def test_bad_input(self):
        before = self.surgeon.hash()
        for name, fields in self.BAD:
            with self.subTest(name, **fields):
                with self.assertRaises(Refused) as service:
                    getattr(self.surgeon, name)(**fields)
                with self.assertRaises(Refused) as action:
                    getattr(self.surgeon, name + '_async')(**fields).result(LONG)
                self.assertEqual(service.exception.message, action.exception.message)
                self.assertEqual(service.exception.code, action.exception.code)
                self.assertNotEqual(ErrorCode.OK, action.exception.code)
                self.assertEqual(before, self.surgeon.hash())


class StepTest(ActionCase):

    def test_of_two_long_goals_one_is_cancelled(self):
        for first in (True, False):
            self.surgeon.reset()
            heard, heard_too = Heard(), Heard()
            long = self.surgeon.step_async(MOST_STEPS, feedback=heard)
            heard.wait(lambda messages: len({message.steps_done for message in messages}) >= 4)
            other = self.surgeon.step_async(50 if first else MOST_STEPS, feedback=heard_too)
            heard_too.wait_for_phase(StepFeedback.WAITING)
            if first:
                long.cancel()
                result = self.cancelled(long)
                self.assertEqual(50, other.result(LONG).steps_done)
                done = result.steps_done + 50
            else:
                other.cancel()
                self.assertEqual(0, self.cancelled(other).steps_done)
                self.assertFalse(long.done())
                so_far = heard.messages[-1].steps_done
                heard.wait(lambda messages: messages[-1].steps_done > so_far)
                long.cancel()
                result = self.cancelled(long)
                done = result.steps_done
            self.assertEqual((False, ErrorCode.FAILED), (result.success, result.error_code))
            self.assertTrue(0 < result.steps_done < MOST_STEPS, result.steps_done)
            self.assertAlmostEqual(result.steps_done / 120.0, result.sim_time)
            self.assertIn('%d of %d steps were done' % (result.steps_done, MOST_STEPS), result.message)
            state = self.surgeon.state()
            self.assertEqual(done, state.step)
            counts = [message.steps_done for message in heard.messages]
            self.assertEqual(sorted(counts), counts)
            self.assertEqual(0, counts[0])
            self.assertLessEqual(counts[-1], result.steps_done)
            self.assertEqual({MOST_STEPS}, {message.steps for message in heard.messages})

    def test_whole_steps_are_as_those_of_the_service(self):
        pick = self.surgeon.pick((-0.15, 0, 0.1), max_distance=0.1).pick_id
        self.surgeon.move(pick, (-0.1, 0.02, 0.1))
        self.surgeon.save('before.state')
        heard = Heard()
        goal = self.surgeon.step_async(MOST_STEPS, feedback=heard)
        heard.wait(lambda messages: messages and messages[-1].steps_done > 0)
        goal.cancel()
        done = self.cancelled(goal).steps_done
        after = self.surgeon.hash()
        self.surgeon.load('before.state')
        self.surgeon.step(done)
        self.assertEqual(after, self.surgeon.hash())


class CutTest(ActionCase):

    def test_of_two_closing_cuts_one_is_cancelled(self):
        heard, heard_too = Heard(), Heard()
        self.surgeon.runs()  # while paused blades would meet at once
        left = self.surgeon.cut_async(feedback=heard, close_time=60.0, **LEFT)
        right = self.surgeon.cut_async(feedback=heard_too, close_time=60.0, **RIGHT)
        for ear in (heard, heard_too):
            ear.wait(lambda messages: len({message.closed for message in messages}) >= 3)
        self.surgeon.stepped()
        left.cancel()
        result = self.cancelled(left)
        self.assertEqual((False, ErrorCode.FAILED, []), (result.success, result.error_code, result.new_bodies))
        self.assertIn('before the blades met', result.message)
        self.assertFalse(right.done())
        self.surgeon.step(60 * 120 + 1)
        self.assertEqual(['right.1', 'right.2'], sorted(right.result(LONG).new_bodies))
        self.assertTrue(self.present('left'))
        self.assertFalse(self.present('left.1'))
        for ear in (heard, heard_too):
            shares = [message.closed for message in ear.messages]
            self.assertEqual(sorted(shares), shares)
            self.assertTrue(0.0 <= shares[0] <= shares[-1] <= 1.0, shares)
            order = [CutFeedback.WAITING, CutFeedback.CLOSING, CutFeedback.CUTTING]
            phases = [order.index(message.phase) for message in ear.messages]
            self.assertEqual(sorted(phases), phases)
        self.assertNotIn(CutFeedback.CUTTING, [message.phase for message in heard.messages])

    def test_what_took_place_cannot_be_cancelled(self):
        for name, fields in (('cut', LEFT), ('incise', INTO_RIGHT)) * 5:
            self.surgeon.reset()
            before = self.surgeon.hash()
            goal = getattr(self.surgeon, name + '_async')(**fields)
            goal.cancel()
            try:
                done = goal.result(LONG)
            except Cancelled:
                self.assertEqual(before, self.surgeon.hash())
            else:
                self.assertTrue(done.cut_bodies)
                self.assertNotEqual(before, self.surgeon.hash())
            goal.cancel()
            after = self.surgeon.hash()
            self.assertEqual(after, self.surgeon.hash())

    def test_a_reset_ends_what_waits(self):
        heard = Heard()
        self.surgeon.runs()
        goal = self.surgeon.cut_async(feedback=heard, close_time=60.0, **LEFT)
        heard.wait_for_phase(CutFeedback.CLOSING)
        self.surgeon.reset()
        with self.assertRaises(Refused) as refused:
            goal.result(LONG)
        self.assertEqual(ErrorCode.FAILED, refused.exception.code)
        self.assertIn('reset', refused.exception.message)


def cloud(folder, points):
    """A file that takes a while to become a body."""
    rng = random.Random(5)
    with open(os.path.join(folder, 'cloud_%d.pcd' % points), 'wb') as file:
        file.write(b'VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH %d\nHEIGHT 1\n'
                   b'VIEWPOINT 0 0 0 1 0 0 0\nPOINTS %d\nDATA binary\n' % (points, points))
        file.write(b''.join(struct.pack('<3f', rng.random(), rng.random(), rng.random()) for _ in range(points)))
    return file.name


class SpawnTest(ActionCase):

    def test_who_is_cancelled_is_not_added_and_the_others_are(self):
        file = cloud(self.folder.name, 3000)  # a second
        heard = {name: Heard() for name in ('first', 'second', 'third', 'fourth')}
        everything = Recorder(self.running.name + '/actions/spawn/feedback', SpawnActionFeedback)
        goals = {name: self.surgeon.spawn_async(name, file=file, position=(0, 0, 3), feedback=heard[name])
                 for name in ('first', 'second')}
        for name in ('third', 'fourth'):
            goals[name] = self.surgeon.spawn_async(name, sphere=0.03, position=(0, 0, 2), feedback=heard[name])
        there = {'second': True, 'fourth': True}
        for name in ('third', 'first'):
            goals[name].cancel()
            try:
                there[name] = goals[name].result(LONG).success
            except Cancelled as cancelled:
                there[name] = False
                result = cancelled.result
                self.assertEqual((False, ErrorCode.FAILED, ''), (result.success, result.error_code, result.name))
        print('cancelled: %s' % [name for name in there if not there[name]])
        self.assertEqual(['second', 'fourth'], [goals[name].result(LONG).name for name in ('second', 'fourth')])
        # As long again: by now the first would have come.
        self.surgeon.spawn_async('last', file=file, position=(0, 0, 3)).result(LONG)
        for name in goals:
            self.assertEqual(there[name], self.present(name), name)
        everything.wait(lambda m: m.status.goal_id.id == goals['second'].id and m.feedback.phase == SpawnFeedback.ADDING)
        self.assertEqual([SpawnFeedback.WAITING, SpawnFeedback.READING, SpawnFeedback.PREPARING, SpawnFeedback.ADDING],
                         [m.feedback.phase for m in everything.messages if m.status.goal_id.id == goals['second'].id])
        everything.close()

    def test_waiting_and_prepared_goals_are_cancelled_at_once(self):
        with OwnNode(scene=BOXES, paused=True, data_folders=[self.folder.name]) as node:
            surgeon = Surgeon(node.name, LONG)
            file = cloud(self.folder.name, 400000)  # minutes
            heard = {name: Heard() for name in ('first', 'second', 'third', 'fourth')}
            goals = {}
            for name in ('first', 'second'):
                goals[name] = surgeon.spawn_async(name, file=file, position=(0, 0, 3), feedback=heard[name])
                heard[name].wait_for_phase(SpawnFeedback.READING)
            for name in ('third', 'fourth'):
                goals[name] = surgeon.spawn_async(name, sphere=0.03, position=(0, 0, 2), feedback=heard[name])
                heard[name].wait_for_phase(SpawnFeedback.WAITING)
            for name in ('third', 'first'):
                goals[name].cancel()
                self.assertIn('cancelled before it began', self.cancelled(goals[name]).message)
            self.assertFalse(goals['second'].done())
            self.assertEqual([SpawnFeedback.WAITING], [message.phase for message in heard['fourth'].messages])
            surgeon.step(10)  # the world is not held up


class EndTest(unittest.TestCase):

    def test_a_node_that_ends_leaves_nobody_waiting(self):
        for number in (15, 9):
            with OwnNode(scene=BOXES, paused=False) as node:
                surgeon = Surgeon(node.name, LONG)
                heard = {name: Heard() for name in ('cut', 'steps')}
                goals = [surgeon.cut_async(feedback=heard['cut'], close_time=60.0, **LEFT)]
                heard['cut'].wait_for_phase(CutFeedback.CLOSING)
                surgeon.pause()
                goals += [surgeon.step_async(MOST_STEPS, feedback=heard['steps']), surgeon.step_async(MOST_STEPS)]
                heard['steps'].wait_for_phase(StepFeedback.STEPPING)
                code = node.end(number)
                if number == 15:
                    self.assertEqual(0, code, node.output())
                for goal in goals:
                    # A cut may have taken place before: the steps are done as fast as may be.
                    try:
                        goal.result(LONG)
                        self.assertEqual('cut', goal.name)
                    except Refused as refused:
                        self.assertIn('shutting down', refused.message)
                        print('%s: answered at the end' % goal.name)
                    except Unanswered as unanswered:
                        self.assertIn('the node has ended', str(unanswered))
                        print('%s: not answered at the end' % goal.name)

    def test_no_node(self):
        with self.assertRaises(Unanswered):
            Surgeon('/nobody', 0.2).step_async(1)


if __name__ == '__main__':
    run('actions', SameAsServicesTest, StepTest, CutTest, SpawnTest, EndTest)
