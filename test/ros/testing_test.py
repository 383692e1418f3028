#!/usr/bin/env python3
"""The fixture for users' own tests: docs/testing.md does what it says, and a test that should fail does."""
import os
import re
import subprocess
import sys
import tempfile
import time
import unittest
from unittest import mock

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, HERE)
from deformer_support import LONG, run  # noqa: E402
from meshless_surgery import ErrorCode, Refused  # noqa: E402
from meshless_surgery.msg import Event  # noqa: E402
from meshless_surgery.testing import RunningScene, SceneTestCase  # noqa: E402
from rospy.impl.tcpros_base import TCPROSTransport  # noqa: E402
from rospy.impl.tcpros_pubsub import TCPROSSub  # noqa: E402

SCENE = os.path.join(HERE, 'scenes', 'boxes.yaml')
PACKAGE = '<package format="3"><name>my_package</name><version>0.1.0</version><description>of a user</description>' \
          '<maintainer email="user@example.org">user</maintainer><license>BSD</license></package>\n'


class DocsTest(unittest.TestCase):
    """A user's package, written from the page."""

    def setUp(self):
        with open(os.path.join(HERE, '..', '..', 'docs', 'testing.md')) as file:
            page = file.read()
        self.files = {name: re.search(r'`my_package/%s`[^`]*```\w+\n(.*?)```' % re.escape(name), page, re.DOTALL).group(1)
                      for name in ('test/my_scene_test.py', 'test/my_scene.test', 'scenes/my_scene.yaml')}
        self.files['package.xml'] = PACKAGE

    def rostest(self):
        with tempfile.TemporaryDirectory() as folder:
            package = os.path.join(folder, 'my_package')
            for name, text in self.files.items():
                path = os.path.join(package, name)
                os.makedirs(os.path.dirname(path), exist_ok=True)
                with open(path, 'w') as file:
                    file.write(text)
            os.chmod(os.path.join(package, 'test', 'my_scene_test.py'), 0o755)
            environment = dict(os.environ, ROS_HOME=os.path.join(folder, 'home'))
            environment['ROS_PACKAGE_PATH'] = folder + ':' + environment['ROS_PACKAGE_PATH']
            done = subprocess.run(['rostest', 'my_package', 'my_scene.test'], env=environment, timeout=2 * LONG,
                                  stdout=subprocess.PIPE, stderr=subprocess.STDOUT, universal_newlines=True)
            return done.returncode, done.stdout

    def test_the_page_has_twenty_lines_and_they_pass(self):
        self.assertLessEqual(len(self.files['test/my_scene_test.py'].splitlines()), 21)
        code, output = self.rostest()
        self.assertEqual(0, code, output)
        self.assertRegex(output, r'TESTS: 1\b')

    def test_they_fail_with_another_scene(self):
        self.files['scenes/my_scene.yaml'] = self.files['scenes/my_scene.yaml'].replace('ground: 0.0', 'ground: none')
        code, output = self.rostest()
        self.assertNotEqual(0, code)
        self.assertIn('not less than 0.01', output)


class FixtureTest(SceneTestCase):

    scene = SCENE
    parameters = {'tools/silence': 0.0}

    def test_time_moves_by_steps_alone_and_each_test_begins_at_the_start(self):
        self.assertEqual(0, self.surgeon.state().step)
        self.assertAlmostEqual(5 / 120, self.step(5))
        self.assertEqual(5, self.surgeon.state().step)

    def test_equal_histories_have_equal_hashes(self):
        hashes = []
        for x in (-0.15, -0.15, -0.2):
            self.surgeon.reset()
            self.surgeon.push((x - 0.15, 0, 0.1), radius=0.03)
            self.surgeon.push((x, 0, 0.1), radius=0.03, speed=0.5)
            self.step(30)
            hashes.append(self.hash())
        self.assertEqual(hashes[0], hashes[1])
        self.assertNotEqual(hashes[0], hashes[2])

    def test_events_are_expected_in_their_order(self):
        pick = self.surgeon.pick((-0.15, 0, 0.1), max_distance=0.1).pick_id
        self.surgeon.release(pick)
        self.assertEqual('left', self.expect_event(Event.PICKED, pick_id=pick).body)
        self.expect_event(Event.RELEASED)
        self.event_timeout = 0.2
        with self.assertRaises(AssertionError) as raised:
            self.expect_event(Event.PICKED)
        self.assertIn('none', str(raised.exception))

    def test_an_event_of_the_test_before_is_not_taken_for_one_of_this(self):
        self.surgeon.pick((-0.15, 0, 0.1), max_distance=0.1)
        self.setUp()
        self.event_timeout = 0.2
        with self.assertRaises(AssertionError):
            self.expect_event(Event.PICKED)

    def test_refusals_are_expected_with_their_code(self):
        with self.expect_refusal(ErrorCode.UNKNOWN_NAME) as refused:
            self.surgeon.body('spleen')
        self.assertIn('spleen', refused.exception.message)
        with self.assertRaises(AssertionError):
            with self.expect_refusal(ErrorCode.MISSED):
                self.surgeon.body('spleen')
        with self.assertRaises(AssertionError):
            with self.expect_refusal():
                self.surgeon.body('left')
        with self.assertRaises(AssertionError) as raised:
            with self.expect_refusal():
                self.step(1)
                self.surgeon.body('spleen')
        self.assertIn('has changed', str(raised.exception))

    def test_a_scene_that_does_not_start_says_why(self):
        with self.assertRaises(RuntimeError) as raised:
            RunningScene('no_such_scene')
        self.assertIn('no_such_scene', str(raised.exception))

    def test_the_first_event_is_heard_however_late_the_connection_is_made(self):
        at_once = TCPROSTransport.connect

        def late(transport, *arguments, **named):
            if isinstance(transport.protocol, TCPROSSub):
                time.sleep(3.0)
            at_once(transport, *arguments, **named)

        with mock.patch.object(TCPROSTransport, 'connect', late):
            node = RunningScene(SCENE)
            self.addCleanup(node.close)
            node.surgeon.pick((-0.15, 0, 0.1), max_distance=0.1)
            self.assertIsNotNone(node.wait_for_event(lambda event: event.type == Event.PICKED, timeout=10.0))

    def test_answers_without_a_code_have_none(self):
        with self.assertRaises(Refused) as refused:
            self.surgeon.undo()
        self.assertIsNone(refused.exception.code)


if __name__ == '__main__':
    run('testing', DocsTest, FixtureTest)
