"""What drivers of devices say and hear. Their messages are made here, where their packages are not: names, fields and MD5 sums
are the drivers' own.

A device tells its hand, in threads of rospy's: pose(position [m], quaternion, frame, stamp), clutch(pressed), present(pressed),
opening(0 to 1), jaw(angle [rad]), rates(right away up, about the same: -1 to 1). Its feel(force, position) brings a force [N] in
its axes to the hand."""
import math

import rospy
from genpy.dynamic import generate_dynamic
from geometry_msgs.msg import PoseStamped, TransformStamped, Vector3, WrenchStamped
from sensor_msgs.msg import JointState, Joy
from std_msgs.msg import Bool

from meshless_surgery.teleoperation import NO_TURN, of_turn, product

_VECTOR = '=' * 80 + '\nMSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n'


def _message(name, fields):
    return generate_dynamic(name, fields)[name]


OmniButtonEvent = _message('omni_msgs/OmniButtonEvent', 'int32 grey_button\nint32 white_button\n')
OmniFeedback = _message('omni_msgs/OmniFeedback', 'geometry_msgs/Vector3 force\ngeometry_msgs/Vector3 position\n' + _VECTOR)
DeviceButtonEvent = _message('geomagic_control/DeviceButtonEvent', 'int32 grey_button\nint32 white_button\n')
DeviceFeedback = _message('geomagic_control/DeviceFeedback',
                          'geometry_msgs/Vector3 force\ngeometry_msgs/Vector3 position\nbool[] lock\n' + _VECTOR)


def numbers(vector):
    return (vector.x, vector.y, vector.z)


class Device:
    """The least: nothing is heard, and nothing is felt. One that `follows` is where its arm is; of one `by_rates`, sticks say
    how fast. `says` is the topic of its poses."""
    source, axes, follows, by_rates, says, tip, jaw_scale = '', 'right away up', False, False, 'measured_cp', 0.0, 1.0

    def __init__(self, source, hand, settings):
        self.source = source
        self.hand = hand
        self.settings = settings

    def heard_at(self):
        return self.source + '/' + self.says

    def hear(self, topic, kind, callback):
        return rospy.Subscriber(self.source + '/' + topic, kind, callback, queue_size=1, tcp_nodelay=True)

    def pressed(self, topic, callback):
        """A pedal or button, by a name below the source, or of its own where it begins with a slash."""
        name = topic if topic.startswith('/') else self.source + '/' + topic
        rospy.Subscriber(name, Joy, lambda joy: callback(bool(joy.buttons and joy.buttons[0] == 1)), queue_size=10)

    def feel(self, force, pose):
        pass

    def hear_poses(self):
        """PoseStamped, or TransformStamped as arms had it before."""
        wrong = set()

        def callback(message):
            found, kind = pose_of(message), message._connection_header['type']
            if found is not None:
                self.hand.pose(*found)
            elif kind not in wrong:
                wrong.add(kind)
                rospy.logerr('%s/measured_cp is a %s; accepted: geometry_msgs/PoseStamped, TransformStamped', self.source, kind)
        self.hear('measured_cp', rospy.AnyMsg, callback)


def _turn(q):
    return (q.x, q.y, q.z, q.w)


class Touch(Device):
    """3D Systems Touch by the driver of omni_msgs. It turns the frame of its positions, so that z is up, and not that of its
    orientations."""
    source, unit, says = '/phantom', 1.0, 'pose'
    turn = of_turn((0.5 * math.pi, 0.0, 0.0))
    Button, Feedback, more = OmniButtonEvent, OmniFeedback, {}

    def __init__(self, source, hand, settings):
        super().__init__(source, hand, settings)
        self.clutch = settings['clutch'] or 'grey'
        if self.clutch not in ('grey', 'white'):
            raise ValueError("clutch is '%s'; accepted: grey, white" % self.clutch)
        self.force = rospy.Publisher(self.source + '/force_feedback', self.Feedback, queue_size=1, tcp_nodelay=True)
        self.hear('button', self.Button, self._buttons)
        self.hear('pose', PoseStamped, self._pose)

    def _pose(self, message):
        self.hand.pose(tuple(self.unit * x for x in numbers(message.pose.position)),
                       product(self.turn, _turn(message.pose.orientation)))

    def _buttons(self, event):
        grey, white = bool(event.grey_button), bool(event.white_button)
        clutch, jaw = (grey, white) if self.clutch == 'grey' else (white, grey)
        self.hand.clutch(clutch)
        self.hand.opening(0.0 if jaw else 1.0)

    def feel(self, force, pose):
        feedback = self.Feedback(**self.more)
        for field, value in ((feedback.force, force), (feedback.position, tuple(1e3 * x for x in pose))):  # [mm], as drivers lock
            field.x, field.y, field.z = value
        self.force.publish(feedback)


