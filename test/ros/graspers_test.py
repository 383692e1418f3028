#!/usr/bin/env python3
"""Instruments of a scene, as a script and a device lead them: a block is grasped by friction, lifted, and let go."""
import math
import os
import sys

import numpy
import rospy
import tf2_ros
from geometry_msgs.msg import PoseStamped, TwistStamped, WrenchStamped
from meshless_surgery import Refused, Surgeon
from meshless_surgery.msg import Event
from sensor_msgs.msg import JointState

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from deformer_support import LONG, DeformerTestCase, OperatingState, StringStamped, run  # noqa: E402

DOWN = (0.0, math.sqrt(0.5), 0.0, math.sqrt(0.5))
WEIGHT = 0.03 * 0.01 * 0.03 * 1000 * 9.81


class GraspersTest(DeformerTestCase):

    def setUp(self):
        super().setUp()
        self.surgeon = Surgeon(self.node)
        self.good('pause', data=False)

    def state_where(self, wanted):
        return self.states.next(wanted)

    def lead(self, stream, begin, end, jaw, seconds):
        """Evenly from one height to the other, at 50 Hz."""
        rate, steps = rospy.Rate(50), max(1, int(50 * seconds))
        for step in range(1, steps + 1):
            stream.move((0, 0, begin + (end - begin) * step / steps), DOWN)
            stream.jaw(jaw)
            rate.sleep()

    def test_a_block_is_grasped_lifted_and_let_go(self):
        events = self.deformer.recorder('events', Event)
        with self.surgeon.stream('left') as left:
            self.lead(left, 0.08, 0.08, 1.2, 0.5)
            self.state_where(lambda s: s.instruments[0].jaw > 1.19)
            self.lead(left, 0.08, 0.02, 1.2, 0.8)
            self.lead(left, 0.02, 0.02, 0.0, 0.8)
            grasped = events.wait(lambda e: e.type == Event.GRASPED and e.body == 'block')
            self.assertEqual('left', grasped.instrument)
            self.assertGreater(grasped.force, 0.01)
            self.lead(left, 0.02, 0.12, 0.0, 1.5)
            held = self.state_where(lambda s: s.bodies[0].centre_of_mass.z > 0.09 and
                                    abs(s.instruments[0].force.z + WEIGHT) < 0.03 * WEIGHT)
            self.assertEqual(('block', 'grasper'), (held.instruments[0].holds, held.instruments[0].type))
            self.assertGreater(held.instruments[0].grip, 0.1)
            self.assertGreater(held.instruments[0].jaw, 0.01)
            # The weight pulls at its centre.
            tip, centre, torque = (numpy.array((p.x, p.y, p.z)) for p in (
                held.instruments[0].pose.position, held.bodies[0].centre_of_mass, held.instruments[0].torque))
            self.assertLess(numpy.abs(torque - numpy.cross(centre - tip, (0, 0, -WEIGHT))).max(), 0.003 * WEIGHT)
            # In its own frame, as CRTK has it: x points down.
            force = self.deformer.recorder('left/body/measured_cf', WrenchStamped).wait(
                lambda m: abs(m.wrench.force.x - WEIGHT) < 0.03 * WEIGHT)
            self.assertEqual('left', force.header.frame_id)
            # Its stream falls silent: it lets go of nothing.
            rospy.sleep(1.0)
            self.assertEqual('block', self.state_where(lambda s: True).instruments[0].holds)
            jaw = self.deformer.recorder('left/jaw/measured_js', JointState).wait(lambda m: True)
            self.assertAlmostEqual(held.instruments[0].jaw, jaw.position[0], delta=0.02)
            # Of both jaws, half each: what they press on is between hinge and tip.
            self.assertTrue(0.0 < jaw.effort[0] < 0.018 * 1.1 * held.instruments[0].grip, jaw.effort)
            self.lead(left, 0.12, 0.12, 1.2, 0.5)
            events.wait(lambda e: e.type == Event.RELEASED and e.body == 'block')
            self.state_where(lambda s: s.bodies[0].centre_of_mass.z < 0.03)

    def test_scissors_cut_as_far_as_their_blades_close(self):
        events = self.deformer.recorder('events', Event)
        self.surgeon.attach_instrument('right', '{type: scissors, grip: 50, jaw_length: 0.03, jaw_thickness: 0.003}', (0, 0, 0.09), DOWN)
        with self.surgeon.stream('right') as right:
            self.lead(right, 0.09, 0.09, 1.2, 0.4)
            self.state_where(lambda s: s.instruments[-1].jaw > 1.19)
            self.lead(right, 0.09, 0.02, 1.2, 0.8)
            self.lead(right, 0.02, 0.02, 0.0, 0.8)
            cut = events.wait(lambda e: e.type == Event.INCISED and e.body == 'block')
            self.assertEqual('right', cut.instrument)
            self.lead(right, 0.02, 0.09, 0.0, 0.4)
        self.good('undo_cut')
        self.surgeon.detach_instrument('right')

    def test_its_topics_and_its_frame_say_where_it_is(self):
        buffer = tf2_ros.Buffer()
        listener = tf2_ros.TransformListener(buffer)
        with self.surgeon.stream('left') as left:
            self.lead(left, 0.08, 0.2, 0.3, 0.5)
            measured = self.deformer.recorder('left/measured_cp', PoseStamped).wait(lambda m: abs(m.pose.position.z - 0.2) < 1e-6)
            self.assertAlmostEqual(DOWN[1], measured.pose.orientation.y, 6)
            self.deformer.recorder('left/setpoint_cp', PoseStamped).wait(lambda m: abs(m.pose.position.z - 0.2) < 1e-9)
            self.deformer.recorder('left/measured_cv', TwistStamped).wait(lambda m: abs(m.twist.linear.z) < 1e-6)
            end = rospy.Time.now() + rospy.Duration(LONG)
            while not buffer.can_transform('world', 'left', rospy.Time(0)) or abs(
                    buffer.lookup_transform('world', 'left', rospy.Time(0)).transform.translation.z - 0.2) > 1e-6:
                self.assertLess(rospy.Time.now(), end)
                rospy.sleep(0.01)
        listener.unregister()

    def test_one_that_is_disabled_hears_nothing(self):
        states = self.deformer.recorder('left/operating_state', OperatingState)
        commands = rospy.Publisher(self.node + '/left/state_command', StringStamped, queue_size=10, latch=True)
        with self.surgeon.stream('left') as left:
            commands.publish(StringStamped(string='disable'))
            states.wait(lambda m: m.state == 'DISABLED')
            left.move((0, 0, 0.3), DOWN)
            rospy.sleep(0.3)
            self.assertAlmostEqual(0.08, self.state_where(lambda s: True).instruments[0].pose.position.z, 9)
            self.assertIn('the instrument left stays DISABLED until its state_command is enable', self.deformer.call('reset').message)
            commands.publish(StringStamped(string='enable'))
            states.wait(lambda m: m.state == 'ENABLED', states.count() - 1)
            left.move((0, 0, 0.3), DOWN)
            self.state_where(lambda s: abs(s.instruments[0].pose.position.z - 0.3) < 1e-6)

    def test_scripts_take_instruments_up_and_put_them_away(self):
        self.surgeon.attach_instrument('right', '{type: hook, max_force: 3}', (0.2, 0, 0.2), DOWN)
        with self.surgeon.stream('right') as right:
            right.move((0.2, 0, 0.25), DOWN)
            self.state_where(lambda s: len(s.instruments) == 2 and abs(s.instruments[1].pose.position.z - 0.25) < 1e-6)
        for name, yaml, place, said in (
                ('right', '{type: probe}', (0.3, 0, 0.2), "there is an instrument 'right' already"),
                ('push', '{type: probe}', (0.3, 0, 0.2), 'not pick, push, scissors'),
                ('new', '{type: laser}', (0.3, 0, 0.2), 'probe, grasper, hook, scissors'),
                ('new', '{type: probe, max_force: 0}', (0.3, 0, 0.2), 'max_force is 0; accepted: 0.01 to 10000 N'),
                ('new', '{type: probe, max_forse: 1}', (0.3, 0, 0.2), "did you mean 'max_force'"),
                ('new', '{type: probe}', (0, 0, 0.015), "would be inside of body 'block'")):
            with self.subTest(name=name, yaml=yaml):
                with self.assertRaises(Refused) as refused:
                    self.surgeon.attach_instrument(name, yaml, place)
                self.assertIn(said, str(refused.exception))
        self.surgeon.detach_instrument('right')
        self.assertEqual(['left'], [i.name for i in self.state_where(lambda s: len(s.instruments) == 1).instruments])
        self.surgeon.attach_instrument('right', '{type: probe}', (0.2, 0, 0.2))
        self.call('reset')
        self.state_where(lambda s: [i.name for i in s.instruments] == ['left'])


if __name__ == '__main__':
    run('graspers', GraspersTest)
