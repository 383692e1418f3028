#!/usr/bin/env python3
"""Every request: each field that may be left out makes its difference, and one in a frame that is moved, turned and itself
moving is the same as in the world's. What there is to ask comes from the files of srv/ and action/ and from the node: a
field, a service or a stream without its law fails."""
import collections
import glob
import math
import os
import re
import sys
import tempfile
import threading
import time

import numpy as np
import rosgraph
import roslib.message
import rospy
import tf2_ros
from geometry_msgs.msg import Point, PoseStamped, Quaternion, TransformStamped, Vector3
from meshless_surgery import Refused, msg
from meshless_surgery.goals import Goals
from meshless_surgery.poses import blade_pose, quaternion_of_axes
from sensor_msgs.msg import JointState, PointCloud2, PointField
from shape_msgs.msg import SolidPrimitive
from std_msgs.msg import Header

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, HERE)
from deformer_support import LONG, OF_REVIEW, TYPES, InStepTestCase, OperatingState, StringStamped, header, pose_stamped, run  # noqa: E402

ACTIONS = ('cut', 'incise', 'spawn', 'step')
INVALID, UNKNOWN, UNSUITABLE, MISSED = 1, 2, 6, 7  # as in the srv files
ALONG_Y = (0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5))
TURNED = (0.1, 0.05, 0.03, math.sqrt(1.0 - 0.0134))


# --- what there is to ask


def asked_for(path):
    """(name, type) of each field of a request or goal."""
    with open(path, encoding='utf-8') as file:
        lines = [line.split('#')[0].split() for line in file.read().split('---')[0].splitlines()]
    return [(line[1], line[0]) for line in lines if line and '=' not in line[1]]


def requests():
    """service or actions/NAME: its fields."""
    package = os.path.join(HERE, '..', '..')
    names = {kind.__name__: name for name, kind in TYPES.items()}
    services = {os.path.basename(path)[:-4]: path for path in glob.glob(os.path.join(package, 'srv', '*.srv'))}
    found = {names[name]: asked_for(path) for name, path in services.items() if name not in OF_REVIEW}
    for path in glob.glob(os.path.join(package, 'action', '*.action')):
        found['actions/' + os.path.basename(path)[:-7].lower()] = asked_for(path)
    found['pause'] = [('data', 'bool')]  # of std_srvs
    return found


def has_header(kind):
    if kind in ('Header', 'std_msgs/Header'):
        return True
    message = roslib.message.get_message_class(kind.split('[')[0]) if '/' in kind else None
    return message is not None and any(has_header(slot) for slot in message._slot_types)


# --- frames


def turn(axis, angle):
    """A rotation matrix."""
    x, y, z = np.array(axis) / np.linalg.norm(axis)
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + math.sin(angle) * k + (1 - math.cos(angle)) * k @ k


def frame_at(rotation, translation):
    frame = np.eye(4)
    frame[:3, :3], frame[:3, 3] = rotation, translation
    return frame


def cart(moment):
    return frame_at(turn((1, 2, 3), 0.4 + 0.9 * moment), np.array((0.3, -0.2, 0.5)) + moment * np.array((0.2, 0.5, -0.3)))


TRAY = frame_at(turn((-2, 1, 1), 2.0), (-0.1, 0.4, 0.2))  # on the cart
MAP = np.linalg.inv(frame_at(turn((0, 0, 1), 0.3), (5.0e5, 5.2e6, 30.0)))  # a map's, whose origin is far away
BEGIN, END = 1000.0, 1001.0  # [s] the cart is said at both, and moves in between


def tray(stamp):
    """Where it is in the world; 0: as it was last."""
    return cart(stamp - BEGIN if stamp else END - BEGIN) @ TRAY


def quaternion(rotation):
    return Quaternion(*quaternion_of_axes(*rotation.T))


def rotation_of(q):
    x, y, z, w = np.array((q.x, q.y, q.z, q.w)) / np.linalg.norm((q.x, q.y, q.z, q.w))
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                     [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])


def xyz(v):
    return np.array((v.x, v.y, v.z))


def said_in(frame_id, stamp, value):
    """The same place, direction, pose or cloud of the world, said in another frame."""
    there = np.linalg.inv(tray(stamp)) if 'tray' in frame_id else np.eye(4)
    head = header(frame_id, rospy.Time.from_sec(stamp))
    if isinstance(value, Header):
        return head
    if isinstance(value, Point):
        return Point(*(there[:3, :3] @ xyz(value) + there[:3, 3])) if 'tray' in frame_id else value
    if isinstance(value, Vector3):
        return Vector3(*(there[:3, :3] @ xyz(value))) if 'tray' in frame_id else value
    if isinstance(value, Quaternion):
        turned = there[:3, :3] @ rotation_of(value) @ there[:3, :3].T
        return quaternion(turned) if 'tray' in frame_id else value
    if isinstance(value, PoseStamped):
        pose = PoseStamped(header=head, pose=value.pose)
        if 'tray' in frame_id:
            pose = PoseStamped(header=head)
            pose.pose.position = said_in(frame_id, stamp, value.pose.position)
            pose.pose.orientation = quaternion(there[:3, :3] @ rotation_of(value.pose.orientation))
        return pose
    if isinstance(value, list):
        return [said_in(frame_id, stamp, part) for part in value]
    if isinstance(value, PointCloud2):
        return cloud_of(np.frombuffer(value.data).reshape(-1, 3) @ there[:3, :3].T + there[:3, 3], head)
    return value


class Frames:
    """The world's frames as tf2 has them."""

    def __init__(self):
        self.moving, self.fixed = tf2_ros.TransformBroadcaster(), tf2_ros.StaticTransformBroadcaster()
        self.fixed.sendTransform([self.message('cart', 'tray', BEGIN, TRAY), self.message('world', 'map', BEGIN, MAP)])

    @staticmethod
    def message(parent, child, stamp, frame):
        said = TransformStamped(header=header(parent, rospy.Time.from_sec(stamp)), child_frame_id=child)
        said.transform.translation = Vector3(*frame[:3, 3])
        said.transform.rotation = quaternion(frame[:3, :3])
        return said

    def say(self):
        self.moving.sendTransform([self.message('world', 'cart', stamp, cart(stamp - BEGIN)) for stamp in (BEGIN, END)])


# --- shapes


def within(low, high):
    return lambda found: isinstance(found, (int, float)) and low < found <= high


