#!/usr/bin/env python3
"""Calls that wait, and signals: nobody who waits holds up the others, and the node ends in good order whatever it does."""
import os
import random
import shutil
import signal
import struct
import sys
import tempfile
import threading
import time
import unittest

import rospy
from meshless_surgery import Refused, Surgeon, Unanswered
from shape_msgs.msg import SolidPrimitive

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from deformer_support import ACROSS_X, LONG, OwnNode, header, pose_stamped, run  # noqa: E402

SCENES = os.path.join(os.path.dirname(os.path.abspath(__file__)), 'scenes')
MOST_CUTS = 16
POINTS = 400000  # a cloud that takes minutes to become a body


class EndingCase(unittest.TestCase):

    def setUp(self):
        self.folder = tempfile.mkdtemp(prefix='meshless_ending_')
        self.session = os.path.join(self.folder, 'session')
        self.answers = {}

    def tearDown(self):
        shutil.rmtree(self.folder, ignore_errors=True)

    def node(self, **parameters):
        settings = dict(scene=os.path.join(SCENES, 'fuzz.yaml'), session_directory=self.session, autosave_period=0.05,
                        data_folders=[self.folder])
        settings.update(parameters)
        return OwnNode(**settings)

    def in_background(self, key, node, service, **fields):
        def ask():
            try:
                self.answers[key] = node.call(service, **fields)
            except (rospy.ServiceException, rospy.ROSException, OSError) as fault:
                self.answers[key] = fault

        thread = threading.Thread(target=ask)
        thread.daemon = True
        thread.start()
        return thread

    def autosaves(self):
        return [name for name in os.listdir(self.session) if name.startswith('autosave') and name.endswith('.state')]

    def until(self, what, true):
        end = time.monotonic() + LONG
        while not true():
            self.assertLess(time.monotonic(), end, what)
            time.sleep(0.02)


class WaitingTest(EndingCase):

    def test_cuts_that_wait_hold_up_no_others(self):
        with self.node() as node:
            asking = [self.in_background(k, node, 'cut', blades=pose_stamped(-1.0, 0.0, 0.01 + 0.004 * k),
                                         close_time=60.0, bodies=['left']) for k in range(MOST_CUTS + 4)]
            self.until('none is refused', lambda: len(self.answers) >= 4)
            for answer in self.answers.values():
                self.assertFalse(answer.success)
                self.assertIn('accepted: up to %d at once' % MOST_CUTS, answer.message)
            self.answers = {}
            self.assertTrue(node.good('cut', blades=pose_stamped(-1.0, 0.0, 0.05), bodies=['right']).new_bodies)
            node.good('pause', data=True)
            node.good('cut', blades=pose_stamped(0.11, -1.0, 0.05, ACROSS_X), close_time=60.0, bodies=['middle'])
            self.assertEqual({}, self.answers)
            node.good('open_scissors')
            for thread in asking:
                thread.join(LONG)
            self.assertEqual(MOST_CUTS, len(self.answers))
            for answer in self.answers.values():
                self.assertFalse(answer.success)
                self.assertIn('were opened', answer.message)

    def test_who_waits_gets_an_answer_when_the_node_ends(self):
        for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
            self.answers = {}
            with self.node() as node:
                cut = self.in_background('cut', node, 'cut', blades=pose_stamped(-1.0, 0.0, 0.05), close_time=60.0)
                self.until('no autosave', lambda: os.path.isdir(self.session) and self.autosaves())
                time.sleep(0.7)
                # Not before: done as fast as may be they would soon take the blades' time.
                steps = self.in_background('step', node, 'step', steps=100000)
                time.sleep(0.3)
                self.assertEqual(0, node.end(number), node.output())
                for thread in (cut, steps):
                    thread.join(LONG)
                for key in ('cut', 'step'):
                    self.assertFalse(isinstance(self.answers[key], Exception), '%s: %s' % (key, self.answers[key]))
                    self.assertFalse(self.answers[key].success)
                    self.assertIn('shutting down', self.answers[key].message)
            self.assertEqual([], self.autosaves())

    def test_unknown_frames_of_a_crowd(self):
        with self.node() as node:
            stop = threading.Event()
            messages = set()

            def ask():
                while not stop.is_set():
                    messages.add(node.call('pick', header=header('nowhere')).message.split(';')[0])

            crowd = [threading.Thread(target=ask) for _ in range(30)]
            for thread in crowd:
                thread.daemon = True
                thread.start()
            for _ in range(20):
                node.good('hash')
                node.good('clear_picks')
            stop.set()
            for thread in crowd:
                thread.join(LONG)
            self.assertEqual({"header.frame_id is 'nowhere'"}, messages)


class SignalTest(EndingCase):

    def cloud(self):
        rng = random.Random(5)
        path = os.path.join(self.folder, 'cloud.pcd')
        with open(path, 'wb') as file:
            file.write(b'VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH %d\nHEIGHT 1\n'
                       b'VIEWPOINT 0 0 0 1 0 0 0\nPOINTS %d\nDATA binary\n' % (POINTS, POINTS))
            file.write(b''.join(struct.pack('<3f', rng.random(), rng.random(), rng.random()) for _ in range(POINTS)))
        return path

    def test_a_body_that_is_being_prepared(self):
        """It holds up neither a small body nor the end; the session is ended in good order without it."""
        with self.node(command_log='log') as node:
            large = self.in_background('large', node, 'spawn', name='large', file=self.cloud(), scale=1.0,
                                       pose=pose_stamped())
            time.sleep(1.0)
            node.good('spawn', name='small', scale=1.0, pose=pose_stamped(0.0, 0.0, 1.0),
                      primitive=SolidPrimitive(type=SolidPrimitive.BOX, dimensions=[0.1, 0.1, 0.1]))
            self.assertEqual({}, self.answers)
            heard = []
            goal = Surgeon(node.name, LONG).spawn_async('large_too', file=self.cloud(), feedback=heard.append)
            self.until('it does not begin', lambda: any(message.phase == 'reading' for message in heard))
            self.until('no autosave', self.autosaves)
            self.assertEqual(1, node.end(signal.SIGTERM), node.output())
            self.assertIn('such as a body that is being prepared', node.output())
            large.join(LONG)
            with self.assertRaises((Refused, Unanswered)):  # the message of the first may be lost
                goal.result(LONG)
            self.assertIn('aborted the goal ' + goal.id, node.output())
        self.assertEqual([], self.autosaves())

    def test_before_the_scene_is_ready(self):
        with open(os.path.join(self.folder, 'slow.yaml'), 'w', encoding='utf-8') as file:
            file.write('bodies: [{name: large, file: %s}]\n' % self.cloud())
        node = self.node(scene=os.path.join(self.folder, 'slow.yaml'))
        try:
            time.sleep(2.0)
            self.assertEqual(1, node.end(signal.SIGINT), node.output())
            self.assertIn('the node ends before its scene is ready', node.output())
        finally:
            node.__exit__()

    def test_without_a_master(self):
        node = OwnNode(prefix=['env', 'ROS_MASTER_URI=http://127.0.0.1:1'])
        try:
            self.until('it does not look for the master', lambda: 'Failed to contact master' in node.output())
            self.assertIn(node.end(signal.SIGINT), (0, 1))
        finally:
            node.__exit__()


if __name__ == '__main__':
    run('ending', WaitingTest, SignalTest)