class Geomagic(Touch):
    """The same by the driver geomagic_control: in millimetres, and y is up."""
    source, unit, axes, turn = '/Geomagic', 1e-3, 'right up back', NO_TURN
    Button, Feedback, more = DeviceButtonEvent, DeviceFeedback, {'lock': [False] * 3}


class Crtk(Device):
    """A master by CRTK's names, such as of sawSensablePhantom, whose buttons are the defaults."""
    source, axes = '/arm', 'right up back'
    pedals = {'clutch': 'button1', 'close': 'button2', 'present': ''}

    def __init__(self, source, hand, settings):
        super().__init__(source, hand, settings)
        self.force = rospy.Publisher(self.source + '/body/servo_cf', WrenchStamped, queue_size=1, tcp_nodelay=True)
        self.absolute = rospy.Publisher(self.source + '/body/set_cf_orientation_absolute', Bool, queue_size=1, latch=True)
        self.absolute.publish(Bool(True))
        self.hear('gripper/measured_js', JointState, self._gripper)
        for name, callback in (('clutch', hand.clutch), ('close', lambda pressed: hand.opening(0.0 if pressed else 1.0)),
                               ('present', hand.present)):
            topic = settings[name] or self.pedals[name]
            if name == 'present' and topic:
                hand.present(False)
            if topic:
                self.pressed(topic, callback)
        self.hear_poses()

    def _gripper(self, state):
        if state.position:
            closed, opened = self.settings['gripper_closed'], self.settings['gripper_open']
            self.hand.opening(min(1.0, max(0.0, (state.position[0] - closed) / (opened - closed))))

    def feel(self, force, pose):
        wrench = WrenchStamped()
        wrench.header.stamp = rospy.Time.now()
        wrench.wrench.force = Vector3(*force)
        self.force.publish(wrench)


class Dvrk(Crtk):
    """A master of the da Vinci Research Kit, in the frame of its stereo display: x left, y up, z into it."""
    source, axes = '/MTMR', 'left up away'
    pedals = {'clutch': '/footpedals/clutch', 'close': '', 'present': '/footpedals/coag'}


class Arm(Device):
    """An arm that somebody else leads, by CRTK's names, such as a PSM. It is followed as it is."""
    source, follows, tip, jaw_scale = '/PSM1', True, 0.0, 1.0
    jaw_topics = ('jaw/measured_js',)

    def __init__(self, source, hand, settings):
        super().__init__(source, hand, settings)
        for topic in self.jaw_topics:
            self.hear(topic, JointState, self._jaw)
        self.hear('T_b_w', PoseStamped, lambda base: hand.rests_on(numbers(base.pose.position), _turn(base.pose.orientation)))
        self.hear_poses()

    def _jaw(self, state):
        if state.position:
            self.hand.jaw(state.position[0])


class Challenge(Arm):
    """A PSM of the surgical robotics challenge: its pose is that of its hinge, T_b_w says where its base is, and of its jaws
    only the command is there, an angle for each of the two."""
    source, jaw_topics, tip, jaw_scale = '/CRTK/psm1', ('jaw/servo_jp',), 0.018, 2.0


class Gamepad(Device):
    """sensor_msgs/Joy: sticks say how fast the instrument goes."""
    source, by_rates, says = '/joy', True, 'joy'

    def heard_at(self):
        return self.source

    def __init__(self, source, hand, settings):
        super().__init__(source, hand, settings)
        self.numbers = settings['joy_axes']
        self.closes = settings['joy_close']
        rospy.Subscriber(self.source, Joy, self._joy, queue_size=1, tcp_nodelay=True)

    def _joy(self, joy):
        def axis(number):
            if number == 0 or abs(number) > len(joy.axes):
                return 0.0
            value = joy.axes[abs(number) - 1] * (1.0 if number > 0 else -1.0)
            still = self.settings['joy_deadzone']
            return 0.0 if abs(value) <= still else (value - still if value > 0.0 else value + still) / (1.0 - still)
        sticks = [axis(number) for number in self.numbers]
        self.hand.rates(tuple(sticks[:3]), tuple(sticks[3:]))
        if 0 < self.closes <= len(joy.buttons):
            self.hand.opening(0.0 if joy.buttons[self.closes - 1] else 1.0)


def pose_of(message):
    """Of a message of any kind: position, quaternion, frame, stamp; None where it is no pose."""
    kind = message._connection_header['type']
    if kind == PoseStamped._type:
        pose = PoseStamped().deserialize(message._buff)
        return numbers(pose.pose.position), _turn(pose.pose.orientation), pose.header.frame_id, pose.header.stamp
    if kind == TransformStamped._type:
        pose = TransformStamped().deserialize(message._buff)
        return numbers(pose.transform.translation), _turn(pose.transform.rotation), pose.header.frame_id, pose.header.stamp
    return None


DEVICES = {'touch': Touch, 'geomagic': Geomagic, 'crtk': Crtk, 'dvrk': Dvrk, 'joy': Gamepad, 'arm': Arm, 'src': Challenge}