def box(size=0.1):
    return SolidPrimitive(type=SolidPrimitive.BOX, dimensions=[size] * 3)


def cloud_of(points, head=None):
    fields = [PointField(name, 8 * k, PointField.FLOAT64, 1) for k, name in enumerate('xyz')]
    return PointCloud2(header=head or Header(), height=1, width=len(points), fields=fields, point_step=24,
                       row_step=24 * len(points), data=np.ascontiguousarray(points, dtype=np.float64).tobytes())


def ball(points=1000):
    """Of 0.05 m about (0.2, 0, 0.5)."""
    out = np.random.default_rng(1).normal(size=(points, 3))
    return 0.05 * out / np.linalg.norm(out, axis=1)[:, None] + (0.2, 0.0, 0.5)


def cells(points, edge):
    """How many of a grid have points; it may begin anywhere."""
    count = len(np.unique(np.floor(points / edge), axis=0))
    return within(0.95 * count, 1.05 * count)


def diagonal(points):
    return np.linalg.norm(points.max(axis=0) - points.min(axis=0))


STRAY = np.vstack((ball(), (0.2, 0.0, 0.58)))
BALL = 4.0 / 3.0 * math.pi * 0.05 ** 3


# --- what is compared


def leaves(message):
    """All that a message says, but what no two runs have in common."""
    if isinstance(message, Quaternion):  # two of them are one rotation
        return list(rotation_of(message).ravel())
    if hasattr(message, '__slots__') and not isinstance(message, (rospy.Time, str)):
        return [leaf for name in message.__slots__ for leaf in leaves(getattr(message, name))
                if name not in ('header', 'message', 'duration', 'pick_id', 'real_time_factor', 'mean_step', 'worst_step')]
    if isinstance(message, (list, tuple)):
        return [leaf for part in message for leaf in leaves(part)]
    return [message]


def as_it_should_be(wanted, found):
    if callable(wanted):
        return wanted(found)
    if isinstance(wanted, float):
        return isinstance(found, (int, float)) and abs(found - wanted) <= 1e-6 * max(1e-3, abs(wanted))
    if isinstance(wanted, tuple):
        return isinstance(found, tuple) and len(wanted) == len(found) and all(as_it_should_be(w, f) for w, f in zip(wanted, found))
    return wanted == found


Refusal = collections.namedtuple('Refusal', 'code')


# --- the law of each field: with this value, and left out, something is as it should be


# `base`: the other fields, or a function of the test that prepares something and returns them; `value`: such a function, or
# the value; `see`: of the test and the answer.
Law = collections.namedtuple('Law', 'service field value base see given left_out')
FLAT = dict(blades=pose_stamped(-0.3, 0.0, 0.1))  # through both boxes
INTO_RIGHT = dict(blade=blade_pose((0.17, 0.0, 0.15), (1, 0, 0), (0, 0, 1)), length=0.06, depth=0.03)
RAY = dict(point=Point(-0.6, 0.01, -0.1), direction=Vector3(2, 0, 1))  # into left; from the world's origin into right
BESIDE_LEFT = Point(-0.1, 0.01, 0.1)
NEW = dict(primitive=box(), pose=pose_stamped(0.0, 0.0, 1.0))


def cut_bodies(test, answer):
    return sorted(answer.cut_bodies)


def body_of(test, answer):
    return answer.body


def area(test, answer):
    return answer.opened_area


def with_middle(**fields):
    """A third box, about the world's origin."""
    def prepare(test):
        test.good('spawn', name='middle', primitive=box())
        return fields
    return prepare


def running(**fields):
    def prepare(test):
        test.pause(False)
        return fields
    return prepare


def steps_taken(test, answer):
    return test.events.wait(lambda e: e.type == 'cut' and e.step >= test.begun, test.events_before).step - test.begun


def wound(test, answer):
    """How far the lower piece of left reaches beyond the plane, and what both pieces have of its volume."""
    bodies = [test.good('get_body', name='left.%d' % n) for n in (1, 2)]
    return (min(max(p.z for p in body.surface.vertices) for body in bodies) - 0.1,
            sum(body.volume for body in bodies) / 1e-3)


def picked(**fields):
    """A pick in the left box."""
    def prepare(test):
        test.picked = test.pick_left()
        return dict(fields, pick_id=test.picked.pick_id)
    return prepare


def held(test):
    return test.picked.pick_id


def target(test, answer):
    return tuple(xyz(test.state().picks[0].target))


def from_the_grasp(test, answer):
    return float(np.linalg.norm(xyz(test.state().picks[0].target) - xyz(test.picked.position)))


def locked(test, answer):
    return [pick.locked for pick in test.state().picks]


def bodies(test, answer):
    return sorted(body.name for body in test.state().bodies)


def masses(test, answer):
    """Of left and right."""
    return tuple(body.mass for body in test.state().bodies[:2])


def heights_of_held(test, side):
    """The lowest and the highest vertex at one end, five steps later."""
    test.good('step', steps=5)
    rest, now = (test.good('get_body', name='held', rest=r).surface.vertices for r in (True, False))
    there = [v.z for r, v in zip(rest, now) if side * r.x > 0.045]
    return min(there), max(there)


def middle_x(test, answer):
    return answer.middle.x


PROBE = dict(name='probe', yaml='{type: probe}', pose=pose_stamped(0.3, 0.2, 0.5))


def instruments(test, answer):
    return [instrument.name for instrument in test.state().instruments]


def tip(test, answer):
    return tuple(xyz(test.state().instruments[0].pose.position))


DRAWN = dict(centre=Point(-0.15, 0.0, 0.1), radius=0.036, force=Vector3(10, 0, 0), time=1.0)  # by its side to the right


def patch(test, answer):
    return answer.area


def left_a_while_later(test, answer):
    test.good('step', steps=12)
    return xyz(next(body for body in test.state().bodies if body.name == 'left').centre_of_mass)


def left_x(test, answer):
    return float(left_a_while_later(test, answer)[0])


def risen(test, answer):
    return float(left_a_while_later(test, answer)[2]) - 0.1


def moved_both(test):
    for name, x in (('left', -0.6), ('right', 0.6)):
        test.good('set_pose', name=name, pose=pose_stamped(x, 0, 0.1))
    return {}


def probing(test):
    test.good('attach_instrument', **PROBE)
    return {}


