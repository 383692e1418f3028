#!/usr/bin/env python3
"""With publish_clock the node is the clock: /clock goes with its steps, and these do not wait for it."""
import os
import subprocess
import sys
import tempfile
import time
import unittest
import xmlrpc.client

import rosbag
import roslib.packages
import rosgraph
import rospy
from geometry_msgs.msg import PoseStamped
from meshless_surgery.msg import State
from rosgraph_msgs.msg import Clock

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from deformer_support import LONG, HandClock, OwnNode, Recorder, pose_stamped, run  # noqa: E402

SCENE = os.path.join(os.path.dirname(os.path.abspath(__file__)), 'scenes', 'falling.yaml')
STEP = 1.0 / 120.0


class PublishClockTest(unittest.TestCase):
    """This process itself goes by the wall."""

    def setUp(self):
        rospy.set_param('/use_sim_time', True)
        self.node = OwnNode(scene=SCENE, publish_clock=True, paused=True, state_rate=200.0)
        self.node.wait()
        self.clock = Recorder('/clock', Clock)
        self.states = self.node.deformer.recorder('state', State)
        self.begin = self.clock.wait().clock  # latched

    def tearDown(self):
        self.clock.close()
        self.states.close()
        self.node.end()
        self.node.__exit__()
        rospy.delete_param('/use_sim_time')

    def times(self):
        with self.clock.changed:
            return [(message.clock - self.begin).to_sec() for message in self.clock.messages]

    def wait_for(self, steps):
        """The times, once that of the step with this number is there."""
        self.clock.wait(lambda message: (message.clock - self.begin).to_sec() > (steps - 0.5) * STEP)
        return self.times()

    def test_each_step_is_said(self):
        self.assertGreater(self.begin.to_sec(), 1.7e9)  # the date
        self.node.good('step', steps=240)
        times = self.wait_for(240)
        self.assertEqual(241, len(times))
        for number, said in enumerate(times):
            self.assertAlmostEqual(number * STEP, said, delta=2e-9)
        state = self.states.next(lambda state: state.header.stamp - self.begin > rospy.Duration(239.5 * STEP))
        self.assertAlmostEqual(240 * STEP, state.sim_time, delta=1e-9)

    def test_it_stands_still_while_the_world_does_and_never_goes_back(self):
        self.node.good('step', steps=60)
        self.wait_for(60)
        self.states.wait(since=self.states.count() + 20)  # paused: states come by the wall
        self.node.good('reset')
        self.node.good('step', steps=60)
        times = self.wait_for(120)
        self.assertEqual(121, len(times))
        self.assertEqual(sorted(times), times)
        newcomer = Recorder('/clock', Clock)
        self.assertAlmostEqual(120 * STEP, (newcomer.wait().clock - self.begin).to_sec(), delta=2e-9)
        newcomer.close()

    def test_it_does_not_wait_for_itself(self):
        self.node.good('pause', data=False)
        times = self.wait_for(120)
        self.assertEqual(sorted(times), times)
        self.states.next(lambda state: state.sim_time > 1.0)

    def test_tools_go_by_it(self):
        shown = Recorder(self.node.name + '/push/measured_cp', PoseStamped)
        publisher = rospy.Publisher(self.node.name + '/push/servo_cp', PoseStamped, queue_size=10)
        while publisher.get_num_connections() == 0:
            time.sleep(0.005)
        publisher.publish(pose_stamped(0.0, 0.0, 1.0))
        shown.wait(lambda message: not message.header.stamp.is_zero())
        # Half a second of silence is half a second of steps.
        shown.wait(since=shown.count() + 60)
        self.assertFalse(any(message.header.stamp.is_zero() for message in shown.messages))
        self.node.good('pause', data=False)
        shown.wait(lambda message: message.header.stamp.is_zero())
        # By its own messages, as those of two topics come in any order.
        last = max(message.header.stamp for message in shown.messages if not message.header.stamp.is_zero())
        # A busy machine leaves messages out, so the last one may be older.
        self.assertGreater((last - self.begin).to_sec(), 0.25)
        shown.close()
        publisher.unregister()

    def test_a_bag_is_in_step(self):
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, 'steps.bag')
            record = roslib.packages.find_node('rosbag', 'record')[0]  # the rosbag command hands no signal on
            recorder = subprocess.Popen([record, '-O', path, '/clock', self.node.name + '/state'],
                                        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            master = rosgraph.Master(rospy.get_name())
            node = xmlrpc.client.ServerProxy(master.lookupNode(self.node.name))
            connected = set()
            while not {'/clock', self.node.name + '/state'} <= connected:
                self.assertIsNone(recorder.poll())
                connected = {line[4] for line in node.getBusInfo(rospy.get_name())[2] if '/record' in line[1]}
                time.sleep(0.02)
            self.node.good('pause', data=False)
            self.wait_for(240)
            recorder.send_signal(2)
            recorder.wait(LONG)
            with rosbag.Bag(path) as bag:
                messages = [(topic, message, at) for topic, message, at in bag.read_messages()]
        clocks = {message.clock for message in self.clock.messages}
        self.assertLessEqual({message.clock for topic, message, at in messages if topic == '/clock'}, clocks)
        stamps = [message.header.stamp for topic, message, at in messages if topic != '/clock']
        self.assertGreater(len(stamps), 1)
        self.assertLessEqual(set(stamps), clocks)  # each is the time of a step
        # The bag's own times are these too, so that it is played back at the pace of the steps.
        self.assertLessEqual({at for topic, message, at in messages}, clocks)

    def test_another_one_that_comes_later_is_named(self):
        self.node.good('pause', data=False)
        other = rospy.Publisher('/clock', Clock, queue_size=10)
        self.addCleanup(other.unregister)
        end = time.monotonic() + LONG
        while "'%s' publishes it too" % rospy.get_name() not in self.node.output():
            self.assertLess(time.monotonic(), end)
            other.publish(Clock(clock=rospy.Time(5.0)))
            time.sleep(0.02)
        at = self.states.next().sim_time
        self.states.next(lambda state: state.sim_time > at + 0.5)


class RefusedClockTest(unittest.TestCase):

    def refused(self, *words):
        node = OwnNode(scene=SCENE, publish_clock=True)
        self.assertEqual(1, node.process.wait(LONG), node.output())
        for word in words:
            self.assertIn(word, node.output())
        node.__exit__()

    def test_without_simulated_time(self):
        self.refused('~publish_clock', '/use_sim_time', 'accepted')

    def test_beside_another_clock(self):
        clock = HandClock()
        self.addCleanup(clock.close)
        self.refused('~publish_clock', "'%s' publishes /clock" % rospy.get_name(), 'accepted')


if __name__ == '__main__':
    run('publish_clock', PublishClockTest, RefusedClockTest)
