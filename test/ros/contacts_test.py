#!/usr/bin/env python3
"""A box that falls on a table, and what ~contacts, ~markers and ~state say of it."""
import os
import sys

import rospy
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


if __name__ == '__main__':
    run('contacts', ContactsTest)
