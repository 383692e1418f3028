#!/usr/bin/env python3
"""Tracked tools: a stream of 200 Hz drives each of them while the world runs, with poses that jump, come late, are
missing or are no numbers; a tool whose stream falls silent is lifted off. All by a clock that the test moves: see also
streamed_tools_test.cpp, where each bound is a tight one."""
import math
import os
import socket
import sys
import time

import rospy
import tf2_ros
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Point, PoseStamped, Quaternion, TransformStamped, Vector3
from sensor_msgs.msg import JointState

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from deformer_support import (ACROSS_X, LONG, InStepTestCase, OperatingState, StringStamped,  # noqa: E402
                              pose_stamped, run)

SPEED = 0.5      # [m/s] tools/pick/max_speed
SILENCE = 0.5    # [s]
TICK = 0.05      # [s] that a tool makes up for at most in one go


def distance(a, b):
    return math.sqrt((a.x - b.x) ** 2 + (a.y - b.y) ** 2 + (a.z - b.z) ** 2)


class StreamsTest(InStepTestCase):
    parameters = {'tools_rate': 1000.0, 'tools__pick__max_speed': SPEED, 'tools__push__max_speed': 0.5,
                  'tools__scissors__max_speed': 2.0, 'tools__scissors__length': 0.3, 'tools__scissors__width': 0.3}

    def lifts(self, tool):
        return [e for e in self.events.messages if e.type == 'lifted' and 'the ' + tool in e.text]

    def silence(self, tool):
        """The stream has ended: nothing happens for a while, and then the tool is lifted off."""
        self.pass_time(SILENCE - 2 * TICK)
        self.assertEqual([], self.lifts(tool))
        self.until(lambda state: self.lifts(tool), 'the %s was not lifted off' % tool)
        self.assertEqual(1, len(self.lifts(tool)))
        self.assertIn('silent for 0.5 s', self.lifts(tool)[0].text)
        return self.lifts(tool)[0]

    def assert_rejected(self, name, before, said):
        """In the end some of what was said, and no more: a node that stands still loses what its queue does not hold. That
        each one is refused is in streamed_tools_test.cpp."""
        end = time.monotonic() + LONG
        while self.rejected(name) == before:
            self.assertLess(time.monotonic(), end, 'nothing was rejected')
        count = self.rejected(name) - before
        print('%s: %d of %d rejected' % (name, count, said))
        self.assertLessEqual(count, said)

    def rejected(self, name):
        """How often an input was rejected, as the diagnostics say."""
        array = rospy.wait_for_message('/diagnostics', DiagnosticArray, 60)
        return sum(int(v.value) for s in array.status for v in s.values if v.key == 'rejected by ' + name)

    def test_the_pick_follows_a_circle_and_is_let_go_when_the_stream_ends(self):
        picked = self.pick_left()
        start = picked.position
        circle = [pose_stamped(start.x, start.y + 0.02 * math.sin(a), start.z + 0.02 * (1 - math.cos(a)))
                  for a in (2 * math.pi * i / 200 for i in range(250))]
        states = self.say('pick/servo_cp', circle)
        end = circle[-1].pose.position
        self.until(lambda s: distance(s.picks[0].target, end) < 1e-6, 'the pick is not where its stream is')
        # All around, and the tissue too.
        for axis, low, high in (('y', -0.018, 0.018), ('z', 0.002, 0.038)):
            targets = [getattr(p.target, axis) - getattr(start, axis) for s in states for p in s.picks]
            self.assertLess(min(targets), low)
            self.assertGreater(max(targets), high)
            held = [getattr(p.position, axis) - getattr(start, axis) for s in states for p in s.picks]
            self.assertGreater(max(held), 0.4 * high)
        event = self.silence('pick')
        self.assertEqual(picked.pick_id, event.pick_id)
        self.assertEqual([], self.state().picks)

    def test_played_slowly_it_is_the_same(self):
        start = self.pick_left().position
        for i in range(5):
            self.say('pick/servo_cp', [pose_stamped(start.x, start.y + 0.01, start.z)] * 2)
            time.sleep(1.5 * SILENCE)  # on the wall: a bag at a hundredth of its rate
        self.assertEqual(1, len(self.state().picks))
        self.assertEqual([], self.lifts('pick'))
        self.until(lambda s: abs(s.picks[0].target.y - (start.y + 0.01)) < 1e-6, 'the pick is not where its stream is')
        # Nor does it go faster than on its own clock.
        states = self.say('pick/servo_cp', [pose_stamped(start.x, start.y + 0.3, start.z)])
        time.sleep(1.0)
        self.assertLessEqual(self.state().picks[0].target.y - start.y - 0.01, SPEED * (2 * self.PERIOD + TICK))
        self.assertEqual(1, len(states[-1].picks))

    def test_a_jump_is_made_at_a_bounded_speed(self):
        start = self.pick_left().position
        states = self.say('pick/servo_cp', [pose_stamped(start.x, start.y, start.z) for _ in range(20)])
        begun = self.clock.now
        while states[-1].picks[0].target.z < start.z + 0.2999:
            states += self.say('pick/servo_cp', [pose_stamped(start.x, start.y, start.z + 0.3)])
        self.assertGreaterEqual(self.clock.now - begun, 0.3 / SPEED - TICK - self.PERIOD)
        for one, other in zip(states, states[1:]):
            passed = (other.header.stamp - one.header.stamp).to_sec()
            self.assertLessEqual(distance(one.picks[0].target, other.picks[0].target), SPEED * (passed + TICK) + 1e-9)
        self.assertGreater(len({s.picks[0].target.z for s in states}), 10)

    def bad_and_late(self, good, late, count):
        """Of each good pose one that is no number and one that is late beside it."""
        poses = []
        for _ in range(count):
            stamp = rospy.Time.from_sec(self.clock.now + len(poses) * self.PERIOD)
            poses += [pose_stamped(*good), pose_stamped(*late), pose_stamped(float('nan'), 0.0, 0.0)]
            poses[-3].header.stamp = stamp
            poses[-2].header.stamp = stamp - rospy.Duration(0.1)
        return poses

    def test_late_and_broken_messages_change_nothing(self):
        start = self.pick_left().position
        before = self.rejected('~pick/servo_cp')
        poses = self.bad_and_late((start.x, start.y + 0.01, start.z), (start.x, start.y - 1.0, start.z), 100)
        for state in self.say('pick/servo_cp', poses):
            self.assertGreaterEqual(state.picks[0].target.y, start.y - 1e-6)
        self.until(lambda s: abs(s.picks[0].target.y - (start.y + 0.01)) < 1e-6, 'the pick is not where its stream is')
        self.assert_rejected('~pick/servo_cp', before, 200)

    def test_gaps_below_the_silence_lift_nothing(self):
        start = self.pick_left().position
        for _ in range(4):
            self.say('pick/servo_cp', [pose_stamped(start.x, start.y + 0.01, start.z) for _ in range(5)])
            self.pass_time(0.3)  # sixty messages are missing; a busy machine adds to it
        self.assertEqual(1, len(self.state().picks))
        self.assertEqual([], self.lifts('pick'))

    def test_sphere_and_scissors_bear_late_broken_and_jumping_poses(self):
        for tool, speed in (('push', 0.5), ('scissors', 2.0)):
            topic = tool + '/servo_cp'
            before = self.rejected('~' + topic)
            measured = self.record(tool + '/measured_cp', PoseStamped)
            self.say(topic, [pose_stamped(0.0, 0.0, 1.0) for _ in range(20)])
            measured.wait()
            self.say(topic, self.bad_and_late((0.0, 0.0, 1.3), (0.0, 5.0, 1.0), 60))  # a jump
            self.until(lambda state: measured.messages[-1].pose.position.z > 1.2999, 'the jump was not made')
            self.assert_rejected('~' + topic, before, 120)
            places = list(measured.messages)
            self.assertEqual(0.0, max(abs(m.pose.position.y) for m in places))
            for one, other in zip(places, places[1:]):
                passed = (other.header.stamp - one.header.stamp).to_sec()
                self.assertLessEqual(other.pose.position.z - one.pose.position.z, speed * (passed + 2 * TICK) + 1e-9, tool)
            self.assertGreater(len({m.pose.position.z for m in places}), 2, tool)  # on its way too
            self.until(lambda state, tool=tool: self.lifts(tool), tool + ' was not lifted off')

    def test_a_locked_pick_and_one_that_others_move_are_not_lifted(self):
        start = self.pick_left()
        self.say('pick/servo_cp', [pose_stamped(start.position.x, start.position.y + 0.01, start.position.z)] * 20)
        self.good('lock', pick_id=start.pick_id)
        free = self.pick_left()
        self.good('move_pick', pick_id=free.pick_id, target=Point(-0.15, 0.0, 0.12))
        self.pass_time(1.5)
        self.assertEqual({start.pick_id, free.pick_id}, {p.pick_id for p in self.state().picks})
        self.assertEqual([], self.lifts('pick'))

    def assert_gone(self, tool):
        measured = self.record(tool + '/measured_cp', PoseStamped)
        self.pass_time(0.2)
        self.assertEqual([], [m for m in measured.messages if not m.header.stamp.is_zero()])

    def test_the_sphere_pushes_and_is_lifted_off(self):
        before = [b for b in self.state().bodies if b.name == 'left'][0].centre_of_mass
        self.good('push', enable=True, radius=0.03, pose=pose_stamped(-0.32, 0.0, 0.1))
        # 0.2 m/s from outside into the box.
        self.say('push/servo_cp', [pose_stamped(-0.32 + 0.2 * i / 200, 0.0, 0.1) for i in range(100)])
        self.events.wait(lambda e: e.type == 'touched')
        self.assertGreater([b for b in self.state().bodies if b.name == 'left'][0].centre_of_mass.x, before.x + 0.005)
        self.silence('push')
        self.assert_gone('push')

    def test_a_sphere_that_a_service_placed_stays(self):
        self.say('push/servo_cp', [pose_stamped(0.0, 0.0, 1.0)] * 20)
        self.good('push', enable=True, pose=pose_stamped(0.0, 0.0, 1.2))
        self.pass_time(1.5)
        measured = self.record('push/measured_cp', PoseStamped)
        self.pass_time(0.2)  # what is said before the node knows of the subscriber is lost
        self.assertEqual(1.2, measured.wait().pose.position.z)
        self.assertEqual([], self.lifts('push'))

    def test_the_scissors_come_close_cut_once_and_are_lifted_off(self):
        jaw = self.publisher('scissors/jaw/servo_js', JointState)
        count = 300
        for i in range(count):
            opening = 0.6 if i < count / 2 else 0.6 * max(0.0, 1.0 - 3.0 * (i - count / 2) / count)
            jaw.publish(JointState(name=['jaw'], position=[opening]))
            self.say('scissors/servo_cp', [pose_stamped(-0.19, -0.15 - 0.3 * max(0.0, 1.0 - 2.0 * i / count), 0.1, ACROSS_X)])
        self.events.wait(lambda e: e.type == 'cut')
        self.assertEqual({'left.1', 'left.2', 'right'}, {b.name for b in self.state().bodies})
        self.silence('scissors')
        self.assert_gone('scissors')
        self.assertEqual(1, len([e for e in self.events.messages if e.type == 'cut']))

    def test_a_stream_in_an_unknown_frame_waits_for_it_beside_the_others(self):
        # Each message is refused in the end, and none holds up what comes after it.
        start = self.pick_left().position
        before = self.rejected('~pick/servo_cp')
        poses = []
        for i in range(20):
            poses += [pose_stamped(start.x, start.y, start.z, frame='nowhere'),
                      pose_stamped(start.x, start.y + 0.0005 * i, start.z)]
        self.say('pick/servo_cp', poses)
        self.until(lambda s: abs(s.picks[0].target.y - (start.y + 0.0005 * 19)) < 1e-6, 'the pick is not where its stream is')
        self.assert_rejected('~pick/servo_cp', before, 20)

    def test_small_messages_do_not_wait_for_one_another(self):
        for topic, kind in (('pick/servo_cp', PoseStamped), ('scissors/jaw/servo_js', JointState)):
            connections = self.publisher(topic, kind).impl.connections
            self.assertEqual(1, len(connections))
            self.assertNotEqual(0, connections[0].socket.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY), topic)


