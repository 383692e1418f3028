"""What a script needs to work on tissue: the services of a running deformer as methods, in plain Python numbers.

    from surgery_client import Surgeon
    surgeon = Surgeon()                     # waits for /deformer
    pick = surgeon.pick((0, 0, 0.1))
    surgeon.lock(pick.pick_id, (0, 0, 0.2))

A method whose service answers success=false raises Refused with the service's message. What changes something is sent once:
where the connection breaks before the answer it raises Unanswered, which says how the world is now. Metres, seconds, radians.
"""

import argparse
import contextlib
import math
import select
import sys

import rospy
from geometry_msgs.msg import Point, PoseStamped, Quaternion, Vector3
from std_srvs.srv import SetBool, Trigger

from meshless_surgery.msg import Info, State
from meshless_surgery.srv import (Cut, GetBody, Hash, Incise, LoadState, Lock, MovePick, Pick, Push, Release, SaveState,
                                  SetMaterial, Step)


class Refused(RuntimeError):
    """A service answered success=false; the text is its message."""


class Unanswered(RuntimeError):
    """A request was sent and not answered: it may have been done, or not. The text says how the world is now."""


def quaternion_of_axes(x, y, z):
    """Quaternion (xyzw) of the rotation whose columns are three orthonormal axes."""
    m = [[x[i], y[i], z[i]] for i in range(3)]
    trace = m[0][0] + m[1][1] + m[2][2]
    if trace > 0:
        s = 2.0 * math.sqrt(1.0 + trace)
        return ((m[2][1] - m[1][2]) / s, (m[0][2] - m[2][0]) / s, (m[1][0] - m[0][1]) / s, 0.25 * s)
    i = max(range(3), key=lambda k: m[k][k])
    j, k = (i + 1) % 3, (i + 2) % 3
    s = 2.0 * math.sqrt(1.0 + m[i][i] - m[j][j] - m[k][k])
    q = [0.0] * 4
    q[i] = 0.25 * s
    q[j] = (m[j][i] + m[i][j]) / s
    q[k] = (m[k][i] + m[i][k]) / s
    q[3] = (m[k][j] - m[j][k]) / s
    return tuple(q)


def _normalised(v):
    length = math.sqrt(sum(c * c for c in v))
    return tuple(c / length for c in v)


def _cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def blades_pose(pivot, reach, normal):
    """Pose of blades that pivot at a point, reach along `reach` and cut the plane of `normal`."""
    z = _normalised(normal)
    y = _normalised(_cross(z, reach))
    x = _cross(y, z)
    pose = PoseStamped()
    pose.pose.position = Point(*pivot)
    pose.pose.orientation = Quaternion(*quaternion_of_axes(x, y, z))
    return pose


