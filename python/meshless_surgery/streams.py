"""A tool that a stream of poses moves."""
import threading
import time

import rospy
from geometry_msgs.msg import PoseStamped, WrenchStamped
from sensor_msgs.msg import JointState

from meshless_surgery.errors import Unreachable, need_topics
from meshless_surgery.poses import pose_stamped

TOOLS = ('pick', 'push', 'scissors')


class _Heard:
    """What a topic says from the first call of next() on: one subscription for all of them."""

    def __init__(self, topic, kind):
        self._topic, self._kind = topic, kind
        self._changed = threading.Condition()
        self._count, self._message, self._subscriber = 0, None, None

    def _hear(self, message):
        with self._changed:
            self._count, self._message = self._count + 1, message
            self._changed.notify_all()

    def next(self, timeout):
        end = time.monotonic() + timeout
        with self._changed:
            before = self._count
            if self._subscriber is None:
                self._subscriber = rospy.Subscriber(self._topic, self._kind, self._hear, queue_size=1, tcp_nodelay=True)
            while self._count == before:
                if rospy.is_shutdown() or time.monotonic() > end:
                    raise Unreachable('%s says nothing' % self._subscriber.resolved_name)
                self._changed.wait(0.1)
            return self._message

    def close(self):
        if self._subscriber is not None:
            self._subscriber.unregister()
            self._subscriber = None


class ToolStream:
    """One of the tools `pick`, `push` and `scissors`, or an instrument by its name, by its topics. The node lifts a tool off
    whose stream is silent for `tools/silence` (0.5 s); an instrument stays where it is. Ends with close(), or as a context."""

    def __init__(self, node, tool, frame='', timeout=30.0, jaws=False):
        self.tool = tool
        self.frame = frame
        self.timeout = timeout
        self._topic = '%s/%s/' % (node, tool)
        need_topics(self._topic)
        self._poses = rospy.Publisher(self._topic + 'servo_cp', PoseStamped, queue_size=10, tcp_nodelay=True)
        self._jaws = None
        if tool == 'scissors':
            self._jaws = rospy.Publisher(self._topic + 'jaw/servo_js', JointState, queue_size=10, tcp_nodelay=True)
        elif jaws:
            self._jaws = rospy.Publisher(self._topic + 'jaw/servo_jp', JointState, queue_size=10, tcp_nodelay=True)
        self._measured = _Heard(self._topic + 'measured_cp', PoseStamped)
        self._force = _Heard(self._topic + ('measured_cf' if tool in TOOLS else 'body/measured_cf'), WrenchStamped)
        for publisher in (self._poses, self._jaws):
            self._connect(publisher)

    def _connect(self, publisher):
        end = time.monotonic() + self.timeout
        while publisher is not None and publisher.get_num_connections() == 0:
            if rospy.is_shutdown() or time.monotonic() > end:
                raise Unreachable('nobody listens to ' + publisher.resolved_name)
            time.sleep(0.005)

    def move(self, position, orientation=(0.0, 0.0, 0.0, 1.0), stamp=None):
        """Where the tool is to be, as of `stamp` (now)."""
        pose = pose_stamped(position, orientation, self.frame)
        pose.header.stamp = rospy.Time.now() if stamp is None else stamp
        self._poses.publish(pose)

    def jaw(self, angle):
        """Opening of the jaws [rad]. Scissors that are closed after they were open cut."""
        if self._jaws is None:
            raise ValueError('the %s has no jaw' % self.tool)
        self._jaws.publish(JointState(name=['jaw'], position=[angle]))

    def measured(self):
        """The next PoseStamped of where the tool is."""
        return self._measured.next(self.timeout)

    def force(self):
        """The next WrenchStamped on the tool."""
        return self._force.next(self.timeout)

    def close(self):
        self._measured.close()
        self._force.close()
        for publisher in (self._poses, self._jaws):
            if publisher is not None:
                publisher.unregister()

    def __enter__(self):
        return self

    def __exit__(self, *unused):
        self.close()
