#!/usr/bin/env python3
"""Leads an instrument by a device: a haptic device, a master of a robot, a gamepad, or an arm that somebody else moves.

roslaunch meshless_surgery device.launch device:=touch instrument:=right        its parameters are in docs/devices.md
"""
import math
import signal
import sys
import threading
import time

import rospy
import yaml
from geometry_msgs.msg import PoseStamped, WrenchStamped
from meshless_surgery import Surgeon, SurgeryError
from meshless_surgery.crtk import operating_state
from meshless_surgery.devices import DEVICES, numbers
from meshless_surgery.errors import need_master
from meshless_surgery.msg import Event, State
from meshless_surgery.poses import pose_stamped, quaternion_of_axes
from meshless_surgery.teleoperation import HandMap, NO_TURN, limited, of_rpy, of_turn, product, turned, unit
from sensor_msgs.msg import JointState

DOWN = (0.0, math.sqrt(0.5), 0.0, math.sqrt(0.5))
TIP = quaternion_of_axes((0.0, 0.0, 1.0), (0.0, -1.0, 0.0), (1.0, 0.0, 0.0))  # of an arm: z along the jaws, x along their hinge
SILENT = 0.5  # [s]
UNHEARD = 5.0  # [s] after which it is said that nothing has come
RAMP = 0.2  # [s] in which a force comes back to a hand that takes hold
AHEAD = 0.02  # [m] that sticks lead an instrument which is held up
TURNED = 0.3  # [rad] likewise
MATCHED = 0.05  # [rad] a hand that is closed as far as the jaws leads them
WIDEST = 1.6  # [rad]


class Wrong(Exception):
    """A parameter: what it is and what is accepted."""


def text(name, default):
    def read():
        return str(rospy.get_param('~' + name, default))
    return read


def number(name, default, least, most, unit=''):
    def read():
        value = rospy.get_param('~' + name, default)
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not least <= value <= most:
            raise Wrong('%s is %s; accepted: %g to %g%s' % (name, value, least, most, unit and ' ' + unit))
        return float(value)
    return read


def several(name, default, count, most, what):
    """Numbers in a row, as a list or as a text of them."""
    def read():
        value = rospy.get_param('~' + name, default)
        parts = value.replace(',', ' ').split() if isinstance(value, str) else value if isinstance(value, list) else [value]
        try:
            found = [float(part) for part in parts]
        except (TypeError, ValueError):
            found = []
        if value != '' and (len(found) != count or not all(abs(x) <= most for x in found)):
            raise Wrong("%s is '%s'; accepted: %s, each within %g" % (name, value, what, most))
        return found
    return read


SETTINGS = {
    'device': text('device', ''), 'node': text('node', 'deformer'), 'instrument': text('instrument', 'right'),
    'source': text('source', ''), 'type': text('type', 'grasper'), 'position': several('position', '', 3, 1e3, 'x y z [m]'),
    'axes': text('axes', ''), 'view': several('view', '', 3, 7.0, 'roll pitch yaw [rad]'), 'rviz_config': text('rviz_config', ''),
    'scale': number('scale', 1.0, 0.01, 100.0), 'force_scale': number('force_scale', 1.0, 0.0, 100.0),
    'max_force': number('max_force', 3.0, 0.0, 100.0, 'N'), 'rate': number('rate', 200.0, 1.0, 1000.0, 'Hz'),
    'jaw_open': number('jaw_open', 0.8, 0.0, 1.6, 'rad'), 'jaw_speed': number('jaw_speed', 3.0, 0.01, 100.0, 'rad/s'),
    'clutch': text('clutch', ''), 'close': text('close', ''), 'present': text('present', ''),
    'gripper_closed': number('gripper_closed', 0.0, -3.2, 3.2, 'rad'), 'gripper_open': number('gripper_open', 1.0, -3.2, 3.2, 'rad'),
    'speed': number('speed', 0.05, 1e-3, 5.0, 'm/s'), 'turn_speed': number('turn_speed', 1.0, 1e-3, 50.0, 'rad/s'),
    'joy_axes': several('joy_axes', '-1 2 5 8 -7 4', 6, 100, 'numbers of six axes, from 1, negative the other way round, 0 none'),
    'joy_close': number('joy_close', 6, 0, 100), 'joy_deadzone': number('joy_deadzone', 0.1, 0.0, 0.9),
    'base': several('base', '', 6, 1e3, 'x y z [m] roll pitch yaw [rad]'),
    'tip': several('tip', '', 1, 1.0, 'a number [m]'), 'jaw_scale': several('jaw_scale', '', 1, 100.0, 'a number'),
}