class Surgeon:
    def __init__(self, node="/deformer", timeout=30.0):
        self.node = node
        self.timeout = timeout
        self._proxies = {}

    def call(self, name, service, /, **fields):
        if name in self._proxies and self._ended(self._proxies[name]):
            del self._proxies[name]
        if name not in self._proxies:
            rospy.wait_for_service(self.node + "/" + name, self.timeout)
            self._proxies[name] = rospy.ServiceProxy(self.node + "/" + name, service, persistent=True)
        try:
            reply = self._proxies[name](**fields)
        except (rospy.ServiceException, rospy.exceptions.TransportException) as error:
            del self._proxies[name]
            raise Unanswered("%s was sent once and not answered (%s); %s" % (name, error, self._now()))
        if not reply.success:
            raise Refused("%s: %s" % (name, reply.message))
        return reply

    @staticmethod
    def _ended(proxy):
        """The node has closed the connection since the last answer: nothing but its end can have come."""
        transport = proxy.transport
        return transport is not None and (transport.socket is None or bool(select.select([transport.socket], [], [], 0)[0]))

    def _now(self):
        try:
            state = self.state()
        except rospy.ROSException:
            return "the node does not answer either: does it run?"
        return "the world is at step %d, with the bodies %s and %d springs" % (
            state.step, ", ".join(body.name for body in state.bodies) or "none", len(state.picks))

    # springs
    def pick(self, point, direction=(0, 0, 0), body="", stiffness=0.0, max_distance=0.0):
        return self.call("pick", Pick, point=Point(*point), direction=Vector3(*direction), body=body,
                         stiffness=stiffness, max_distance=max_distance)

    def move(self, pick_id, target):
        return self.call("move_pick", MovePick, pick_id=pick_id, target=Point(*target))

    def lock(self, pick_id, target=None):
        return self.call("lock", Lock, pick_id=pick_id, at_target=target is not None, target=Point(*(target or (0, 0, 0))))

    def release(self, pick_id):
        return self.call("release", Release, pick_id=pick_id)

    def clear(self):
        return self.call("clear_picks", Trigger)

    # push sphere
    def push(self, position, radius=0.0, speed=0.0):
        pose = PoseStamped()
        pose.pose.position = Point(*position)
        pose.pose.orientation.w = 1.0
        return self.call("push", Push, enable=True, radius=radius, pose=pose, speed=speed)

    def lift_push(self):
        pose = PoseStamped()
        pose.pose.orientation.w = 1.0
        return self.call("push", Push, enable=False, radius=0.0, pose=pose, speed=0.0)

    # scissors
    def cut(self, pivot, reach, normal, length=0.0, width=0.0, close_time=0.0, bodies=()):
        return self.call("cut", Cut, blades=blades_pose(pivot, reach, normal), length=length, width=width,
                         close_time=close_time, roughness=0.0, bodies=list(bodies))

    # scalpel
    def incise(self, start, along, out, length, depth, bodies=()):
        """Opens the tissue: the blade's edge that stays outside runs from `start` along `along`; `out` points out of it."""
        x = _normalised(along)
        y = _normalised(_cross(_cross(x, out), x))
        blade = PoseStamped()
        blade.pose.position = Point(*start)
        blade.pose.orientation = Quaternion(*quaternion_of_axes(x, y, _cross(x, y)))
        return self.call("incise", Incise, blade=blade, length=length, depth=depth, bodies=list(bodies))

    # bodies and time
    def body(self, name, rest=False):
        return self.call("get_body", GetBody, name=name, rest=rest)

    def set_material(self, body, yaml):
        return self.call("set_material", SetMaterial, body=body, yaml=yaml)

    def state(self):
        return rospy.wait_for_message(self.node + "/state", State, self.timeout)

    def info(self):
        """What runs there: scene, step rate, bodies."""
        return rospy.wait_for_message(self.node + "/info", Info, self.timeout)

    def pause(self, paused=True):
        return self.call("pause", SetBool, data=paused)

    def step(self, steps):
        return self.call("step", Step, steps=steps)

    def reset(self):
        return self.call("reset", Trigger)

    def save(self, file):
        return self.call("save", SaveState, file=file)

    def load(self, file):
        return self.call("load", LoadState, file=file)

    def hash(self):
        return self.call("hash", Hash).hash

    @contextlib.contextmanager
    def still(self):
        """Time stands still inside: what is measured before and after an act then differs by the act alone."""
        if not self._paused:
            self.pause(True)
        try:
            yield
        finally:
            if not self._paused:
                self.pause(False)

    def live(self, seconds, rate=None):
        """Lets simulated time pass: while the world runs, by waiting for it; while it is paused, by stepping it."""
        start = self.state()
        if self._paused:
            self.step(max(1, int(round(seconds * (rate or self.info().step_rate)))))
            return
        while not rospy.is_shutdown():
            if self.state().sim_time - start.sim_time >= seconds:
                return

    _paused = False

    def stepped(self):
        """From here on time moves by live() alone: the same on a slow machine as on a fast one."""
        self.pause(True)
        self._paused = True


class Play:
    """A scene played by a script: counts what was checked, prints it with its numbers, and ends with an exit code."""

    def __init__(self, description):
        parser = argparse.ArgumentParser(description=description)
        parser.add_argument("--node", default="/deformer", help="name of the deformer node (default: %(default)s)")
        parser.add_argument("--slow", action="store_true",
                            help="let the world run in real time, to watch; else it is stepped as fast as it goes")
        self.arguments = parser.parse_args(rospy.myargv()[1:])
        rospy.init_node("play", anonymous=True)
        self.surgeon = Surgeon(self.arguments.node)
        self.failures = 0

    def start(self):
        self.surgeon.reset()
        if not self.arguments.slow:
            self.surgeon.stepped()
        else:
            self.surgeon.pause(False)
        return self.surgeon

    def say(self, text):
        print(text)
        sys.stdout.flush()

    def check(self, holds, text):
        self.say(("  ok    " if holds else "  WRONG ") + text)
        self.failures += 0 if holds else 1

    def run(self, scenario):
        """Runs scenario(surgeon, play); returns 0 where everything held."""
        try:
            scenario(self.start(), self)
        except (Refused, Unanswered, rospy.ROSException, rospy.ServiceException) as error:
            self.say("  WRONG " + str(error))
            self.failures += 1
        finally:
            if self.surgeon._paused:
                self.surgeon.pause(False)
        self.say("done: %s" % ("everything held" if self.failures == 0 else "%d went wrong" % self.failures))
        return 1 if self.failures else 0


def lowest(points):
    return min(p.z for p in points)


def distance(a, b):
    return math.sqrt((a.x - b.x) ** 2 + (a.y - b.y) ** 2 + (a.z - b.z) ** 2)