def lowest_left(test, answer):
    return heights_of_held(test, -1)[0]


def highest_right(test, answer):
    return heights_of_held(test, 1)[1]


def stiffness(test, answer):
    """Of a spring that is drawn out: its force in the next step, in which the tissue follows, over its length."""
    at = answer.position
    test.good('move_pick', pick_id=answer.pick_id, target=Point(at.x - 0.01, at.y, at.z))
    test.good('step', steps=1)
    return float(np.linalg.norm(xyz(test.state().picks[0].force))) / 0.01


def sphere(test, answer):
    """Where it is after a tenth of a second."""
    test.good('step', steps=12)
    now = test.state().header.stamp
    return tuple(xyz(test.record('push/measured_cp', PoseStamped).wait(lambda m: m.header.stamp >= now).pose.position))


def touches_left(test, answer):
    before = test.state().bodies[0].centre_of_mass.x
    test.good('step', steps=5)
    return abs(test.state().bodies[0].centre_of_mass.x - before) > 1e-6  # it sags meanwhile, but not along x


def sphere_under_way(**fields):
    def prepare(test):
        test.good('push', enable=True, pose=pose_stamped(0.0, 0.0, 1.0))
        return dict(enable=True, pose=pose_stamped(0.0, 0.0, 2.0), **fields)
    return prepare


def volume(test, answer):
    return test.good('get_body', name=answer.name).volume


def filled(test, answer):
    return len(test.good('get_body', name=answer.name).cavities)


def mass(test, answer):
    return test.good('get_body', name=answer.name).mass


def centre(test, answer):
    return tuple(np.mean([xyz(p) for p in test.good('get_body', name=answer.name).surface.vertices], axis=0))


def name_of(test, answer):
    return answer.name


def triangles(test, answer):
    return answer.triangles


def points(test, answer):
    return answer.points


def strays(test, answer):
    return int(re.search(r'(\d+) were outliers', answer.message).group(1))


def drawn_out(**fields):
    def prepare(test):
        pick = test.pick_left()
        test.good('move_pick', pick_id=pick.pick_id, target=Point(0.0, 0.0, 0.1))
        test.good('step', steps=10)
        return fields
    return prepare


def lowest_x(test, answer):
    return min(p.x for p in answer.surface.vertices)


def saved_at_three(test):
    test.good('step', steps=3)
    test.good('save', file='three.state')
    test.good('step', steps=4)
    return {}


def step_now(test, answer):
    return test.state().step


def published(test):
    """A topic that has a cloud."""
    test.cloud_publisher = rospy.Publisher('/camera', PointCloud2, queue_size=1, latch=True)
    test.cloud_publisher.publish(cloud_of(ball()))
    return {}


def later(test):
    """A topic that has a cloud, a while after somebody listens; where nobody waits so long, none."""
    publisher = rospy.Publisher('/late_camera', PointCloud2, queue_size=1)

    def say():
        while publisher.get_num_connections() == 0:
            time.sleep(0.01)
        time.sleep(0.5)
        publisher.publish(cloud_of(ball()))
    threading.Thread(target=say, daemon=True).start()
    return dict(topic='/late_camera')


def joined_area(test, answer):
    return answer.area


def ends(test, answer):
    return list(test.state().attachments[0].ends)


def tension(test, answer):
    """Once the pick has drawn the fibres out."""
    test.good('step', steps=20)
    return test.state().attachments[0].force


def torn(test, answer):
    test.good('step', steps=20)
    return test.state().attachments[0].fibres < answer.fibres


def fibres_left(test, answer):
    return sum(attachment.fibres for attachment in test.state().attachments)


def joined(**fields):
    """The left box, where it is."""
    def prepare(test):
        test.good('attach', body='left', other='world', stiffness=1e6)
        return fields
    return prepare


def hollow(position=(0.0, 0.0, 1.0), **fields):
    """A bladder of 60 x 50 x 44 mm."""
    def prepare(test):
        test.good('spawn', file='package://meshless_surgery/config/meshes/bladder.obj', pose=pose_stamped(*position),
                  material='elastic_muscle')
        return fields
    return prepare


def clipped(test):
    """The bladder, clipped."""
    test.good('clip', **hollow(**CLIP)(test))
    return {}


def lumen(test, answer):
    return answer.lumen


def elastic(**fields):
    """The left box is of elastic tissue."""
    def prepare(test):
        test.good('set_material', body='left', yaml='{youngs_modulus: 20000}')
        return fields
    return prepare


TO_WORLD = dict(body='left', other='world', stiffness=1e6)
CLIP = dict(point=Point(0.0, 0.0, 1.02), direction=Vector3(0, 0, 1), width=0.01, opening=0.06)
CORNER = Point(-0.15, 0.05, 0.15)
def report_of(test, answer):
    test.good('step', steps=1)
    return os.path.basename(test.good('report').folder).rsplit('_', 1)[0]


def begun_task(test):
    test.good('start_task', task='tasks/requests.yaml')
    test.good('step', steps=1)
    return {}