class CrtkTest(InStepTestCase):
    parameters = {'tf_prefix': 'crtk', 'tools__push__max_speed': 0.5, 'tools__scissors__length': 0.3, 'tools__scissors__width': 0.3}

    def until_said(self, recorder, wanted, what):
        return self.until(lambda state: any(wanted(m) for m in list(recorder.messages)), what)

    def test_each_tool_says_its_state_and_obeys_commands(self):
        for tool in ('pick', 'push', 'scissors'):
            states = self.record(tool + '/operating_state', OperatingState)
            first = states.wait()  # latched
            self.assertEqual(('ENABLED', True, False), (first.state, first.is_homed, first.is_busy))
            commands = self.publisher(tool + '/state_command', StringStamped)
            for word, state in (('pause', 'PAUSED'), ('resume', 'ENABLED'), ('disable', 'DISABLED'), ('enable', 'ENABLED')):
                since = states.count()
                commands.publish(StringStamped(string=word))
                states.wait(lambda m, state=state: m.state == state, since)

    def test_a_paused_sphere_stays_and_one_on_its_way_is_busy(self):
        self.say('push/servo_cp', [pose_stamped(0.0, 0.0, 1.0)] * 20)
        states = self.record('push/operating_state', OperatingState)
        measured = self.record('push/measured_cp', PoseStamped)
        setpoint = self.record('push/setpoint_cp', PoseStamped)
        self.say('push/servo_cp', [pose_stamped(0.0, 0.0, 2.0)] * 20)
        self.until_said(setpoint, lambda m: m.pose.position.z == 2.0, 'no setpoint')
        self.until_said(measured, lambda m: 1.0 < m.pose.position.z < 1.5, 'the sphere does not move')
        self.until_said(states, lambda m: m.state == 'ENABLED' and m.is_busy, 'it is not busy')
        commands = self.publisher('push/state_command', StringStamped)
        commands.publish(StringStamped(string='pause'))
        states.wait(lambda m: m.state == 'PAUSED')
        self.pass_time(0.1)
        since = measured.count()
        self.pass_time(1.0)  # longer than the silence
        places = {m.pose.position.z for m in measured.messages[since:]}
        self.assertEqual(1, len(places))
        self.assertLess(places.pop(), 1.5)
        commands.publish(StringStamped(string='disable'))
        states.wait(lambda m: m.state == 'DISABLED')
        self.until_said(measured, lambda m: m.header.stamp.is_zero(), 'the sphere that is gone is not said so')
        self.assertTrue(measured.messages[-2].header.stamp > rospy.Time(0))
        self.until_said(setpoint, lambda m: m.header.stamp.is_zero(), 'its setpoint is valid')
        commands.publish(StringStamped(string='enable'))
        states.wait(lambda m: m.state == 'ENABLED', states.count() - 1)

    def test_the_jaw_is_moved_by_servo_jp_and_says_where_it_is(self):
        measured = self.record('scissors/jaw/measured_js', JointState)
        jaw = self.publisher('scissors/jaw/servo_jp', JointState)
        blades = pose_stamped(-0.19, -0.15, 0.1, ACROSS_X)
        self.say('scissors/servo_cp', [blades] * 5)
        jaw.publish(JointState(name=['jaw'], position=[0.4]))
        for _ in range(100):
            self.say('scissors/servo_cp', [pose_stamped(-0.19, -0.15, 0.1, ACROSS_X)])
            if any(m.position[0] == 0.4 for m in list(measured.messages)):
                break
        said = measured.wait(lambda m: m.position[0] == 0.4)
        self.assertEqual(['jaw'], said.name)
        self.assertFalse(said.header.stamp.is_zero())
        jaw.publish(JointState(name=['jaw'], position=[0.0]))
        self.until(lambda s: len(s.bodies) == 3, 'nothing was cut')
        self.until_said(measured, lambda m: m.header.stamp.is_zero(), 'the jaw that is gone is not said so')

    def test_what_stays_disabled_after_a_reset_is_said(self):
        states = self.record('scissors/operating_state', OperatingState)
        commands = self.publisher('scissors/state_command', StringStamped)
        word = 'the scissors stays DISABLED until its state_command is enable'
        commands.publish(StringStamped(string='disable'))
        states.wait(lambda m: m.state == 'DISABLED')
        self.assertIn(word, self.good('reset').message)
        self.runs_since = None  # steps are counted anew
        jaw = self.publisher('scissors/jaw/servo_jp', JointState)
        diagnostics = self.record('/diagnostics', DiagnosticArray)
        jaw.publish(JointState(name=['jaw'], position=[0.4]))
        self.until_said(diagnostics, lambda array: any(
            value.key == 'rejected by ~scissors/jaw/servo_jp' for status in array.status for value in status.values), 'not rejected')
        since = states.count()
        commands.publish(StringStamped(string='enable'))
        states.wait(lambda m: m.state == 'ENABLED', since)
        self.assertNotIn('stays', self.good('reset').message)

    def test_a_command_that_does_not_fit_is_rejected(self):
        states = self.record('pick/operating_state', OperatingState)
        diagnostics = self.record('/diagnostics', DiagnosticArray)
        self.publisher('pick/state_command', StringStamped).publish(StringStamped(string='resume'))
        self.until_said(diagnostics, lambda array: any(
            'the pick is ENABLED and the command is' in value.value for status in array.status for value in status.values),
            'it was not rejected')
        self.assertEqual({'ENABLED'}, {m.state for m in states.messages})


