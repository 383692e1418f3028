"""What the rostests share: calls, recordings of topics, and a picture of the world to compare."""
import functools
import os
import subprocess
import sys
import tempfile
import threading
import time
import unittest

import roslib.packages
import rospy
import rosunit
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion, Vector3
from meshless_surgery.msg import State
from meshless_surgery.srv import (Cut, GetBody, Hash, Incise, LoadState, Lock, MovePick, Pick, Probe, Push, Release, Remove,
                                  SaveState, SetMaterial, Spawn, Step)
from standstill import Standstill
from std_msgs.msg import Header
from std_srvs.srv import SetBool, Trigger


TYPES = {
    'pick': Pick, 'move_pick': MovePick, 'lock': Lock, 'release': Release, 'clear_picks': Trigger, 'push': Push,
    'cut': Cut, 'open_scissors': Trigger, 'incise': Incise, 'spawn': Spawn, 'remove': Remove, 'set_material': SetMaterial, 'get_body': GetBody,
    'lift_scissors': Trigger, 'undo_cut': Trigger, 'probe': Probe, 'pause': SetBool, 'step': Step, 'reset': Trigger, 'save': SaveState, 'load': LoadState, 'hash': Hash,
}
# A bound for things that should have happened long before; no test measures time.
LONG = 120.0
# Of tests that move a hand by the clock: who shares a host stands still at times.
STOOD_STILL = 0.02  # [s]
ATTEMPTS = 8


class Deformer:
    """One node's services by name."""

    def __init__(self, node='/deformer'):
        self.node = node

    def call(self, service, **fields):
        name = self.node + '/' + service
        rospy.wait_for_service(name, LONG)
        return rospy.ServiceProxy(name, TYPES[service])(**fields)

    def recorder(self, topic, message_type):
        return Recorder(topic if topic.startswith('/') else self.node + '/' + topic, message_type)


class Recorder:
    """Every message of a topic from now on, connected to a publisher before it is handed out."""

    def __init__(self, topic, message_type, connected=True):
        self.topic = topic
        self.messages = []
        self.changed = threading.Condition()
        self.subscriber = rospy.Subscriber(topic, message_type, self._receive, queue_size=1000)
        end = time.monotonic() + LONG
        while connected and self.subscriber.get_num_connections() == 0:
            if time.monotonic() > end:
                raise AssertionError('nobody publishes ' + topic)
            time.sleep(0.005)

    def _receive(self, message):
        with self.changed:
            self.messages.append(message)
            self.changed.notify_all()

    def count(self):
        with self.changed:
            return len(self.messages)

    def wait(self, wanted=lambda message: True, since=0):
        """The first message from number `since` on for which wanted(message) holds."""
        end = time.monotonic() + LONG
        with self.changed:
            looked_at = since
            while True:
                while looked_at < len(self.messages):
                    if wanted(self.messages[looked_at]):
                        return self.messages[looked_at]
                    looked_at += 1
                left = end - time.monotonic()
                if left <= 0:
                    raise AssertionError('no such message on %s among %d' % (self.topic, len(self.messages)))
                self.changed.wait(left)

    def next(self, wanted=lambda message: True):
        return self.wait(wanted, since=self.count())

    def close(self):
        self.subscriber.unregister()


def by_the_clock(test):
    """Of a test whose hand moves by the clock: where it fails and a processor stood still meanwhile, it is done again. A
    failure while they ran stands, and the last one. The test finds the watch in self.standstill."""
    @functools.wraps(test)
    def wrapper(self):
        for attempt in range(ATTEMPTS):
            with Standstill() as self.standstill:
                try:
                    return test(self)
                except AssertionError as failure:
                    if attempt + 1 == ATTEMPTS or self.standstill.longest() < STOOD_STILL:
                        raise
                    print('%s: done again: a processor stood still for %.2f s: %s' % (
                        test.__name__, self.standstill.longest(), failure))
            self.tearDown()
            self.setUp()
    return wrapper


