"""What the rostests share: calls, recordings of topics, and a picture of the world to compare."""
import os
import subprocess
import sys
import tempfile
import threading
import time
import unittest

import roslaunch.config
import roslib.packages
import rospy
import rosunit
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion, Vector3
from meshless_surgery.crtk import StringStamped, operating_state as OperatingState  # noqa: F401: for those who import this
from meshless_surgery.msg import Event, State
from meshless_surgery.srv import (ApplyForce, Attach, AttachInstrument, Clip, Cut, Detach, DetachInstrument, GetBody, GetLoad, Hash, Incise, LoadState, Lock, MoveClamp, MovePick, Observe, Pick, Probe, Push,
                                  Release, Remove, Report, ResetBodies, SaveState, SetGravity, SetMaterial, SetPose, Spawn, SpawnCloud, StartTask, Step, Unclip)
from meshless_surgery.topics import connected
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Header
from std_srvs.srv import SetBool, Trigger


TYPES = {
    'attach': Attach, 'detach': Detach, 'clip': Clip, 'unclip': Unclip, 'pick': Pick, 'move_pick': MovePick, 'lock': Lock, 'release': Release, 'clear_picks': Trigger, 'push': Push,
    'cut': Cut, 'open_scissors': Trigger, 'incise': Incise, 'spawn': Spawn, 'spawn_cloud': SpawnCloud, 'remove': Remove, 'set_material': SetMaterial, 'get_body': GetBody, 'get_load': GetLoad, 'move_clamp': MoveClamp,
    'lift_scissors': Trigger, 'undo_cut': Trigger, 'probe': Probe, 'pause': SetBool, 'step': Step, 'reset': Trigger, 'save': SaveState, 'load': LoadState, 'hash': Hash,
    'attach_instrument': AttachInstrument, 'detach_instrument': DetachInstrument,
    'apply_force': ApplyForce, 'set_gravity': SetGravity, 'set_pose': SetPose, 'reset_bodies': ResetBodies,
    'start_task': StartTask, 'stop_task': Trigger, 'report': Report, 'observe': Observe,
}
# Messages and services of the other node: review_test.py has their laws.
OF_REVIEW = ('Bookmarks', 'Play', 'Review', 'Seek')
# A bound for things that should have happened long before; no test measures time.
LONG = 120.0


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

    def __init__(self, topic, message_type, wait=True):
        self.topic = topic
        self.messages = []
        self.changed = threading.Condition()
        self.subscriber = rospy.Subscriber(topic, message_type, self._receive, queue_size=1000)
        end = time.monotonic() + LONG
        while wait and not connected(self.subscriber):
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


class HandClock:
    """The time of all nodes that start inside of it: /clock, which stands still but where the test moves it. The test itself
    goes by the wall."""

    def __init__(self, begin=1000.0):
        self.now = begin
        rospy.set_param('/use_sim_time', True)
        self.publisher = rospy.Publisher('/clock', Clock, queue_size=100, latch=True)
        self.advance(0.0)

    def advance(self, seconds):
        self.now += seconds
        self.publisher.publish(Clock(clock=self.stamp()))

    def stamp(self):
        return rospy.Time.from_sec(self.now)

    def close(self):
        rospy.delete_param('/use_sim_time')
        self.publisher.unregister()


class OwnNode:
    """A deformer_node of this test, with these private parameters; `prefix` goes before its command."""

    count = 0
    signal = 9  # the last that was sent

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
        self.signal = signal_number
        self.process.send_signal(signal_number)
        return self.process.wait(LONG)

    def __enter__(self):
        return self.wait()

    def __exit__(self, failure=None, *unused):
        """A crash counts, at shutdown too. 1 is how it refuses to start."""
        if self.process.poll() is None:
            self.end(9 if failure else 15)
        code, output = self.process.poll(), self.output()
        self.log.close()
        if code not in ((0, 1, -9) if self.signal == 9 else (0, 1)) and not failure:
            raise AssertionError('the node ended with %s: %s' % (code, output))


def launched(file, *arguments):
    """The nodes of a launch file of the package, by name: their arguments."""
    path = os.path.join(os.path.dirname(os.path.abspath(__file__)), '..', '..', 'launch', file)
    config = roslaunch.config.load_config_default([(path, list(arguments))], None)
    return {node.namespace + node.name: node.args.split() for node in config.nodes}


def law_holds(law, holds):
    """Whether a law holds, or stands in test/falls_short.txt since it is known not to: as in support/falls_short.h."""
    listed = os.path.join(os.path.dirname(os.path.abspath(__file__)), '..', 'falls_short.txt')
    with open(listed, encoding='utf-8') as lines:
        known = any(line.startswith(law + ' | ') for line in lines)
    return holds != known


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
        self.call('stop_task')  # one that runs refuses a pause
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
        self.assertEqual(0, getattr(answer, 'error_code', 0), service)
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
        self.assertNotEqual(0, getattr(answer, 'error_code', 1), service)
        for word in words:
            self.assertIn(word, answer.message)
        self.assertEqual(before, self.picture())
        return answer

    def pick_left(self):
        return self.good('pick', point=Point(-0.15, 0.0, 0.1), direction=Vector3(0, 0, 0), body='left',
                         max_distance=0.05)


