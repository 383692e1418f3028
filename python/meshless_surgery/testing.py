"""For tests of scenes: a node of one's own, whose time moves by steps alone, so that each run sees the same.

    class LiverTest(meshless_surgery.testing.SceneTestCase):
        scene = 'liver'
        def test_it_comes_to_rest(self):
            self.step(600)
            self.assertLess(self.surgeon.state().bodies[0].kinetic_energy, 1e-4)

docs/testing.md has a whole one.
"""
import contextlib
import os
import signal
import subprocess
import tempfile
import threading
import time
import unittest

import roslib.packages
import rospy

from meshless_surgery.errors import Refused, need_topics
from meshless_surgery.msg import Event
from meshless_surgery.surgeon import Surgeon
from meshless_surgery.topics import connected

# Runs a node until it ends, this process does (its end of the pipe is closed then, however it ended) or SIGTERM comes.
WITH_THIS_PROCESS = 'trap : TERM; exec 3<&0; "$@" 3<&- </dev/null & node=$!; read -r _ <&3 & wait -n; kill $node; wait $node'

# [s] of wall time that a start, an answer or an event may take. No test measures it: it only ends a wait for ever.
LONG = 120.0


class RunningScene:
    """A deformer_node of its own that plays a scene, paused. Ends with close(), or as a context. `surgeon` works on it,
    `events` are all that it has said."""

    _count = 0

    def __init__(self, scene, /, listens=True, **parameters):
        """`scene` and `parameters` are the node's; two underscores stand for a slash: tools__silence=0. An empty scene
        is that of the parameter `task`. Without `listens` `events` stays empty."""
        RunningScene._count += 1
        self.name = '/scene_%d_%d' % (os.getpid(), RunningScene._count)
        if listens:
            need_topics(self.name)
        parameters = dict({'paused': True}, **parameters)
        if scene:
            parameters['scene'] = scene
        for key, value in parameters.items():
            rospy.set_param('%s/%s' % (self.name, key.replace('__', '/')), value)
        programs = roslib.packages.find_node('meshless_surgery', 'deformer_node')
        if not programs:
            raise RuntimeError('meshless_surgery has no deformer_node here: is its setup.bash sourced?')
        self._log = tempfile.TemporaryFile(mode='w+', errors='replace')
        self._process = subprocess.Popen(['bash', '-c', WITH_THIS_PROCESS, 'bash', programs[0], '__name:=' + self.name[1:]],
                                         stdin=subprocess.PIPE, stdout=self._log, stderr=self._log, start_new_session=True)
        self.events = []
        self._changed = threading.Condition()
        self._subscriber = rospy.Subscriber(self.name + '/events', Event, self._hear, queue_size=1000) if listens else None
        try:
            self._wait()
        except BaseException:
            self.close()
            raise
        self.surgeon = Surgeon(self.name, LONG)
        self.surgeon.stepped()

    def _wait(self):
        end = time.monotonic() + LONG
        ready = False
        while not ready:
            if self._process.poll() is not None:
                raise RuntimeError('the node has ended: ' + self.output())
            if time.monotonic() > end:
                raise RuntimeError('the node does not answer: ' + self.output())
            try:
                rospy.wait_for_service(self.name + '/load', 0.2)  # the last that it offers
                ready = self._subscriber is None or connected(self._subscriber)
            except rospy.ROSException:
                pass

    def _hear(self, event):
        with self._changed:
            self.events.append(event)
            self._changed.notify_all()

    def wait_for_event(self, wanted, since=0, timeout=LONG):
        """Number of the first event from number `since` on for which wanted(event) holds; None where none comes."""
        end = time.monotonic() + timeout
        with self._changed:
            while True:
                for number in range(since, len(self.events)):
                    if wanted(self.events[number]):
                        return number
                left = end - time.monotonic()
                if left <= 0 or self._process.poll() is not None:
                    return None
                self._changed.wait(min(left, 0.5))

    def output(self):
        """What it has printed."""
        number = self._log.fileno()
        return os.pread(number, os.fstat(number).st_size, 0).decode(errors='replace')

    def close(self):
        if self._subscriber is not None:
            self._subscriber.unregister()
        if self._process.poll() is None:
            self._process.send_signal(signal.SIGTERM)
            try:
                self._process.wait(LONG)
            except subprocess.TimeoutExpired:
                os.killpg(self._process.pid, signal.SIGKILL)
                self._process.wait()
        self._process.stdin.close()
        self._log.close()

    def __enter__(self):
        return self

    def __exit__(self, *unused):
        self.close()


class SceneTestCase(unittest.TestCase):
    """Each test begins at the scene's start, paused. `surgeon` is a Surgeon."""

    scene = 'liver'        # a name in config/scenes, a path or package://
    parameters = {}        # of the node
    event_timeout = 20.0   # [s] of wall time that an event may take to come

    @classmethod
    def setUpClass(cls):
        cls.running = RunningScene(cls.scene, **cls.parameters)
        cls.surgeon = cls.running.surgeon

    @classmethod
    def tearDownClass(cls):
        cls.running.close()

    def setUp(self):
        heard = len(self.running.events)
        self.surgeon.stepped()
        self.surgeon.reset()
        reset = self.running.wait_for_event(lambda event: event.type == Event.RESET, heard)
        self.assertIsNotNone(reset, 'the node was reset and has not said so: ' + self.running.output())
        self._looked_at = reset + 1

    def step(self, steps=1):
        """Does steps; the simulated time after them [s]."""
        return self.surgeon.step(steps).sim_time

    def hash(self):
        """A number for the whole state: equal for equal histories."""
        return self.surgeon.hash()

    def expect_event(self, kind, body=None, pick_id=None):
        """The first such event of this test after those that were expected before; kinds are constants of Event."""
        def wanted(event):
            return event.type == kind and body in (None, event.body) and pick_id in (None, event.pick_id)
        number = self.running.wait_for_event(wanted, self._looked_at, self.event_timeout)
        if number is None:
            came = ', '.join('%s %s' % (event.type, event.body) for event in self.running.events[self._looked_at:])
            self.fail("no event '%s'%s has come, but %s" % (kind, '' if body is None else " of '%s'" % body, came or 'none'))
        self._looked_at = number + 1
        return self.running.events[number]

    @contextlib.contextmanager
    def expect_refusal(self, code=None):
        """What is asked inside is refused, with that ErrorCode, and the world stays as it was."""
        before = self.hash()
        with self.assertRaises(Refused) as refused:
            yield refused
        if code is not None:
            self.assertEqual(code, refused.exception.code, str(refused.exception))
        self.assertEqual(before, self.hash(), 'it was refused, and the world has changed')
