#!/usr/bin/env python3
"""Devices lead instruments: device.py between drivers, whose messages these tests send, and a running deformer."""
import contextlib
import math
import os
import subprocess
import sys
import tempfile
import threading
import time

import roslib.packages
import rospy
import tf2_ros
from geometry_msgs.msg import PoseStamped, TransformStamped, WrenchStamped
from meshless_surgery import Surgeon
from meshless_surgery.msg import Event
from meshless_surgery.devices import DeviceButtonEvent, DeviceFeedback, OmniButtonEvent, OmniFeedback
from meshless_surgery.teleoperation import NO_TURN, of_turn, product, turned
from sensor_msgs.msg import JointState, Joy
from std_msgs.msg import Bool

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from deformer_support import LONG, DeformerTestCase, Recorder, launched, pose_stamped, run  # noqa: E402

DOWN = (0.0, math.sqrt(0.5), 0.0, math.sqrt(0.5))
WEIGHT = 0.03 * 0.01 * 0.03 * 1000 * 9.81
START = (0.01, 0.02, 0.03)


class Driver:
    """Says at 100 Hz where its device is. `unit` is what it calls 1, in m."""

    def __init__(self, topic, unit=1.0, kind=PoseStamped, frame=''):
        self.at, self.turn, self.unit, self.kind, self.frame = START, NO_TURN, unit, kind, frame
        self.speaks = self.runs = True
        self.publisher = rospy.Publisher(topic, kind, queue_size=10, tcp_nodelay=True)
        self.thread = threading.Thread(target=self._run)
        self.thread.start()

    def _run(self):
        while self.runs:
            if self.speaks:
                self.publisher.publish(self.message())
            time.sleep(0.01)

    def message(self):
        at = tuple(x / self.unit for x in self.at)
        pose = pose_stamped(*at, quaternion=self.turn, frame=self.frame)
        if self.kind is PoseStamped:
            return pose
        transform = TransformStamped(header=pose.header)
        transform.transform.translation.x, transform.transform.translation.y, transform.transform.translation.z = at
        transform.transform.rotation = pose.pose.orientation
        return transform

    def go(self, by, seconds=0.5):
        begin, steps = self.at, max(1, int(100 * seconds))
        for step in range(1, steps + 1):
            self.at = tuple(b + step / steps * d for b, d in zip(begin, by))
            time.sleep(0.01)

    def end(self):
        if not self.runs:
            return
        self.runs = False
        self.thread.join()
        self.publisher.unregister()