def places(test, answer):
    """How many of the places are those of ~get_body, and of how many."""
    cloud = test.good('get_body', name='left').particles
    there = np.frombuffer(cloud.data, np.float32).reshape(len(cloud.data) // cloud.point_step, -1)[3, :3]
    return sum(bool(np.allclose(xyz(p), there, atol=1e-6)) for p in answer.points), len(answer.points)


LAWS = [
    Law('attach', 'name', 'mine', TO_WORLD, name_of, 'mine', 'left-world'),
    Law('attach', 'body', 'left', TO_WORLD, ends, ['left', 'world'], Refusal(INVALID)),
    Law('attach', 'other', 'world', TO_WORLD, ends, ['left', 'world'], Refusal(INVALID)),
    Law('attach', 'distance', 0.31, dict(TO_WORLD, other='right'), joined_area, 0.01, Refusal(INVALID)),
    Law('attach', 'stiffness', 1e6, drawn_out(body='left', other='world'), tension, within(0.1, 100.0), Refusal(INVALID)),
    Law('attach', 'strength', 1.0, drawn_out(**TO_WORLD), torn, True, False),
    Law('attach', 'centre', CORNER, dict(TO_WORLD, radius=0.06), joined_area, within(0.002, 0.01), Refusal(MISSED)),
    Law('attach', 'radius', 0.06, dict(TO_WORLD, centre=CORNER), joined_area, within(0.002, 0.01), 0.06),
    Law('detach', 'name', 'left-world', joined(), fibres_left, 0, Refusal(UNKNOWN)),
    Law('detach', 'centre', CORNER, joined(name='left-world', radius=0.06), fibres_left, within(10, 1000), Refusal(MISSED)),
    Law('detach', 'radius', 0.06, joined(name='left-world', centre=CORNER), fibres_left, within(10, 1000), 0),
    Law('clip', 'name', 'mine', hollow(**CLIP), name_of, 'mine', 'bladder-clip'),
    Law('clip', 'body', 'bladder', hollow(**dict(CLIP, position=(-0.2, 0.0, 0.18), point=Point(-0.2, 0.0, 0.152), opening=0.1)),
        body_of, 'bladder', Refusal(MISSED)),
    Law('clip', 'point', CLIP['point'], hollow(**CLIP), lumen, within(0.037, 0.039), Refusal(MISSED)),
    Law('clip', 'direction', Vector3(0, 1, 0), hollow(**CLIP), lumen, within(0.042, 0.045), Refusal(INVALID)),
    Law('clip', 'width', 0.01, hollow(**CLIP), lambda test, answer: answer.fibres, within(90, 130), within(50, 80)),
    Law('clip', 'opening', 0.06, hollow(**CLIP), lumen, within(0.037, 0.039), Refusal(MISSED)),
    Law('unclip', 'name', 'bladder-clip', clipped, lambda test, answer: len(test.state().attachments), 0, Refusal(UNKNOWN)),
    Law('cut', 'blades', FLAT['blades'], with_middle(), cut_bodies, ['left', 'right'], ['middle']),
    Law('cut', 'length', 0.2, FLAT, cut_bodies, ['left'], ['left', 'right']),
    Law('cut', 'width', 0.2, dict(blades=pose_stamped(-0.2, -1.0, 0.1, ALONG_Y)), cut_bodies, ['left'], ['left', 'right']),
    Law('cut', 'close_time', 0.1, running(**FLAT), steps_taken, 12, 0),
    Law('cut', 'roughness', 0.005, FLAT, wound, (within(0.0002, 0.005), 1.0), (0.0, 1.0)),
    Law('cut', 'bodies', ['right'], FLAT, cut_bodies, ['right'], ['left', 'right']),
    Law('incise', 'blade', INTO_RIGHT['blade'], with_middle(length=0.06, depth=0.03), area, 0.06 * 0.03, 0.05 * 0.03),
    Law('incise', 'length', 0.06, INTO_RIGHT, area, 0.06 * 0.03, Refusal(INVALID)),
    Law('incise', 'depth', 0.03, INTO_RIGHT, area, 0.06 * 0.03, Refusal(INVALID)),
    Law('incise', 'bodies', ['right'], dict(INTO_RIGHT, blade=blade_pose((-0.23, 0.0, 0.15), (1, 0, 0), (0, 0, 1)), length=0.46),
        cut_bodies, ['right'], ['left', 'right']),
    Law('pick', 'point', RAY['point'], RAY, body_of, 'left', 'right'),
    Law('pick', 'direction', Vector3(1, 0, 0), dict(point=BESIDE_LEFT, max_distance=0.1), body_of, 'right', 'left'),
    Law('pick', 'body', 'right', dict(point=Point(-1.0, 0.01, 0.1), direction=Vector3(1, 0, 0)), body_of, 'right', 'left'),
    Law('pick', 'max_distance', 0.15, dict(point=Point(-0.35, 0.01, 0.1)), body_of, 'left', Refusal(MISSED)),
    Law('pick', 'stiffness', 20.0, dict(point=Point(-0.24, 0.01, 0.1)), stiffness, within(10.0, 20.0), within(250.0, 500.0)),
    Law('move_pick', 'pick_id', held, picked(target=Point(0, 0.1, 0.2)), target, (0.0, 0.1, 0.2), Refusal(UNKNOWN)),
    Law('move_pick', 'target', Point(0, 0.1, 0.2), picked(), target, (0.0, 0.1, 0.2), (0.0, 0.0, 0.0)),
    Law('lock', 'pick_id', held, picked(), locked, [True], Refusal(UNKNOWN)),
    Law('lock', 'at_target', True, picked(target=Point(0, 0.1, 0.2)), from_the_grasp, within(0.1, 0.3), 0.0),
    Law('lock', 'target', Point(0, 0.1, 0.2), picked(at_target=True), target, (0.0, 0.1, 0.2), (0.0, 0.0, 0.0)),
    Law('release', 'pick_id', held, picked(), locked, [], Refusal(UNKNOWN)),
    Law('probe', 'point', RAY['point'], RAY, body_of, 'left', 'right'),
    Law('probe', 'direction', RAY['direction'], RAY, body_of, 'left', Refusal(INVALID)),
    Law('push', 'enable', True, dict(radius=0.05, pose=pose_stamped(-0.28, 0.01, 0.1)), touches_left, True, False),
    Law('push', 'radius', 0.04, dict(enable=True, pose=pose_stamped(-0.285, 0.01, 0.1)), touches_left, True, False),
    Law('push', 'pose', pose_stamped(0.0, 0.0, 1.0), dict(enable=True), sphere, (0.0, 0.0, 1.0), (0.0, 0.0, 0.0)),
    Law('push', 'speed', 2.0, sphere_under_way(), sphere, (0.0, 0.0, 1.2), (0.0, 0.0, 2.0)),
    Law('remove', 'name', 'left', {}, bodies, ['held', 'right'], Refusal(UNKNOWN)),
    Law('save', 'file', 'a.state', {}, lambda test, answer: test.call('load', file='a.state').success, True, Refusal(INVALID)),
    Law('load', 'file', 'three.state', saved_at_three, step_now, 3, Refusal(INVALID)),
    Law('move_clamp', 'name', 'held', {}, middle_x, within(-0.0251, -0.0249), Refusal(UNKNOWN)),
    Law('move_clamp', 'clamp', 1, dict(name='held'), middle_x, within(0.0249, 0.0251), within(-0.0251, -0.0249)),
    Law('move_clamp', 'shift', Vector3(0, 0, 0.02), dict(name='held'), lowest_left, within(2.9699, 2.9701), within(2.9499, 2.9501)),
    Law('move_clamp', 'turn', Quaternion(0, math.sin(0.25), 0, math.cos(0.25)), dict(name='held', clamp=1), highest_right, within(3.03, 3.034),
        within(3.0499, 3.0501)),
    Law('move_clamp', 'time', 1.0, dict(name='held', shift=Vector3(0, 0, 0.02)), lowest_left, within(2.9501, 2.951),
        within(2.9699, 2.9701)),
    Law('apply_force', 'name', 'left', DRAWN, left_x, within(-0.17, -0.13), Refusal(UNKNOWN)),
    Law('apply_force', 'centre', Point(-0.15, 0.0, 0.1), dict(DRAWN, name='left'), patch, within(0.0035, 0.0045), Refusal(MISSED)),
    Law('apply_force', 'radius', 0.036, dict(DRAWN, name='left'), patch, within(0.0035, 0.0045), within(0.0599, 0.0601)),
    Law('apply_force', 'force', Vector3(10, 0, 0), dict(DRAWN, name='left'), left_x, within(-0.17, -0.13), Refusal(MISSED)),
    Law('apply_force', 'time', 0.05, dict(DRAWN, name='left'), left_x, within(-0.18, -0.14), Refusal(INVALID)),
    Law('set_gravity', 'gravity', Vector3(0, 0, 12), {}, risen, within(0.05, 0.08), within(-1e-9, 1e-9)),
    Law('set_pose', 'name', 'left', dict(pose=pose_stamped(0, 0, 0.5)), left_x, within(-1e-6, 1e-6), Refusal(UNKNOWN)),
    Law('set_pose', 'pose', pose_stamped(0.3, 0.2, 0.5), dict(name='left'), left_x, within(0.2999, 0.3001), within(-1e-6, 1e-6)),
    Law('reset_bodies', 'bodies', ['left'], moved_both, lambda test, answer: list(answer.reset_bodies), ['left'],
        ['left', 'right', 'held']),
    Law('attach_instrument', 'name', 'probe', PROBE, instruments, ['probe'], Refusal(INVALID)),
    Law('attach_instrument', 'yaml', '{type: probe}', PROBE, instruments, ['probe'], Refusal(INVALID)),
    Law('attach_instrument', 'pose', PROBE['pose'], PROBE, tip, (0.3, 0.2, 0.5), (0.0, 0.0, 0.0)),
    Law('detach_instrument', 'name', 'probe', probing, instruments, [], Refusal(UNKNOWN)),
    Law('set_material', 'body', 'left', dict(yaml='{density: 3000}'), masses, (3.0, 1.0), (3.0, 3.0)),
    Law('set_material', 'yaml', '{density: 3000}', dict(body='left'), masses, (3.0, 1.0), Refusal(INVALID)),
    Law('get_body', 'name', 'right', {}, lowest_x, 0.15, Refusal(UNKNOWN)),
    Law('get_body', 'rest', True, drawn_out(name='left'), lowest_x, -0.25, within(-0.249, 0.0)),
    Law('get_load', 'name', 'left', elastic(), lambda test, answer: len(answer.stress) // 6, within(8, 1e4), Refusal(UNKNOWN)),
    Law('get_load', 'points', [Point(-0.2, 0.0, 0.1)] * 3, elastic(name='left'), lambda test, answer: len(answer.places), 3,
        within(8, 1e4)),
    Law('spawn', 'name', 'mine', NEW, name_of, 'mine', 'box'),
    Law('spawn', 'file', 'tetrahedron.obj', NEW, volume, 0.1 ** 3 / 6, 0.1 ** 3),
    Law('spawn', 'primitive', box(), dict(pose=NEW['pose']), volume, 0.1 ** 3, Refusal(INVALID)),
    Law('spawn', 'pose', NEW['pose'], dict(primitive=box()), centre, (0.0, 0.0, 1.0), (0.0, 0.0, 0.0)),
    Law('spawn', 'scale', 2.0, NEW, volume, 0.2 ** 3, 0.1 ** 3),
    Law('spawn', 'units', 'cm', dict(scale=200.0, **NEW), volume, 0.2 ** 3, 20.0 ** 3),
    Law('spawn', 'thickness', 0.02, NEW, volume, within(0.95 * (0.1 ** 3 - 0.06 ** 3), 1.1 * (0.1 ** 3 - 0.06 ** 3)),
        0.1 ** 3),
    Law('spawn', 'cavities', '{volume: 50}', dict(file='package://meshless_surgery/config/meshes/bladder.obj', pose=NEW['pose'],
                                                  material='elastic_muscle'), filled, 1, 0),
    Law('spawn', 'material', 'stiff', NEW, mass, 2.0, 1.0),
    Law('spawn', 'repair', 'wrap', dict(file='dirty.obj', pose=NEW['pose']), triangles, within(161, 1e5), 160),
    Law('spawn_cloud', 'name', 'mine', dict(cloud=cloud_of(ball())), name_of, 'mine', 'cloud'),
    Law('spawn_cloud', 'cloud', cloud_of(ball()), {}, volume, within(0.95 * BALL, 1.05 * BALL), Refusal(INVALID)),
    Law('spawn_cloud', 'topic', '/camera', published, volume, within(0.95 * BALL, 1.05 * BALL), Refusal(INVALID)),
    Law('spawn_cloud', 'timeout', 0.1, later, volume, Refusal(MISSED), within(0.95 * BALL, 1.05 * BALL)),
    Law('spawn_cloud', 'scale', 0.001, dict(cloud=cloud_of(1000.0 * ball())), volume, within(0.95 * BALL, 1.05 * BALL),
        Refusal(UNSUITABLE)),
    Law('spawn_cloud', 'voxel', 0.01, dict(cloud=cloud_of(ball()), outliers=100.0), points, cells(ball(), 0.01),
        cells(ball(), diagonal(ball()) / 60)),
    Law('spawn_cloud', 'outliers', 100.0, dict(cloud=cloud_of(STRAY)), strays, 0, within(0, 50)),
    Law('spawn_cloud', 'material', 'stiff', dict(cloud=cloud_of(ball())), mass, within(1.9 * BALL * 1e3, 2.1 * BALL * 1e3),
        within(0.95 * BALL * 1e3, 1.05 * BALL * 1e3)),
    Law('step', 'steps', 7, {}, lambda test, answer: (120.0 * answer.sim_time, test.state().step), (7.0, 7), Refusal(INVALID)),
    Law('start_task', 'task', 'tasks/requests.yaml', {}, lambda test, answer: 'requests' in answer.message, True, Refusal(INVALID)),
    Law('start_task', 'allow', ['undo'], dict(task='tasks/requests.yaml'),
        lambda test, answer: list(test.good('observe').task.allowed), ['undo'], []),
    Law('start_task', 'trainee', 'Ann', dict(task='tasks/requests.yaml'), report_of, 'Ann_requests', 'requests'),
    Law('report', 'name', 'mine', begun_task, lambda test, answer: os.path.basename(answer.folder).split('_')[0], 'mine', 'requests'),
    Law('observe', 'bodies', ['left', 'none'], dict(particles=[3, 3]), places, (1, 2), Refusal(INVALID)),
    Law('observe', 'particles', [3, 100000], dict(bodies=['left', 'left']), places, (1, 2), Refusal(INVALID)),
    Law('pause', 'data', True, running(), lambda test, answer: test.state().paused, True, False),
]

# A request in each place where one is said in a frame: oblique, so that rounding decides nothing.
FRAMED = {
    'attach': dict(header=Header(), body='left', other='world', stiffness=1e6, centre=Point(-0.151, 0.033, 0.143), radius=0.0617),
    'detach': dict(header=Header(), name='left-world', centre=Point(-0.151, 0.033, 0.143), radius=0.0617),
    'clip': dict(header=Header(), body='bladder', point=Point(0.001, 0.002, 1.019), direction=Vector3(0.1, 0.2, 1.0), width=0.011,
                 opening=0.061),
    'cut': dict(blades=pose_stamped(-0.3, 0.012, 0.093, TURNED), length=0.25, width=0.3),
    'incise': dict(blade=blade_pose((-0.23, 0.013, 0.151), (1, 0.1, 0.02), (0.05, 0.1, 1)), length=0.061, depth=0.032),
    'pick': dict(header=Header(), point=Point(-0.61, 0.013, -0.11), direction=Vector3(2.03, 0.02, 1.01)),
    'move_pick': dict(header=Header(), target=Point(-0.31, 0.05, 0.17)),
    'lock': dict(header=Header(), target=Point(-0.31, 0.05, 0.17), at_target=True),
    'move_clamp': dict(header=Header(), name='held', clamp=1, shift=Vector3(0.011, 0.002, -0.007), turn=Quaternion(*TURNED), time=0.02),
    'apply_force': dict(header=Header(), name='left', centre=Point(-0.151, 0.033, 0.143), radius=0.0417, force=Vector3(0.3, 0.2, -0.1), time=0.1),
    'set_gravity': dict(header=Header(), gravity=Vector3(0.3, 0.2, -9.1)),
    'set_pose': dict(name='left', pose=pose_stamped(0.31, 0.22, 0.51, TURNED)),
    'attach_instrument': dict(PROBE, pose=pose_stamped(0.01, 0.02, 0.5, TURNED)),
    'get_load': dict(header=Header(), name='left', points=[Point(-0.231, 0.013, 0.117), Point(-0.152, -0.021, 0.081)]),
    'probe': dict(header=Header(), point=Point(-0.61, 0.013, -0.11), direction=Vector3(2.03, 0.02, 1.01)),
    'push': dict(enable=True, radius=0.05, pose=pose_stamped(-0.27, 0.013, 0.11, TURNED)),
    'spawn': dict(primitive=SolidPrimitive(type=SolidPrimitive.BOX, dimensions=[0.1, 0.08, 0.06]),
                  pose=pose_stamped(0.01, 0.02, 0.3, TURNED)),
    'spawn_cloud': dict(cloud=cloud_of(ball())),
}
UNTURNED = {'set_pose': ('pose', (0.31, 0.22, 0.51)), 'attach_instrument': ('pose', (0.01, 0.02, 0.5)), 'cut': ('blades', (-0.3, 0.012, 0.093)), 'incise': ('blade', (-0.23, -0.021, 0.1)), 'push': ('pose', (-0.27, 0.013, 0.11)),
            'spawn': ('pose', (0.01, 0.02, 0.3))}
NEEDS_A_PICK = ('move_pick', 'lock')
STREAMS = {'pick/servo_cp': pose_stamped(-0.31, 0.05, 0.17, TURNED), 'push/servo_cp': pose_stamped(-0.2705, 0.013, 0.11, TURNED),
           'scissors/servo_cp': pose_stamped(-0.3, 0.012, 0.093, TURNED)}
JAWS = ('scissors/jaw/servo_js', 'scissors/jaw/servo_jp')
WORLDS = (('', 0.0), ('world', 0.0), ('/world', 0.0))
MOMENTS = (('tray', 1000.25), ('/tray', 1000.875), ('tray', 0.0))


class Asked(InStepTestCase):
    """The world stands still where nobody steps it."""

    def setUp(self):
        self.proxies = {}  # a thousand calls need not all look for the node
        super().setUp()
        self.pause(True)

    def fresh(self, name=''):
        self.call('stop_task')  # one that runs refuses what no hand does
        if self.runs_since:
            self.pause(True)
        self.good('reset')
        self.events_before = self.events.count()

    def call(self, service, **fields):
        if service not in self.proxies:
            rospy.wait_for_service(self.node + '/' + service, LONG)
            self.proxies[service] = rospy.ServiceProxy(self.node + '/' + service, TYPES[service], persistent=True)
        return self.proxies[service](**fields)

    def ask(self, name, fields):
        """The answer of a service, or the result of an action."""
        if self.runs_since and name.endswith('cut'):
            return self.ask_while_time_passes(name, fields)
        return self.ask_once(name, fields)

    def ask_once(self, name, fields):
        if not name.startswith('actions/'):
            return self.call(name, **fields)
        action = name[len('actions/'):]
        try:
            return self.goals.send(action, fields).result(LONG)
        except Refused as refused:
            return getattr(msg, action.capitalize() + 'Result')(message=refused.message, error_code=refused.code)

    def ask_while_time_passes(self, name, fields):
        self.begun = self.state().step
        shown = self.record('scissors/measured_cp', PoseStamped) if 'close_time' in fields else None
        answers = []
        asking = threading.Thread(target=lambda: answers.append(self.ask_once(name, fields)))
        asking.start()
        while asking.is_alive():
            # Time stands still until the blades begin to close.
            if shown and any(not message.header.stamp.is_zero() for message in list(shown.messages)):
                self.advance()
            asking.join(0.001)
        return answers[0]

    def snapshot(self):
        state = self.state()
        surfaces = [self.good('get_body', name=body.name).surface.vertices for body in state.bodies]
        return leaves([state.bodies, state.picks, state.instruments, surfaces])

    def assert_same(self, wanted, found, most=1e-9):
        self.assertEqual(len(wanted), len(found))
        for one, other in zip(wanted, found):
            if isinstance(one, float):
                self.assertLessEqual(abs(one - other), most)
            elif isinstance(one, int) and most:  # particles and cells of a cloud: whether a corner is filled is a matter of rounding
                self.assertLessEqual(abs(one - other), 2)
            else:
                self.assertEqual(one, other)


class RequestsTest(Asked):
    scene = 'requests'

    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.parameters = {'session_directory': cls.folder.name, 'state_rate': 400.0, 'tools_rate': 400.0, 'tools__silence': 0.0,
                          'tools__pick__max_speed': 1000.0, 'tools__scissors__length': 0.25, 'tools__scissors__width': 0.3}
        super().setUpClass()
        cls.goals = Goals(cls.node, LONG)
        frames = Frames()
        end = time.monotonic() + LONG
        # It listens to tf from its first question on.
        while not rospy.ServiceProxy(cls.node + '/probe', TYPES['probe'])(header('tray'), Point(), Vector3(0, 0, 1)).error_code == MISSED:
            frames.say()  # again and again, as it may not have heard
            assert time.monotonic() < end

    @classmethod
    def tearDownClass(cls):
        super().tearDownClass()
        cls.folder.cleanup()

    def test_each_field_and_each_service_and_stream_has_a_law(self):
        fields = {(law.service, law.field) for law in LAWS}
        wanted = set()
        for name, asked in requests().items():
            service = name.replace('actions/', '')
            self.assertEqual(service in FRAMED, any(has_header(kind) for _, kind in asked), name)
            wanted |= {(service, field) for field, kind in asked if kind not in ('Header', 'std_msgs/Header')}
            for field, kind in asked:
                self.assertFalse(has_header(kind) and field not in FRAMED[service], '%s of %s' % (field, name))
        self.assertEqual(wanted, fields)
        self.assertEqual({'actions/' + name for name in ACTIONS}, {name for name in requests() if '/' in name})
        # And what the node has, it has from there; topics of instruments go with them.
        self.fresh()
        self.until(lambda state: not any('probe/' in name for name, _ in rosgraph.Master('/requests').getSystemState()[1]), 'probe')
        _, subscribed, offered = rosgraph.Master('/requests').getSystemState()
        own = self.node + '/'

        def names(listed):
            return {name[len(own):] for name, nodes in listed if name.startswith(own) and self.node in nodes}
        self.assertEqual(set(TYPES), names(offered) - {'get_loggers', 'set_logger_level'})
        commands = {tool + '/state_command' for tool in ('pick', 'push', 'scissors')}
        goals = {'actions/%s/%s' % (name, topic) for name in ACTIONS for topic in ('goal', 'cancel')}
        self.assertEqual(set(STREAMS) | set(JAWS) | commands | goals, names(subscribed))

    def test_each_field_makes_its_difference(self):
        for law in LAWS:
            for name in self.named(law.service):
                for wanted, given in ((law.given, True), (law.left_out, False)):
                    with self.subTest(name=name, field=law.field, given=given):
                        self.fresh()
                        base = law.base(self) if callable(law.base) else law.base
                        fields = {field: value for field, value in base.items() if field != law.field}
                        if given:
                            fields[law.field] = law.value(self) if callable(law.value) else law.value
                        answer = self.ask(name, fields)
                        code = getattr(answer, 'error_code', 0)
                        found = law.see(self, answer) if answer.success else Refusal(code)
                        self.assertTrue(as_it_should_be(wanted, found), '%s: %s, not %s' % (answer.message, found, wanted))

    def outcome(self, name, frame, stamp, **other):
        """What it answers in that frame, and what the world is a while later."""
        self.fresh()
        service = name.replace('actions/', '')
        fields = {field: said_in(frame, stamp, value) for field, value in dict(FRAMED[service], **other).items()}
        if service in NEEDS_A_PICK:
            fields['pick_id'] = self.pick_left().pick_id
        if service == 'get_load':
            elastic()(self)
        if service == 'clip':
            hollow()(self)
        if service == 'detach':
            self.good('attach', body='left', other='world', stiffness=1e6)
        answer = self.ask(name, fields)
        self.assertTrue(answer.success, answer.message)
        if service == 'pick':
            self.good('move_pick', pick_id=answer.pick_id, target=Point(-0.4, 0.0, 0.1))
        self.good('step', steps=5)
        return leaves(answer), self.snapshot()

    def test_requests_are_the_same_in_each_frame(self):
        for service in FRAMED:
            answer, world = self.outcome(service, '', 0.0)
            for name in self.named(service):
                for frame, stamp in MOMENTS[:1] if '/' in name else WORLDS[1:] + MOMENTS:
                    with self.subTest(name=name, frame=frame, stamp=stamp):
                        found, found_world = self.outcome(name, frame, stamp)
                        most = 1e-9 if 'tray' in frame else 0.0
                        self.assert_same(answer, found, most)
                        self.assert_same(world, found_world, most)

    def named(self, *services):
        return [name for service in services for name in ((service, 'actions/' + service) if service in ACTIONS else (service,))]

    def refused(self, code, name, fields):
        before = self.good('hash').hash
        answer = self.ask(name, fields)
        self.assertEqual((False, code), (answer.success, answer.error_code), answer.message)
        self.assertEqual(before, self.good('hash').hash)

    def test_an_unknown_frame_and_one_that_is_not_known_at_that_time_are_refused(self):
        self.fresh()
        pick = self.pick_left().pick_id
        for name in self.named(*FRAMED):
            service = name.replace('actions/', '')
            fields = dict(pick_id=pick) if service in NEEDS_A_PICK else {}
            with self.subTest(name=name):
                self.refused(UNKNOWN, name, {**fields, **{f: said_in('nowhere', 0.0, v) for f, v in FRAMED[service].items()}})
        for stamp, said in ((BEGIN - 100.0, '101 s before the newest transform'), (END + 7.0, '7 s ahead of the newest transform')):
            answer = self.ask('probe', {f: said_in('tray', stamp, v) for f, v in FRAMED['probe'].items()})
            self.assertEqual((False, UNKNOWN), (answer.success, answer.error_code))
            self.assertIn(said, answer.message)

    def test_a_place_in_a_frame_far_away_is_brought_to_the_world_first(self):
        self.fresh()
        here = self.good('pick', point=RAY['point'], direction=RAY['direction'])
        there = np.linalg.inv(MAP)
        said = dict(header=header('map'), point=Point(*(there @ (*xyz(RAY['point']), 1.0))[:3]),
                    direction=Vector3(*(there[:3, :3] @ xyz(RAY['direction']))))
        self.assertGreater(abs(said['point'].y), 5.0e6)
        found = self.good('pick', **said)
        self.assertEqual((here.body, here.particle), (found.body, found.particle))
        target = there @ (-0.31, 0.05, 0.17, 1.0)
        self.good('move_pick', pick_id=found.pick_id, header=header('map'), target=Point(*target[:3]))
        moved, = [p for p in self.state().picks if p.pick_id == found.pick_id]
        self.assertLess(np.linalg.norm(np.subtract(xyz(moved.target), (-0.31, 0.05, 0.17))), 1e-6)
        answer = self.ask('probe', dict(header=header('map'), point=Point(1.0, 2.0, 3.0), direction=Vector3(0, 0, 1)))
        self.assertEqual((False, INVALID), (answer.success, answer.error_code))
        self.assertIn('in the world frame, point.', answer.message)

    def test_an_orientation_that_is_left_out_is_the_identity_and_one_that_is_none_is_refused(self):
        for name in self.named(*UNTURNED):
            service = name.replace('actions/', '')
            field, at = UNTURNED[service]
            wanted = self.outcome(name, '', 0.0, **{field: pose_stamped(*at)})
            found = self.outcome(name, '', 0.0, **{field: pose_stamped(*at, quaternion=(0, 0, 0, 0))})
            with self.subTest(name=name):
                self.assertEqual(wanted, found)
            for none in ((0, 0, 0, 1e-7), (0, float('nan'), 0, 1)):
                with self.subTest(name=name, none=none):
                    self.refused(INVALID, name, {**FRAMED[service], field: pose_stamped(*at, quaternion=none)})
        for topic in STREAMS:
            with self.subTest(topic=topic):
                at = STREAMS[topic].pose.position
                wanted = self.place(topic, pose_stamped(at.x, at.y, at.z))
                self.assertEqual(wanted, self.place(topic, pose_stamped(at.x, at.y, at.z, quaternion=(0, 0, 0, 0))))

    def place(self, topic, pose):
        """The tool is where its stream says: where it is said to be, and where it should be."""
        tool = topic.split('/')[0]
        states = self.record(tool + '/operating_state', OperatingState)
        for word, state in (('disable', 'DISABLED'), ('enable', 'ENABLED')):  # its stream begins anew
            self.publisher(tool + '/state_command', StringStamped).publish(StringStamped(string=word))
            states.wait(lambda m, state=state: m.state == state, states.count() - 1)
        self.fresh()
        grasp = self.pick_left().position if tool == 'pick' else None
        measured, setpoint = self.record(tool + '/measured_cp', PoseStamped), self.record(tool + '/setpoint_cp', PoseStamped)
        self.publisher(topic).publish(pose)

        def there(state):
            last = [m.messages[-1] for m in (measured, setpoint) if m.count()]
            return (len(last) == 2 and not last[0].header.stamp.is_zero() and
                    last[0].pose.position == last[1].pose.position != grasp)
        self.until(there, topic)
        return leaves([measured.messages[-1].pose, setpoint.messages[-1].pose])

    def test_streams_are_the_same_in_each_frame(self):
        for topic, pose in STREAMS.items():
            wanted = None
            for frame, stamp in WORLDS + MOMENTS:
                with self.subTest(topic=topic, frame=frame, stamp=stamp):
                    poses = self.place(topic, said_in(frame, stamp, pose))
                    if topic.startswith('scissors'):
                        self.close_the_jaw(JAWS[bool(frame)])
                    self.good('step', steps=5)
                    found = poses + self.snapshot()
                    wanted = wanted or found
                    self.assert_same(wanted, found)

    def close_the_jaw(self, topic):
        measured = self.record('scissors/jaw/measured_js', JointState)
        for angle in (0.5, 0.0):
            self.publisher(topic, JointState).publish(JointState(position=[angle]))
            measured.wait(lambda m, angle=angle: m.position[0] == angle and not m.header.stamp.is_zero(), measured.count())
        self.assertIn('left.1', [body.name for body in self.state().bodies])


class FollowTest(Asked):
    """A tool that follows a frame which is carried on the tray is where the frame is."""
    parameters = {'tools__silence': 0.0, 'tools__pick__max_speed': 1000.0,
                  'tools__scissors__max_speed': 1000.0, 'tools__push__max_speed': 1000.0,
                  **{'tools__%s__follow_frame' % tool: tool + '_frame' for tool in ('pick', 'push', 'scissors')}}
    ON_THE_TRAY = frame_at(turn((1, 0, 2), 0.8), (0.1, 0.2, -0.3))

    def test_tools_follow_frames_that_are_carried(self):
        self.pick_left()
        frames = Frames()
        tools = ('pick', 'push', 'scissors')
        frames.fixed.sendTransform([frames.message('cart', 'tray', BEGIN, TRAY)] + [
            frames.message('tray', tool + '_frame', BEGIN, self.ON_THE_TRAY) for tool in tools])
        measured = {tool: self.record(tool + '/measured_cp', PoseStamped) for tool in tools}
        for stamp in (BEGIN, BEGIN + 0.5, END):
            wanted = tray(stamp) @ self.ON_THE_TRAY

            def follows(state):
                frames.moving.sendTransform(frames.message('world', 'cart', stamp, cart(stamp - BEGIN)))
                self.good('step', steps=1)  # in which the sphere travels
                return all(m.count() and np.abs(xyz(m.messages[-1].pose.position) - wanted[:3, 3]).max() < 1e-9 for m in measured.values())
            self.until(follows, 'tools do not follow')
            self.assertLess(np.abs(rotation_of(measured['scissors'].messages[-1].pose.orientation) - wanted[:3, :3]).max(), 1e-9)


if __name__ == '__main__':
    run('requests', RequestsTest, FollowTest)