class FollowTest(InStepTestCase):
    parameters = {'tf_prefix': 'follower', 'tools__pick__follow_frame': 'hand', 'tools__push__follow_frame': 'ball',
                  'tools__scissors__follow_frame': 'blades'}

    def setUp(self):
        self.broadcaster = tf2_ros.TransformBroadcaster()
        super().setUp()

    wrong = 0.0  # [s] by which the stamps of frames are

    def frames(self, **places):
        """Says where frames are, a moment."""
        transforms = []
        for name, place in places.items():
            message = TransformStamped()
            message.header.stamp = self.clock.stamp() + rospy.Duration(self.wrong)
            message.header.frame_id = 'world'
            message.child_frame_id = name
            message.transform.translation = Vector3(*place)
            message.transform.rotation = Quaternion(0, 0, 0, 1)
            transforms.append(message)
        self.broadcaster.sendTransform(transforms)
        return self.advance()

    def follow(self, wanted, what, **places):
        end = time.monotonic() + 120
        while not wanted(self.frames(**places)):
            self.assertLess(time.monotonic(), end, what)

    def test_tools_follow_their_frames_and_are_lifted_off_where_nobody_says_them(self):
        pick = self.pick_left()
        measured = {tool: self.record(tool + '/measured_cp', PoseStamped) for tool in ('pick', 'push', 'scissors')}

        def at(tool, axis, value):
            return measured[tool].messages and abs(getattr(measured[tool].messages[-1].pose.position, axis) - value) < 1e-6
        self.follow(lambda s: at('pick', 'y', 0.05) and at('push', 'z', 1.0) and at('scissors', 'z', 3.0),
                    'tools do not follow', hand=(-0.1, 0.05, 0.1), ball=(0.0, 0.0, 1.0), blades=(0.0, 0.0, 3.0))
        self.assertEqual(pick.pick_id, self.state().picks[0].pick_id)
        self.follow(lambda s: abs(s.picks[0].target.y - 0.08) < 1e-6, 'the pick does not follow',
                    hand=(-0.1, 0.08, 0.1), ball=(0.0, 0.0, 1.0), blades=(0.0, 0.0, 3.0))
        # Frames that nobody says any more: tf2 has the last of each, and yet the tools are lifted off.
        for tool in ('pick', 'push', 'scissors'):
            self.until(lambda s: [e for e in self.events.messages if e.type == 'lifted' and tool in e.text], 'not lifted')
        self.assertEqual([], self.state().picks)
        last = self.clock.stamp()
        self.pass_time(0.2)
        for tool in ('push', 'scissors'):
            self.assertEqual([], [m for m in measured[tool].messages if m.header.stamp > last], tool)

    def test_a_frame_that_jumps_is_followed_at_a_bounded_speed(self):
        # Of the pick: 5 m/s, so a metre takes a fifth of a second; the frame is at once there.
        start = self.pick_left().position
        self.follow(lambda s: abs(s.picks[0].target.y - start.y) < 1e-6, 'the pick does not follow',
                    hand=(start.x, start.y, start.z))
        states = [self.frames(hand=(start.x, start.y, start.z))]
        begun = self.clock.now
        while states[-1].picks[0].target.y < start.y + 0.999:
            states.append(self.frames(hand=(start.x, start.y + 1.0, start.z)))
        self.assertGreaterEqual(self.clock.now - begun, 1.0 / 5.0 - TICK - self.PERIOD)
        for one, other in zip(states, states[1:]):
            passed = (other.header.stamp - one.header.stamp).to_sec()
            self.assertLessEqual(other.picks[0].target.y - one.picks[0].target.y, 5.0 * (passed + TICK) + 1e-9)
        self.assertGreater(len({s.picks[0].target.y for s in states}), 3)

    def test_no_jump_of_a_stamp_ends_what_is_followed(self):
        others = dict(ball=(0.0, 0.0, 1.0), blades=(0.0, 0.0, 3.0))
        self.pick_left()
        y = 0.0
        for jump, once in ((-0.95, False), (-20.0, False), (0.9, True), (20.0, True)):
            y += 0.01
            self.follow(lambda s, y=y: abs(s.picks[0].target.y - y) < 1e-6, 'no following', hand=(-0.1, y, 0.1), **others)
            before = self.wrong
            self.wrong += jump
            y += 0.01
            for _ in range(1 if once else 200):  # a second
                self.frames(hand=(-0.1, y, 0.1), **others)
            self.wrong = before if once else self.wrong
            y += 0.01
            self.follow(lambda s, y=y: abs(s.picks[0].target.y - y) < 1e-6, 'no following after %g s' % jump,
                        hand=(-0.1, y, 0.1), **others)
            self.assertEqual([], [e for e in self.events.messages if e.type == 'lifted'], jump)


if __name__ == '__main__':
    run('streams', StreamsTest, CrtkTest, FollowTest)