class OwnNode:
    """A deformer_node of this test, with these private parameters; `prefix` goes before its command."""

    count = 0

    def __init__(self, prefix=(), **parameters):
        OwnNode.count += 1
        self.name = '/own_deformer_%d' % OwnNode.count
        for key, value in parameters.items():
            rospy.set_param('%s/%s' % (self.name, key.replace('__', '/')), value)
        binary = roslib.packages.find_node('meshless_surgery', 'deformer_node')[0]
        self.log = tempfile.TemporaryFile(mode='w+', errors='replace')
        self.process = subprocess.Popen(list(prefix) + [binary, '__name:=' + self.name[1:]], stdout=self.log,
                                        stderr=self.log)
        self.deformer = Deformer(self.name)

    def wait(self):
        """Until it offers its services, the last of which is this one."""
        end = time.monotonic() + LONG
        while True:
            if self.process.poll() is not None:
                raise AssertionError('the node has ended: ' + self.output())
            try:
                rospy.wait_for_service(self.name + '/spawn', 0.5)
                return self
            except rospy.ROSException:
                if time.monotonic() > end:
                    raise

    def call(self, service, **fields):
        return self.deformer.call(service, **fields)

    def good(self, service, **fields):
        answer = self.call(service, **fields)
        if not answer.success:
            raise AssertionError('%s: %s' % (service, answer.message))
        return answer

    def hash(self):
        return self.good('hash').hash

    def output(self):
        # Not through the file object: the node writes where its offset is.
        number = self.log.fileno()
        return os.pread(number, os.fstat(number).st_size, 0).decode(errors='replace')

    def end(self, signal_number=15):
        """Its exit code after that signal."""
        self.process.send_signal(signal_number)
        return self.process.wait(LONG)

    def __enter__(self):
        return self.wait()

    def __exit__(self, *unused):
        if self.process.poll() is None:
            self.end(9)
        self.log.close()


def header(frame='', stamp=rospy.Time(0)):
    return Header(frame_id=frame, stamp=stamp)


def pose_stamped(x=0.0, y=0.0, z=0.0, quaternion=(0.0, 0.0, 0.0, 1.0), frame=''):
    return PoseStamped(header=header(frame), pose=Pose(position=Point(x, y, z), orientation=Quaternion(*quaternion)))


# Blades in a plane x = const: the pose's z axis is the world's x, its x axis the world's y.
ACROSS_X = (0.5, 0.5, 0.5, 0.5)


class DeformerTestCase(unittest.TestCase):
    """Starts every test from the scene's start, paused."""

    node = '/deformer'

    def setUp(self):
        self.deformer = Deformer(self.node)
        self.assertTrue(self.call('pause', data=True).success)
        self.assertTrue(self.call('reset').success)
        self.states = self.deformer.recorder('state', State)

    def tearDown(self):
        self.states.close()

    def call(self, service, **fields):
        return self.deformer.call(service, **fields)

    def good(self, service, **fields):
        answer = self.call(service, **fields)
        self.assertTrue(answer.success, '%s: %s' % (service, answer.message))
        self.assertNotEqual('', answer.message)
        return answer

    def state(self):
        """The state as it is after every call that was answered before."""
        asked = rospy.Time.now()
        return self.states.next(lambda state: state.header.stamp >= asked)

    def picture(self):
        state = self.state()
        bodies = {}
        for body in state.bodies:
            answer = self.good('get_body', name=body.name)
            bodies[body.name] = (answer.particles.data, answer.volume, answer.mass)
        picks = [(p.pick_id, p.body, p.locked, p.target.x, p.target.y, p.target.z) for p in state.picks]
        return state.step, bodies, picks

    def refused(self, words, service, **fields):
        """Refused, with all the words in the message, and nothing has changed."""
        before = self.picture()
        answer = self.call(service, **fields)
        self.assertFalse(answer.success, service + ' was not refused: ' + answer.message)
        for word in words:
            self.assertIn(word, answer.message)
        self.assertEqual(before, self.picture())
        return answer

    def pick_left(self):
        return self.good('pick', point=Point(-0.15, 0.0, 0.1), direction=Vector3(0, 0, 0), body='left',
                         max_distance=0.05)


def run(name, *cases):
    """The main function of a rostest: all tests of all cases, with the result file that rostest asks for."""
    rospy.init_node(name + '_test')
    suite = unittest.TestSuite(unittest.defaultTestLoader.loadTestsFromTestCase(case) for case in cases)
    flag = '--gtest_output=xml:'
    files = [argument[len(flag):] for argument in sys.argv if argument.startswith(flag)]
    if files:
        result = rosunit.create_xml_runner('meshless_surgery', name, files[0]).run(suite)
        rosunit.print_unittest_summary(result)
    else:
        result = unittest.TextTestRunner(verbosity=2).run(suite)
    rospy.signal_shutdown('tests are done')
    sys.exit(0 if result.wasSuccessful() and result.testsRun > 0 else 1)