class InStepTestCase(DeformerTestCase):
    """A node of its own, whose clock goes on only once it has done all that was due: however long one of the two stands
    still, what the test sees is the same. Starts every test from the scene's start, running."""

    scene = 'boxes'
    step_rate = 120.0
    parameters = {}
    PERIOD = 0.005  # [s] between two messages of a stream

    @classmethod
    def setUpClass(cls):
        cls.clock = HandClock()
        scene = os.path.join(os.path.dirname(os.path.abspath(__file__)), 'scenes', cls.scene + '.yaml')
        cls.own = OwnNode(**{'scene': scene, 'state_rate': 1000.0, **cls.parameters})
        cls.node = cls.own.name
        cls.own.wait()

    @classmethod
    def tearDownClass(cls):
        cls.own.end()
        cls.own.__exit__()
        cls.clock.close()

    def setUp(self):
        self.opened = []
        self.publishers = {}
        self.runs_since = None
        super().setUp()
        self.events = self.record('events', Event)
        self.pause(False)

    def tearDown(self):
        for opened in self.opened:
            opened.close()
        for publisher in self.publishers.values():
            publisher.unregister()
        super().tearDown()

    def record(self, topic, message_type):
        recorder = self.deformer.recorder(topic, message_type)
        self.opened.append(recorder)
        return recorder

    def pause(self, paused):
        self.advance()  # so that the node knows the time that the pause ends at
        self.good('pause', data=paused)
        self.runs_since = None if paused else (self.clock.now, self.state().step)

    def advance(self, seconds=None):
        """The state once that time (or PERIOD) has passed, and all that was due by then is done."""
        self.clock.advance(self.PERIOD if seconds is None else seconds)
        now = self.clock.stamp()
        steps = 0
        if self.runs_since:
            begin, step = self.runs_since
            steps = step + int((self.clock.now - begin) * self.step_rate - 1e-6)
        try:
            return self.states.wait(lambda s: s.header.stamp >= now and s.step >= steps, max(0, self.states.count() - 1))
        except AssertionError as error:
            last = self.states.messages[-1]
            raise AssertionError('%s; the last is of step %d at %s, not of step %d at %s' %
                                 (error, last.step, last.header.stamp.to_sec(), steps, now.to_sec()))

    def pass_time(self, seconds):
        """What was said at each of its moments."""
        return [self.advance() for _ in range(int(round(seconds / self.PERIOD)))]

    def state(self):
        return self.advance(0.001)

    def publisher(self, topic, kind=PoseStamped):
        if topic not in self.publishers:
            publisher = rospy.Publisher(self.node + '/' + topic, kind, queue_size=100)
            self.publishers[topic] = publisher
            end = time.monotonic() + LONG
            while publisher.get_num_connections() == 0:
                self.assertLess(time.monotonic(), end, 'nobody listens to ' + topic)
                time.sleep(0.005)
        return self.publishers[topic]

    def say(self, topic, poses):
        """One pose after the other, a moment each; the states in between."""
        publisher, states = self.publisher(topic), []
        for pose in poses:
            if pose.header.stamp.is_zero():
                pose.header.stamp = self.clock.stamp()
            publisher.publish(pose)
            states.append(self.advance())
        return states

    def until(self, wanted, what):
        """Time passes until wanted(state) holds."""
        end = time.monotonic() + LONG
        while True:
            state = self.advance()
            if wanted(state):
                return state
            self.assertLess(time.monotonic(), end, what)


def run(name, *cases):
    """The main function of a rostest: all tests of all cases, with the result file that rostest asks for. MESHLESS_SURGERY_CASE
    in the environment: those with it in their names alone."""
    rospy.init_node(name + '_test')
    unittest.defaultTestLoader.testNamePatterns = ['*%s*' % os.environ.get('MESHLESS_SURGERY_CASE', '')]
    suite = unittest.TestSuite(unittest.defaultTestLoader.loadTestsFromTestCase(case) for case in cases)
    flag = '--gtest_output=xml:'
    files = [argument[len(flag):] for argument in sys.argv if argument.startswith(flag)]
    if files:
        result = rosunit.create_xml_runner('meshless_surgery', name, files[0]).run(suite)
        for part, why in result.failures + result.errors:
            if isinstance(part, unittest.case._SubTest):  # which the runner counts, and does not print
                print('%s\n%s' % (part, why))
        rosunit.print_unittest_summary(result)
    else:
        result = unittest.TextTestRunner(verbosity=2).run(suite)
    rospy.signal_shutdown('tests are done')
    sys.exit(0 if result.wasSuccessful() and result.testsRun > 0 else 1)
