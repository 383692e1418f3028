#!/usr/bin/env python3
"""A box that falls on a table, and what ~contacts, ~markers and ~state say of it."""
import os
import sys

import rospy
from geometry_msgs.msg import Point
from meshless_surgery.msg import State, Surfaces
from sensor_msgs.msg import PointCloud2
from visualization_msgs.msg import Marker, MarkerArray

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from deformer_support import DeformerTestCase, run  # noqa: E402

TABLE_TOP = 0.05


def of(array, ns):
    return [m for m in array.markers if m.ns == ns and m.action == Marker.ADD]


class ContactsTest(DeformerTestCase):

    def test_a_box_presses_on_the_table_and_falls_asleep(self):
        contacts = self.deformer.recorder('contacts', MarkerArray)
        self.addCleanup(contacts.close)
        self.assertEqual([], of(contacts.wait(), 'points'), 'the box is in the air')
        self.good('step', steps=60)
        # Not what was said on the way, where the box nears the table.
        asked = rospy.Time.now()
        self.good('step', steps=1)
        array = contacts.wait(lambda a: of(a, 'points') and a.markers[0].header.stamp >= asked)
        self.assertEqual(Marker.DELETEALL, array.markers[0].action)
        points = of(array, 'points')[0].points
        forces = of(array, 'forces')[0].points
        self.assertEqual(2 * len(points), len(forces))
        for point, start, end in zip(points, forces[0::2], forces[1::2]):
            self.assertAlmostEqual(TABLE_TOP, point.z, delta=0.005)
            self.assertEqual((point.x, point.y, point.z), (start.x, start.y, start.z))
            self.assertNotEqual(end.z, start.z)
        self.good('step', steps=600)
        state = self.deformer.recorder('state', type(self.state()))
        self.addCleanup(state.close)
        box = state.next(lambda s: s.bodies[0].asleep).bodies[0]
        self.assertAlmostEqual(TABLE_TOP + 0.05, box.centre_of_mass.z, delta=0.008)


class AsleepTest(DeformerTestCase):
    """While the world runs and its bodies sleep, what is drawn is said once a second: counted beside the state, which goes on."""

    def heard_during(self, states):
        """How many messages of each topic come while so many states do."""
        kinds = {'markers': MarkerArray, 'surfaces': Surfaces, 'points': PointCloud2}
        heard = {name: self.deformer.recorder(name, kind) for name, kind in kinds.items()}
        state = self.deformer.recorder('state', State)
        for recorder in heard.values():
            recorder.wait()  # it has been noticed
        before = {name: recorder.count() for name, recorder in heard.items()}
        last = state.count() + states
        state.wait(since=last)
        counts = {name: recorder.count() - before[name] for name, recorder in heard.items()}
        for recorder in (*heard.values(), state):
            recorder.close()
        return counts

    def test_what_sleeps_is_said_seldom_and_what_wakes_at_once(self):
        self.good('step', steps=700)
        self.assertTrue(all(body.asleep for body in self.state().bodies))
        self.good('pause', data=False)
        self.addCleanup(self.good, 'pause', data=True)
        rate = rospy.get_param(self.node + '/state_rate', 30.0)
        for name, count in self.heard_during(int(4 * rate)).items():
            self.assertLessEqual(count, 8, name)  # of four seconds
            self.assertGreaterEqual(count, 2, name)
        pick = self.good('pick', point=Point(0.02, 0.01, 0.15), max_distance=0.1)
        self.good('move_pick', pick_id=pick.pick_id, target=Point(-0.1, 0.0, 0.3))
        moved = self.heard_during(int(2 * rate))
        self.assertGreater(min(moved.values()), 20, moved)


if __name__ == '__main__':
    run('contacts', ContactsTest, AsleepTest)