def settings():
    unknown = sorted(set(rospy.get_param('~', {})) - set(SETTINGS))
    if unknown:
        raise Wrong("there is no parameter '%s'; parameters: %s" % (unknown[0], ', '.join(sorted(SETTINGS))))
    known = {name: read() for name, read in SETTINGS.items()}
    if known['device'] not in DEVICES:
        raise Wrong("device is '%s'; accepted: %s" % (known['device'], ', '.join(DEVICES)))
    if known['gripper_closed'] == known['gripper_open']:
        raise Wrong('gripper_open is %g, as gripper_closed is; accepted: another angle' % known['gripper_open'])
    for name in ('joy_axes', 'joy_close'):
        known[name] = [int(x) for x in known[name]] if name == 'joy_axes' else int(known[name])
    return known


def view_of(known):
    """The turn of x right, y away, z up, as the trainee sees them, in the world."""
    if known['view']:
        return of_rpy(*known['view'])
    if not known['rviz_config']:
        return NO_TURN
    try:
        with open(known['rviz_config'], encoding='utf-8') as file:
            camera = yaml.safe_load(file)['Visualization Manager']['Views']['Current']
        return of_rpy(0.0, 0.0, float(camera['Yaw']) + 0.5 * math.pi)  # of the camera from what it looks at
    except (OSError, yaml.YAMLError, KeyError, TypeError, ValueError) as fault:
        rospy.logwarn('no view is known from %s (%s): what the device calls away is +y', known['rviz_config'], fault)
        return NO_TURN


