#!/usr/bin/python3
"""How long a hand waits: a client moves the spring in hand by 2 cm at any time between two steps, and waits for the
first message that shows it; and how evenly measured_cf comes. Needs a running node with a body, such as

    rosrun meshless_surgery deformer_node __name:=deformer _scene:=liver_looks
    bench/hand_latency.py --moves 300
"""
import argparse
import math
import random
import threading
import time

import rospy
from geometry_msgs.msg import Point, PoseStamped, Vector3, WrenchStamped
from meshless_surgery.msg import State, Surfaces
from meshless_surgery.srv import Pick
from std_srvs.srv import SetBool, Trigger
from visualization_msgs.msg import Marker, MarkerArray

STREAM = 200.0       # [Hz]
MOVE = 0.02          # [m]
FORCE_CHANGE = 0.2   # [N]


def share(values, part):
    values = sorted(values)
    return values[min(len(values) - 1, int(part * len(values)))]


class Hand:
    """Streams a place at 200 Hz and sooner where it changes."""

    def __init__(self, node, place):
        self.place = place
        self.publisher = rospy.Publisher(node + '/pick/servo_cp', PoseStamped, queue_size=10)
        self.publisher_lock = threading.Lock()
        self.done = threading.Event()
        while self.publisher.get_num_connections() == 0:
            time.sleep(0.01)
        self.thread = threading.Thread(target=self._run)
        self.thread.start()

    def say(self):
        with self.publisher_lock:
            pose = PoseStamped()
            pose.header.stamp = rospy.Time.now()
            pose.pose.position = Point(*self.place)
            pose.pose.orientation.w = 1.0
            self.publisher.publish(pose)

    def _run(self):
        while not self.done.wait(1.0 / STREAM):
            self.say()

    def close(self):
        self.done.set()
        self.thread.join()


class Watch:
    """The time of the first message that shows the move."""

    def __init__(self, topic, kind, value, shows):
        self.value, self.shows = value, shows
        self.latest, self.before, self.seen = None, None, threading.Event()
        # Only the newest: a client in Python is slower than large messages come.
        self.subscriber = rospy.Subscriber(topic, kind, self.heard, queue_size=1, buff_size=1 << 25, tcp_nodelay=True)

    def heard(self, message):
        now = time.monotonic()
        value = self.value(message)
        if value is None:
            return
        self.latest = value
        if self.before is not None and not self.seen.is_set() and self.shows(self.before, value):
            self.at = now
            self.seen.set()

    def arm(self):
        self.seen.clear()
        self.before = self.latest


def latencies(watch, hand, start, moves):
    found = []
    for i in range(moves):
        time.sleep(0.25 + random.uniform(0.0, 0.1))  # calm again, and at any time between two steps
        watch.arm()
        hand.place = (start[0], start[1], start[2] + (MOVE if i % 2 == 0 else 0.0))
        begun = time.monotonic()
        hand.say()
        if watch.seen.wait(2.0):
            found.append(1e3 * (watch.at - begun))
    watch.subscriber.unregister()
    return found


def rate(node, hand, start, seconds):
    arrivals, stamps = [], []

    def heard(message):
        arrivals.append(time.monotonic())
        stamps.append(message.header.stamp.to_sec())
    subscriber = rospy.Subscriber(node + '/pick/measured_cf', WrenchStamped, heard, queue_size=1000, tcp_nodelay=True)
    time.sleep(0.5)
    first, begun = len(arrivals), time.monotonic()
    while time.monotonic() - begun < seconds:
        hand.place = (start[0], start[1], start[2] + 0.01 * (1.0 - math.cos(6.0 * (time.monotonic() - begun))))
        time.sleep(0.002)
    subscriber.unregister()
    for name, times in (('arrival', arrivals[first:]), ('stamp', stamps[first:])):
        gaps = [b - a for a, b in zip(times, times[1:])]
        print('measured_cf by %s: %.1f Hz mean, %.1f Hz median, longest gap %.2f ms, 99 %% below %.2f ms (%d messages)' % (
            name, (len(times) - 1) / (times[-1] - times[0]), 1.0 / share(gaps, 0.5), 1e3 * max(gaps),
            1e3 * share(gaps, 0.99), len(times)))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--node', default='/deformer')
    parser.add_argument('--moves', type=int, default=300, help='of each topic')
    parser.add_argument('--seconds', type=float, default=10.0, help='of the rate')
    arguments = parser.parse_args(rospy.myargv()[1:])
    node = arguments.node
    rospy.init_node('hand_latency', anonymous=True)
    rospy.wait_for_service(node + '/pick')
    rospy.ServiceProxy(node + '/clear_picks', Trigger)()
    rospy.ServiceProxy(node + '/pause', SetBool)(False)
    centre = rospy.wait_for_message(node + '/state', State).bodies[0].centre_of_mass
    picked = rospy.ServiceProxy(node + '/pick', Pick)(point=Point(centre.x, centre.y, centre.z + 1.0),
                                                      direction=Vector3(0, 0, -1), max_distance=0.05)
    if not picked.success:
        raise SystemExit(picked.message)
    start = (picked.position.x, picked.position.y, picked.position.z)
    hand = Hand(node, start)
    try:
        time.sleep(1.0)
        rate(node, hand, start, arguments.seconds)

        def force(message):
            return message.wrench.force

        def force_changed(one, other):
            return math.dist((one.x, one.y, one.z), (other.x, other.y, other.z)) > FORCE_CHANGE

        def shown_in_surfaces(message):
            return message.picks[0].target.z if message.picks else None

        def shown_in_markers(message):
            ends = [m for m in message.markers if m.ns == 'tools' and m.id == 1 and m.action == Marker.ADD]
            return ends[0].points[0].z if ends else None

        def moved(one, other):
            return abs(one - other) > 0.25 * MOVE
        for topic, kind, value, shows in (('pick/measured_cf', WrenchStamped, force, force_changed),
                                          ('surfaces', Surfaces, shown_in_surfaces, moved),
                                          ('markers', MarkerArray, shown_in_markers, moved)):
            watch = Watch(node + '/' + topic, kind, value, shows)
            time.sleep(1.0)
            found = latencies(watch, hand, start, arguments.moves)
            if not found:
                raise SystemExit('no message of %s showed a move' % (node + '/' + topic))
            print('~pick/servo_cp to ~%s: median %.1f ms, 99 %% below %.1f ms (%d of %d moves seen)' % (
                topic, share(found, 0.5), share(found, 0.99), len(found), arguments.moves))
    finally:
        hand.close()
        rospy.ServiceProxy(node + '/clear_picks', Trigger)()


if __name__ == '__main__':
    main()