class DevicesTest(DeformerTestCase):

    count = 0

    def setUp(self):
        super().setUp()
        self.surgeon = Surgeon(self.node)
        self.good('pause', data=False)

    @contextlib.contextmanager
    def bridge(self, device, **parameters):
        """device.py for the scene's instrument; it has taken hold where it leads by poses."""
        DevicesTest.count += 1
        name = 'device_%d' % DevicesTest.count
        for key, value in {'device': device, 'instrument': 'left', **parameters}.items():
            rospy.set_param('/%s/%s' % (name, key), value)
        program = roslib.packages.find_node('meshless_surgery', 'device.py')[0]
        with tempfile.TemporaryFile(mode='w+') as log:
            process = subprocess.Popen([program, '__name:=' + name], stdout=log, stderr=log)
            def said(words, long=LONG):
                end = time.monotonic() + long
                while words not in os.pread(log.fileno(), 1 << 20, 0).decode(errors='replace'):
                    self.assertLess(time.monotonic(), end, words)
                    time.sleep(0.05)
            process.said = said
            try:
                yield process
            finally:
                ended = process.poll() is not None
                process.terminate()
                process.wait(LONG)
                rospy.delete_param('/' + name)
                self.said = os.pread(log.fileno(), 1 << 20, 0).decode(errors='replace')
        self.assertNotIn('Traceback', self.said)
        self.assertEqual(2 if ended else 0, process.returncode, self.said)

    def driver(self, *arguments, **keywords):
        driver = Driver(*arguments, **keywords)
        self.addCleanup(driver.end)
        return driver

    def taken(self):
        """The device leads: its first pose has come."""
        recorder = self.deformer.recorder('left/servo_cp', PoseStamped)
        recorder.wait()
        recorder.close()

    def button(self, topic, kind):
        publisher = rospy.Publisher(topic, kind, queue_size=10, latch=True)
        self.addCleanup(publisher.unregister)
        return publisher

    def press(self, button, message):
        end = time.monotonic() + LONG
        while button.get_num_connections() == 0:
            self.assertLess(time.monotonic(), end, 'nobody hears ' + button.name)
            time.sleep(0.01)
        button.publish(message)
        time.sleep(0.3)

    def left_at(self, wanted, within=1e-4):
        def there(state):
            at = next(i for i in state.instruments if i.name == 'left').pose.position
            return all(abs(a - b) < within for a, b in zip((at.x, at.y, at.z), wanted))
        return self.states.next(there)

    def left(self):
        state = self.state()
        return next(i for i in state.instruments if i.name == 'left')

    def jaw(self, wanted, within=0.02):
        self.states.next(lambda s: abs(s.instruments[0].jaw - wanted) < within)

    def assert_turn(self, wanted, orientation):
        q = (orientation.x, orientation.y, orientation.z, orientation.w)
        self.assertGreater(abs(sum(a * b for a, b in zip(q, wanted))), 1 - 1e-5, q)

    def test_a_touch_moves_turns_closes_and_is_clutched(self):
        # As its driver does: z is up in positions, y in orientations, and the stylus lies as it likes.
        lies = of_turn((0, 0, -0.5 * math.pi))
        driver, button = self.driver('/phantom/pose'), self.button('/phantom/button', OmniButtonEvent)
        driver.turn = lies
        with self.bridge('touch', scale=2.0):
            self.taken()
            self.left_at((0, 0, 0.08))
            driver.go((0.01, -0.02, 0.03))
            self.left_at((0.02, -0.04, 0.14))
            driver.turn = product(of_turn((0, 0.5, 0)), lies)
            self.states.next(lambda s: abs(s.instruments[0].pose.orientation.x) > 0.1)
            time.sleep(0.3)
            self.assert_turn(product(of_turn((0, 0, 0.5)), DOWN), self.left().pose.orientation)
            # Clutched: the hand goes back, the instrument does not.
            self.press(button, OmniButtonEvent(grey_button=1))
            driver.go((0.05, 0.05, -0.02))
            driver.turn = lies
            time.sleep(0.3)
            self.left_at((0.02, -0.04, 0.14))
            self.assert_turn(product(of_turn((0, 0, 0.5)), DOWN), self.left().pose.orientation)
            self.press(button, OmniButtonEvent())
            driver.go((0, 0, 0.01))
            self.left_at((0.02, -0.04, 0.16))
            self.jaw(0.0)
            self.press(button, OmniButtonEvent(white_button=1))
            self.press(button, OmniButtonEvent())
            self.jaw(0.8)
            self.press(button, OmniButtonEvent(white_button=1))
            self.jaw(0.0)
            # Silent: it stays. What the hand did meanwhile moves nothing.
            driver.speaks = False
            time.sleep(0.1)
            driver.at = (0.2, 0.2, 0.2)
            time.sleep(1.0)
            driver.speaks = True
            time.sleep(0.3)
            self.left_at((0.02, -0.04, 0.16))
        self.assertIn('/phantom is silent', self.said)

    def test_away_is_where_the_camera_looks(self):
        driver = self.driver('/phantom/pose')
        with tempfile.NamedTemporaryFile(mode='w', suffix='.rviz') as config:
            config.write('Visualization Manager: {Views: {Current: {Yaw: 0.0}}}')  # from +x
            config.flush()
            with self.bridge('touch', rviz_config=config.name):
                self.taken()
                driver.go((0.01, 0.02, 0.03))
                self.left_at((-0.02, 0.01, 0.11))
            with self.bridge('touch', rviz_config=config.name, view='0 0 0'):
                self.taken()
                driver.go((0.01, 0.02, 0.03))
                self.left_at((-0.01, 0.03, 0.14))

    def test_after_a_reset_the_hand_takes_hold_anew(self):
        driver, button = self.driver('/phantom/pose'), self.button('/phantom/button', OmniButtonEvent)
        with self.bridge('touch'):
            self.taken()
            driver.go((0.1, 0.05, 0.2))
            self.left_at((0.1, 0.05, 0.28))
            for clutched in (0, 1, 0, 1, 0, 1):
                self.press(button, OmniButtonEvent(grey_button=clutched))
                self.call('reset')
                time.sleep(0.5)
                near = self.left().pose.position  # what was on the way when it was reset moves it for a moment
                self.assertLess(math.dist((near.x, near.y, near.z), (0, 0, 0.08)), 0.04)
                self.press(button, OmniButtonEvent())
                driver.go((0.05, 0.0, 0.02))
                self.left_at((near.x + 0.05, near.y, near.z + 0.02), 1e-3)

    def test_the_hand_feels_what_the_instrument_feels(self):
        driver, button = self.driver('/Geomagic/pose', unit=1e-3), self.button('/Geomagic/button', DeviceButtonEvent)
        with self.bridge('geomagic', jaw_open=1.2):
            forces = Recorder('/Geomagic/force_feedback', DeviceFeedback)
            self.addCleanup(forces.close)
            self.taken()
            self.press(button, DeviceButtonEvent(white_button=1))
            self.press(button, DeviceButtonEvent())
            self.jaw(1.2)
            driver.go((0, -0.06, 0), 1.0)  # y is up
            self.left_at((0, 0, 0.02), 2e-3)
            self.press(button, DeviceButtonEvent(white_button=1))
            self.states.next(lambda s: s.instruments[0].holds == 'block')
            time.sleep(0.3)
            driver.go((0, 0.1, 0), 1.5)
            self.states.next(lambda s: s.bodies[0].centre_of_mass.z > 0.09 and abs(s.instruments[0].force.z + WEIGHT) < 0.03 * WEIGHT)

            def weighs(f):
                return abs(f.force.y + WEIGHT) < 0.1 * WEIGHT and max(abs(f.force.x), abs(f.force.z)) < 0.1 * WEIGHT

            def none(f):
                return (f.force.x, f.force.y, f.force.z) == (0, 0, 0)
            felt = forces.next(weighs)
            self.assertEqual([False] * 3, list(felt.lock))
            self.assertAlmostEqual(felt.position.y, 1e3 * driver.at[1], delta=2.0)
            # No hand holds what is clutched or paused, and tissue pulls nothing that says nothing.
            heard = forces.count()
            button.publish(DeviceButtonEvent(white_button=1, grey_button=1))
            forces.wait(none, heard)
            button.publish(DeviceButtonEvent(white_button=1))
            forces.next(weighs)
            heard = forces.count()
            driver.speaks = False
            forces.wait(none, heard)
            self.assertEqual('block', self.state().instruments[0].holds)
            driver.speaks = True
            forces.next(weighs)
            heard = forces.count()
            self.good('pause', data=True)
            forces.wait(none, heard)
            before = self.left().pose.position
            driver.go((0.05, 0.05, 0.0), 0.3)
            self.good('pause', data=False)
            forces.next(weighs)
            after = self.left().pose.position
            self.assertLess(math.dist((before.x, before.y, before.z), (after.x, after.y, after.z)), 5e-3)
            self.good('pause', data=True)
            self.press(button, DeviceButtonEvent())
            self.good('pause', data=False)
            forces.next(weighs)
            time.sleep(0.5)
            self.assertEqual('block', self.state().instruments[0].holds)  # the hand comes back open
            self.press(button, DeviceButtonEvent(white_button=1))
            self.press(button, DeviceButtonEvent())
            self.states.next(lambda s: s.instruments[0].holds == '')
        end = time.monotonic() + LONG
        while not none(forces.messages[-1]):  # the last that a driver hears
            self.assertLess(time.monotonic(), end)
            time.sleep(0.05)

    def test_a_hand_is_pressed_no_more_than_it_may(self):
        driver = self.driver('/phantom/pose')
        with self.bridge('touch', max_force=0.5):
            forces = Recorder('/phantom/force_feedback', OmniFeedback)
            self.addCleanup(forces.close)
            self.taken()
            driver.go((0, 0, -0.12), 1.0)  # through the block, into the ground
            pressed = forces.next(lambda f: f.force.z > 0.4)
            self.assertLess(abs(pressed.force.x) + abs(pressed.force.y), 0.3)
            time.sleep(0.3)
            for message in forces.messages:
                self.assertLess(math.hypot(message.force.x, message.force.y, message.force.z), 0.5 + 1e-6)

    def test_drivers_hear_their_own_messages(self):
        # The sums are those that the drivers' packages make.
        for kind, md5 in ((DeviceFeedback, '94755b031db27fe99c2c235c0da9b072'), (OmniFeedback, 'e9083ac4fd95494e94fbb0c0f90b6c00'),
                          (OmniButtonEvent, 'fb77877e6b639935c3360838062f05f0'), (DeviceButtonEvent, 'fb77877e6b639935c3360838062f05f0')):
            self.assertEqual(md5, kind._md5sum, kind._type)

    def test_a_master_of_the_dvrk(self):
        clutch, present = self.button('/footpedals/clutch', Joy), self.button('/footpedals/coag', Joy)
        gripper = self.button('/MTML/gripper/measured_js', JointState)
        for kind in (PoseStamped, TransformStamped):  # of its newer and older releases
            self.call('reset')
            for pedal in (clutch, present):
                pedal.publish(Joy(buttons=[0]))
            driver = self.driver('/MTML/measured_cp', kind=kind)
            with self.bridge('dvrk', source='/MTML', scale=0.5):
                absolute = Recorder('/MTML/body/set_cf_orientation_absolute', Bool)
                self.assertTrue(absolute.wait().data)
                absolute.close()
                forces = Recorder('/MTML/body/servo_cf', WrenchStamped)
                self.press(gripper, JointState(position=[0.5]))
                driver.go((0.1, 0, 0), 0.1)  # nobody has his foot on the pedal
                time.sleep(0.3)
                self.left_at((0, 0, 0.08), 1e-9)
                self.assertEqual(0, forces.count())
                self.press(present, Joy(buttons=[1]))
                self.taken()
                driver.go((0.04, 0.08, 0.02))  # left, up, away
                self.left_at((-0.02, 0.01, 0.12))
                self.jaw(0.0)  # the hand has not been as far closed
                self.press(gripper, JointState(position=[-0.2]))
                self.press(gripper, JointState(position=[0.5]))
                self.jaw(0.4)
                self.press(clutch, Joy(buttons=[1]))
                driver.go((0.1, 0.1, 0.1), 0.1)
                time.sleep(0.3)
                self.press(clutch, Joy(buttons=[0]))
                driver.go((0.0, 0.02, 0.0))
                self.left_at((-0.02, 0.01, 0.13))
                forces.next()
                # The foot is lifted, and the hand lets go of the master.
                self.press(present, Joy(buttons=[0]))
                self.press(gripper, JointState(position=[1.0]))
                time.sleep(0.3)
                self.jaw(0.4)
                self.assertEqual(0.0, forces.messages[-1].wrench.force.z)
                heard = forces.count()
                time.sleep(0.3)
                self.assertEqual(heard, forces.count())
                forces.close()
            driver.end()

    def test_a_gamepad_says_how_fast(self):
        pad = rospy.Publisher('/joy', Joy, queue_size=10)
        self.addCleanup(pad.unregister)

        def say(seconds, up=0.0, left=0.0, close=0):
            rate = rospy.Rate(50)
            for _ in range(int(50 * seconds)):
                pad.publish(Joy(axes=[left, 0.0, 1.0, 0.0, up, 1.0, 0.0, 0.0], buttons=[0, 0, 0, 0, 0, close]))
                rate.sleep()
        with self.bridge('joy', speed=0.1):
            end = time.monotonic() + LONG
            while pad.get_num_connections() == 0:
                self.assertLess(time.monotonic(), end)
                time.sleep(0.01)
            say(1.0)
            self.left_at((0, 0, 0.08), 1e-9)
            say(1.0, up=1.0)
            say(0.2)
            risen = self.left().pose.position.z - 0.08
            self.assertTrue(0.05 < risen < 0.15, risen)
            say(0.3, close=1)
            say(0.6)
            self.jaw(0.8)
            say(0.6, close=1)
            self.jaw(0.0)
            # It is held up, and not far ahead.
            self.good('pause', data=True)
            say(2.0, up=1.0)
            self.good('pause', data=False)
            say(0.3)
            self.assertLess(abs(self.left().pose.position.z - 0.08 - risen), 0.03)
            say(0.5, left=1.0)
            # It is unplugged in the midst of that.
            time.sleep(1.0)
            stays = self.left().pose.position
            self.assertLess(stays.x, -0.02)
            time.sleep(0.5)
            self.assertAlmostEqual(stays.x, self.left().pose.position.x, 6)
        self.assertIn('autorepeat_rate', self.said)

    def test_arms_of_somebody_else_are_followed(self):
        jaws, base = self.button('/CRTK/psm1/jaw/servo_jp', JointState), self.button('/CRTK/psm1/T_b_w', PoseStamped)
        driver = self.driver('/CRTK/psm1/measured_cp', frame='psm1/baselink')
        half_turn = of_turn((math.pi, 0, 0))
        with self.bridge('src'):
            base.publish(pose_stamped(0.1, 0.0, 0.3, quaternion=half_turn, frame='world'))
            self.press(jaws, JointState(position=[0.35]))
            # Its z is along the jaws, and down; its x is the hinge, where its pose is.
            self.left_at((0.11, -0.02, 0.27 - 0.018))
            self.jaw(0.7)
            q = self.left().pose.orientation
            q = (q.x, q.y, q.z, q.w)
            for ours, its in (((1, 0, 0), (0, 0, -1)), ((0, 0, 1), (1, 0, 0))):
                for a, b in zip(turned(q, ours), its):
                    self.assertAlmostEqual(a, b, 4)
        arm, measured = self.driver('/PSM2/measured_cp', frame='base2'), self.button('/PSM2/jaw/measured_js', JointState)
        with self.bridge('arm', source='/PSM2', base='0 0 0.35 0 0 0'):
            self.press(measured, JointState(position=[0.5]))
            self.left_at((0.01, 0.02, 0.38))
            self.jaw(0.5)
        at = TransformStamped(child_frame_id='base2')
        at.header.frame_id, at.header.stamp = 'world', rospy.Time.now()
        at.transform.translation.z, at.transform.rotation.w = 0.4, 1.0
        broadcaster = tf2_ros.StaticTransformBroadcaster()
        broadcaster.sendTransform(at)
        with self.bridge('arm', source='/PSM2'):
            self.left_at((0.01, 0.02, 0.43))
        driver.end()
        arm.end()

    def test_a_new_instrument_is_there_again_after_a_reset(self):
        driver, events = self.driver('/phantom/pose'), self.deformer.recorder('events', Event)
        with self.bridge('touch', instrument='fresh', type='hook', position='0.1 0.1 0.25'):
            for _ in range(2):
                heard = events.count()
                if _:
                    self.call('reset')
                events.wait(lambda e: e.text == 'instrument fresh is in the hand', heard)
                self.states.next(lambda s: any((i.name, i.type) == ('fresh', 'hook') for i in s.instruments))
                time.sleep(0.5)
                driver.go((0, 0, 0.02))
                self.states.next(lambda s: any(i.name == 'fresh' and i.pose.position.z > 0.26 for i in s.instruments))
            # Who puts it away has put it away.
            self.good('detach_instrument', name='fresh')
            time.sleep(3.0)
            self.assertEqual(['left'], [i.name for i in self.state().instruments])
        events.close()

    def test_wrong_parameters_are_named(self):
        for parameters, said in (({'device': 'glove'}, "device is 'glove'; accepted: touch, geomagic, crtk, dvrk, joy, arm, src"),
                                 ({'device': 'touch', 'scale': 0.0}, 'scale is 0.0; accepted: 0.01 to 100'),
                                 ({'device': 'touch', 'scael': 1.0}, "there is no parameter 'scael'"),
                                 ({'device': 'touch', 'axes': 'right up away'}, 'right-handed'),
                                 ({'device': 'touch', 'clutch': 'red'}, "clutch is 'red'; accepted: grey, white"),
                                 ({'device': 'joy', 'joy_axes': '1 2 3'}, "joy_axes is '1 2 3'; accepted: numbers of six axes"),
                                 ({'device': 'touch', 'view': 'left'}, "view is 'left'; accepted: roll pitch yaw"),
                                 ({'device': 'dvrk', 'gripper_open': 0.0}, 'gripper_open is 0')):
            with self.subTest(**parameters):
                with self.bridge(**parameters) as process:
                    self.assertEqual(2, process.wait(LONG))
                self.assertIn(said, self.said)
        with self.bridge('touch', instrument='nobody', type='', source='/elsewhere') as process:
            self.driver('/phantom/pose')
            process.said("there is no instrument 'nobody' in /deformer")
            process.said('nothing has come from /elsewhere/pose; such topics: /phantom/pose.')
        with self.bridge('touch', node='/nobody') as process:
            process.said('there is no state of /nobody')

    def test_the_launch_file_starts_it(self):
        self.assertEqual(['/device_right'], list(launched('device.launch', 'device:=touch')))
        self.assertEqual(['/bench/device_left'], list(launched('device.launch', 'device:=joy', 'instrument:=left', 'station:=bench')))


if __name__ == '__main__':
    run('devices', DevicesTest)