class Bridge:
    """What the device says becomes poses and jaws of the instrument; what the instrument feels goes to the hand."""

    def __init__(self, known):
        self.known = known
        self.lock = threading.RLock()
        kind = DEVICES[known['device']]
        self.follows, self.by_rates = kind.follows, kind.by_rates
        self.map = HandMap(known['axes'] or kind.axes, view_of(known), known['scale'])
        self.tip, self.jaw_scale = (known['tip'] or [kind.tip])[0], (known['jaw_scale'] or [kind.jaw_scale])[0]
        self.base = (tuple(known['base'][:3]), of_rpy(*known['base'][3:])) if known['base'] else None
        # The device: its pose, when it was heard, what its buttons say.
        self.hand = self.heard = self.stick = None
        self.clutched, self.there = False, True
        self.wanted = None   # [rad] of the jaws, by the hand; None: nothing yet
        # The instrument: where it is (of `since` on), how far it is open, whether it holds something, what it is.
        self.measured = self.jaw_is = self.type = None
        self.since, self.measured_at, self.holds, self.recalled = rospy.Time(), 0.0, False, False
        self.enabled = True
        # What is said of it.
        self.target = self.jaw_said = None
        self.jaws_led = False
        self.held_at = 0.0   # when the hand took hold
        self.pushes = self.ended = False  # a force on the hand
        self.felt_at = 0.0
        # The deformer.
        self.paused, self.step, self.state_at = False, 0, None
        self.may_attach, self.missed = True, False
        self.said = set()
        self.begun = time.monotonic()
        node = rospy.resolve_name(known['node'])
        self.surgeon = Surgeon(node, timeout=10.0)
        topics = '%s/%s/' % (node, known['instrument'])
        self.poses = rospy.Publisher(topics + 'servo_cp', PoseStamped, queue_size=1, tcp_nodelay=True)
        self.jaws = rospy.Publisher(topics + 'jaw/servo_jp', JointState, queue_size=1, tcp_nodelay=True)
        rospy.Subscriber(topics + 'measured_cp', PoseStamped, self.on_measured, queue_size=1, tcp_nodelay=True)
        rospy.Subscriber(topics + 'operating_state', operating_state, self.on_operating, queue_size=10)
        rospy.Subscriber(node + '/events', Event, self.on_event, queue_size=100)
        rospy.Subscriber(node + '/state', State, self.on_state, queue_size=1)
        self.device = kind((known['source'] or kind.source).rstrip('/'), self, known)
        rospy.Subscriber(topics + 'body/measured_cf', WrenchStamped, self.on_force, queue_size=1, tcp_nodelay=True)
        rospy.on_shutdown(self.end)

    # of the device
    def pose(self, position, quaternion, frame='', stamp=None):
        quaternion = unit(quaternion)
        if quaternion is None or not all(math.isfinite(x) for x in position):
            self.say_once('%s: a pose is not finite, or its quaternion is 0; it is dropped' % self.device.source)
            return
        with self.lock:
            now = time.monotonic()
            if self.heard is not None and now - self.heard > SILENT:
                self.let_go()  # it may have gone anywhere
            self.heard = now
            self.hand = (position, quaternion)
            if self.follows:
                self.follow(position, quaternion, frame, stamp)
            elif not self.leads():
                self.let_go()
            else:
                self.lead()

    def has_jaws(self):
        return self.type in ('grasper', 'scissors', 'clip_applier')

    def leads(self):
        return self.there and not self.clutched and not self.paused and self.enabled and not self.ended

    def follow(self, position, quaternion, frame, stamp):
        quaternion = product(quaternion, TIP)
        position = tuple(p + t for p, t in zip(position, turned(quaternion, (self.tip, 0.0, 0.0))))
        if self.base:
            position = tuple(b + p for b, p in zip(self.base[0], turned(self.base[1], position)))
            quaternion, frame = product(self.base[1], quaternion), ''
        if not self.ended:
            self.say(position, quaternion, frame, stamp)
            if self.wanted is not None and self.has_jaws():
                self.say_jaw(self.wanted)

    def lead(self):
        if not self.map.holds:
            begin = self.target or self.measured
            if begin is None:
                return
            self.map.hold(self.hand, begin)
            self.held_at = time.monotonic()
        self.target = self.map.instrument(self.hand)

    def let_go(self):
        self.map.release()
        self.feel((0.0, 0.0, 0.0))

    def clutch(self, pressed):
        with self.lock:
            self.clutched = pressed
            if pressed:
                self.let_go()

    def present(self, pressed):
        with self.lock:
            self.there = pressed
            if not pressed:
                self.rest_jaws()

    def opening(self, share):
        """0 closed, 1 open."""
        with self.lock:
            if self.there:
                self.wanted = share * self.known['jaw_open']

    def jaw(self, angle):
        """Of an arm: said with its poses."""
        with self.lock:
            self.wanted = min(WIDEST, max(0.0, self.jaw_scale * angle))

    def rates(self, way, turn):
        with self.lock:
            self.heard = time.monotonic()
            self.stick = (way, turn)

    def rests_on(self, position, quaternion):
        """An arm says where its base is."""
        with self.lock:
            if not self.known['base'] and unit(quaternion):
                self.base = (position, unit(quaternion))

    # of the deformer
    def on_measured(self, message):
        q = message.pose.orientation
        with self.lock:
            if message.header.stamp > self.since:
                self.measured, self.measured_at = (numbers(message.pose.position), (q.x, q.y, q.z, q.w)), time.monotonic()
                if self.recalled and not self.follows and not self.ended:
                    self.say(*self.measured)  # else what was on the way at a reset leads it on
                self.recalled = False

    def on_operating(self, message):
        with self.lock:
            self.enabled = message.state == 'ENABLED'
            if not self.enabled:
                self.rest_jaws()

    def on_force(self, message):
        with self.lock:
            force = numbers(message.wrench.force)
            if self.measured is None or self.by_rates or self.follows or not all(math.isfinite(f) for f in force):
                return
            now = time.monotonic()
            if now - self.felt_at > SILENT:
                self.held_at = now
            self.felt_at = now
            self.feel(turned(self.measured[1], force))

    def on_event(self, event):
        if event.type in (Event.RESET, Event.LOADED):
            with self.lock:
                self.forget(event.header.stamp)
                self.may_attach = True

    def on_state(self, state):
        found = [i for i in state.instruments if i.name == self.known['instrument']]
        with self.lock:
            now = time.monotonic()
            again = state.step < self.step  # another run, or another node
            if again or now - self.measured_at > 2.0:
                self.forget(state.header.stamp)
            self.may_attach = self.may_attach or again
            if not found:
                self.forget(self.since)
            if state.paused:
                self.rest_jaws()
            self.step, self.state_at, self.paused = state.step, now, state.paused
            self.type, self.jaw_is, self.holds = (found[0].type, found[0].jaw, found[0].holds != '') if found else (None, None, False)
            if not found:
                self.measured = None
            self.missed = not found
            self.may_attach = self.may_attach and not found

    def forget(self, since):
        """The hand takes hold of the instrument where that is then."""
        if since != self.since:
            self.since, self.measured, self.recalled = since, None, True
        self.target = None
        self.rest_jaws()

    def rest_jaws(self):
        self.jaws_led = False
        self.let_go()

    # to the hand
    def feel(self, force):
        """A force [N] on the instrument, in the world: of one that leads; else none, said once."""
        with self.lock:
            if self.hand is None or self.by_rates or self.follows:
                return
            now = time.monotonic()
            if not self.ended and self.map.holds and now - self.heard < SILENT:
                share = self.known['force_scale'] * min(1.0, (now - self.held_at) / RAMP)
                force = limited(tuple(share * f for f in self.map.to_device(force)), self.known['max_force'])
                self.device.feel(force, self.hand[0])
                self.pushes = True
            else:
                self.rest()

    def rest(self):
        if self.pushes:
            self.device.feel((0.0, 0.0, 0.0), self.hand[0])
            self.pushes = False

    def end(self):
        with self.lock:
            if self.ended:
                return
            self.ended = True
            self.let_go()
        time.sleep(0.1)  # for what was said to arrive

    # over time
    def say_once(self, what):
        if what not in self.said:
            self.said.add(what)
            rospy.logwarn(what)

    def attach(self):
        """Where the scene has no such instrument, at the start and after a reset."""
        name, kind = self.known['instrument'], self.known['type']
        if not kind:
            self.say_once("there is no instrument '%s' in %s; accepted: one of its scene, or give this device a type" % (
                name, self.surgeon.node))
            return
        place = self.known['position'] or (-0.04 if name.startswith('left') else 0.04, 0.0, 0.2)
        try:
            self.surgeon.attach_instrument(name, kind if kind.startswith('{') else '{type: %s}' % kind, place, DOWN)
            rospy.loginfo('%s leads %s, which is new', self.device.source, name)
        except SurgeryError as error:
            self.say_once('%s cannot be attached: %s' % (name, error))

    def go(self, seconds):
        """By sticks."""
        if self.stick is None or self.measured is None or not self.leads():
            return
        position, orientation = self.target or self.measured
        to_world, (way, turn) = self.map.to_world, self.stick
        way = to_world(tuple(self.known['speed'] * seconds * x for x in way))
        # About what is right and up to the trainee, and about the shaft.
        about = self.known['turn_speed'] * seconds
        along = turned(orientation, (about * turn[1], 0.0, 0.0))
        by = tuple(a + b for a, b in zip(to_world((about * turn[0], 0.0, about * turn[2])), along))
        at = self.measured[0]
        ahead = limited(tuple(p + w - m for p, w, m in zip(position, way, at)), AHEAD)
        then = unit(product(of_turn(by), orientation))
        same = abs(sum(a * b for a, b in zip(then, self.measured[1])))  # cosine of half the angle between
        self.target = (tuple(m + a for m, a in zip(at, ahead)), then if same > math.cos(0.5 * TURNED) else orientation)

    def say(self, position, quaternion, frame='', stamp=None):
        pose = pose_stamped(position, quaternion, frame)
        pose.header.stamp = stamp or rospy.Time.now()
        self.poses.publish(pose)

    def say_jaw(self, angle):
        self.jaw_said = angle
        state = JointState(name=['jaw'], position=[angle])
        state.header.stamp = rospy.Time.now()
        self.jaws.publish(state)

    def tick(self, seconds):
        with self.lock:
            now = time.monotonic()
            silent = self.heard is not None and now - self.heard > SILENT
            if silent or now - self.felt_at > SILENT:  # the device, or the tissue
                self.rest()
            if silent:
                self.complain()
            elif self.by_rates:
                self.go(seconds)
            heard = (self.by_rates or not silent) and now - self.measured_at < SILENT
            if self.follows or self.target is None or self.ended or self.paused or not self.enabled or not heard:
                return
            self.say(*self.target)
            if self.has_jaws() and self.wanted is not None and self.there:
                self.lead_jaws(self.known['jaw_speed'] * seconds)

    def lead_jaws(self, most):
        """Once the hand was as far closed as they are led to: what they hold does not fall."""
        if not self.jaws_led:
            led_to = self.jaw_is if not self.holds else 0.0 if self.jaw_said is None else self.jaw_said
            if self.wanted > led_to + MATCHED:
                return
            self.jaws_led, self.jaw_said = True, led_to
        self.say_jaw(self.jaw_said + min(most, max(-most, self.wanted - self.jaw_said)))

    def complain(self):
        """Of a device that says nothing any more."""
        what = 'it stays where it is'
        if self.by_rates:
            if self.stick is None or not any(self.stick[0] + self.stick[1]):
                return
            self.stick = None  # it may have been unplugged in the midst of a motion
            what = 'start joy_node with autorepeat_rate, 20 for example'
        rospy.logwarn_throttle(10.0, '%s is silent; %s: %s' % (self.device.source, self.known['instrument'], what))

    def look(self):
        """Whether both are there."""
        now = time.monotonic()
        if now - self.begun > UNHEARD and self.heard is None:
            try:
                like = [name for name, kind in rospy.get_published_topics() if name.endswith(self.device.says)]
            except (OSError, rospy.ROSException):
                like = []
            self.say_once('nothing has come from %s; such topics: %s. Is the driver running? source says where it is' % (
                self.device.heard_at(), ', '.join(sorted(like)) or 'none'))
        if now - self.begun > UNHEARD and self.state_at is None:
            self.say_once('there is no state of %s; is the deformer running, and is it that of station and node?' % self.surgeon.node)
        if self.missed and self.may_attach:
            self.attach()

    def run(self, goes_on):
        period = 1.0 / self.known['rate']
        last = looked = time.monotonic()
        while goes_on():
            time.sleep(period)
            now = time.monotonic()
            self.tick(min(now - last, 0.1))
            last = now
            if now - looked > 1.0:
                looked = now
                self.look()


def main():
    if {'-h', '--help'} & set(sys.argv[1:]):
        print(__doc__)
        return 0
    try:
        need_master()
    except SurgeryError as error:
        print(error, file=sys.stderr)
        return 1
    # Not rospy's handlers, which run in the midst of what holds a lock.
    rospy.init_node('device', disable_signals=True)
    asked = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *unused: asked.set())
    try:
        bridge = Bridge(settings())
    except (Wrong, ValueError) as fault:
        rospy.logfatal('%s', fault)
        return 2
    try:
        bridge.run(lambda: not asked.is_set() and not rospy.is_shutdown())
    except rospy.ROSInterruptException:
        pass
    finally:
        bridge.end()
    rospy.signal_shutdown('asked to end')
    return 0


if __name__ == '__main__':
    sys.exit(main())
