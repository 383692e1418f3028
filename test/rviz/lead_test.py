#!/usr/bin/env python3
"""A real mouse on a virtual display leads the graspers of peg_transfer, one at a time."""
import os
import sys
import unittest

import numpy
import rospy
import rostest

sys.path.insert(0, os.path.dirname(os.path.realpath(__file__)))
from rviz_view import axes, camera_axes, configured_view, view_rectangle  # noqa: E402
from virtual_display import Mouse, VirtualDisplay, stop, wait_until  # noqa: E402

from meshless_surgery.msg import State  # noqa: E402
from sensor_msgs.msg import JointState  # noqa: E402
from std_srvs.srv import Trigger  # noqa: E402

NODE = '/deformer'
LONG = 60.0
NEAR = 0.0015  # [m] to where the mouse led it


def xyz(point):
    return numpy.array([point.x, point.y, point.z])


class LeadTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.view = configured_view('peg_transfer')
        cls.display = VirtualDisplay()

        def shown():
            cls.rectangle = view_rectangle(cls.display.screenshot())
            if cls.rectangle is None or cls.rectangle[1] - cls.rectangle[0] < 300:
                return False
            picture = cls.display.screenshot().astype(int)
            return ((picture[:, :, 0] > picture[:, :, 1] + 60) & (picture[:, :, 0] > 100)).sum() > 500
        cls.launch = cls.display.start_rviz(['roslaunch', 'meshless_surgery', 'training.launch', 'scene:=peg_transfer'], shown)
        cls.mouse = Mouse(cls.display)

    @classmethod
    def tearDownClass(cls):
        stop(cls.launch)
        cls.display.close()

    def setUp(self):
        rospy.wait_for_service(NODE + '/reset', LONG)
        self.assertTrue(rospy.ServiceProxy(NODE + '/reset', Trigger)().success)
        self.mouse.key('m')
        self.mouse.move(self.start())
        self.mouse.key('j')
        rospy.sleep(0.5)  # it hears what instruments there are
        self.mouse.key('1')

    def start(self):
        return self.rectangle[0] + 150, self.rectangle[2] + 200

    def state(self):
        asked = rospy.Time.now()
        while True:
            state = rospy.wait_for_message(NODE + '/state', State, LONG)
            if state.header.stamp >= asked:
                return state

    def hand(self, name):
        return next(i for i in self.state().instruments if i.name == name)

    def tip(self, name):
        return xyz(self.hand(name).pose.position)

    def until(self, condition, what):
        self.assertTrue(wait_until(condition, LONG, 0.1), what)

    def arrives(self, name, at):
        self.until(lambda: numpy.linalg.norm(self.tip(name) - at) < NEAR, '%s is not at %s' % (name, at))

    def way(self, tip, right, down):
        """[m] of so many pixels at the depth of the tip."""
        eye, side, up, back = camera_axes(self.view)
        scale = 2 * numpy.tan(0.5 * self.view['Field of View']) / (self.rectangle[1] - self.rectangle[0])
        return scale * -(tip - eye).dot(back) * (right * side - down * up)

    def drag(self, right, down, steps=6):
        """From the start on; the button stays down."""
        row, column = self.start()
        self.mouse.move((row, column))
        self.mouse.down()
        for k in range(1, steps + 1):
            self.mouse.move((row + down * k // steps, column + right * k // steps))

    def test_a_drag_leads_the_chosen_one_alone(self):
        for key, name, other in (('1', 'left', 'right'), ('2', 'right', 'left')):
            self.mouse.key(key)
            tip, rests = self.tip(name), self.tip(other)
            self.drag(60, -36)
            self.mouse.up()
            there = tip + self.way(tip, 60, -36)
            self.arrives(name, there)
            rospy.sleep(1.0)
            self.arrives(name, there)  # it stays
            self.assertLess(numpy.linalg.norm(self.tip(other) - rests), 2e-4)
        self.save('led')

    def test_the_wheel_moves_it_away_and_turns_it_about_its_shaft(self):
        tip, before = self.tip('left'), axes(self.hand('left').pose)
        back = camera_axes(self.view)[3]
        self.mouse.wheel(3)
        self.arrives('left', tip - 0.015 * back)
        self.mouse.key_down('shift')
        try:
            self.mouse.wheel(-3)
            self.arrives('left', tip - 0.012 * back)
            self.mouse.wheel(3)
        finally:
            self.mouse.key_up('shift')
        self.mouse.key_down('ctrl')
        try:
            self.mouse.wheel(3)
        finally:
            self.mouse.key_up('ctrl')

        def turned():
            now = axes(self.hand('left').pose)
            return (now[0].dot(before[0]) > 0.9999 and
                    abs(numpy.degrees(numpy.arctan2(now[1].dot(before[2]), now[1].dot(before[1]))) - 30.0) < 1.0)
        self.until(turned, 'it is not turned by 30 degrees about its shaft')
        self.arrives('left', tip - 0.015 * back)

    def test_with_ctrl_a_drag_tilts_it(self):
        tip, before = self.tip('left'), axes(self.hand('left').pose)
        self.mouse.key_down('ctrl')
        try:
            self.drag(60, 0)
            self.mouse.up()
        finally:
            self.mouse.key_up('ctrl')
        up = camera_axes(self.view)[2]
        angle = 60 * 0.005
        wanted = before[0] * numpy.cos(angle) + numpy.cross(up, before[0]) * numpy.sin(angle) + up * up.dot(before[0]) * (1 - numpy.cos(angle))
        self.until(lambda: axes(self.hand('left').pose)[0].dot(wanted) > 0.9998, 'it is not tilted')
        self.arrives('left', tip)

    def test_space_and_right_clicks_open_and_close_its_jaws(self):
        self.assertLess(self.hand('left').jaw, 0.1)
        self.mouse.key('space')
        self.until(lambda: self.hand('left').jaw > 0.25, 'they do not open')
        self.mouse.key('space')
        self.until(lambda: self.hand('left').jaw < 0.1, 'they do not close')
        self.drag(30, 0)
        self.mouse.click(3)
        self.until(lambda: self.hand('left').jaw > 0.25, 'they do not open by a click')
        self.mouse.up()
        self.assertLess(self.hand('right').jaw, 0.1)

    def test_jaws_stay_as_they_are_until_they_are_asked(self):
        jaws = rospy.Publisher(NODE + '/left/jaw/servo_jp', JointState, queue_size=1)
        self.until(lambda: jaws.get_num_connections() > 0, 'nobody hears')
        jaws.publish(JointState(position=[0.2]))
        self.until(lambda: abs(self.hand('left').jaw - 0.2) < 0.02, 'they do not open')
        tip = self.tip('left')
        self.drag(60, 0)
        self.mouse.up()
        self.arrives('left', tip + self.way(tip, 60, 0))
        self.assertAlmostEqual(0.2, self.hand('left').jaw, delta=0.02)

    def save(self, name):
        file = os.path.join(os.environ.get('ROS_HOME', '/tmp'), 'lead_%s.png' % name)
        self.display.save(file)
        print('picture: ' + file)

    def test_escape_leads_it_back(self):
        tip = self.tip('left')
        self.drag(60, 0)
        self.arrives('left', tip + self.way(tip, 60, 0))
        self.mouse.key('Escape')
        self.arrives('left', tip)
        self.mouse.move(self.start())  # the button is still down
        rospy.sleep(0.5)
        self.mouse.up()
        self.arrives('left', tip)

    def test_after_a_reset_it_goes_on_from_where_it_is(self):
        tip = self.tip('left')
        self.drag(60, 0)
        self.mouse.up()
        self.arrives('left', tip + self.way(tip, 60, 0))
        self.assertTrue(rospy.ServiceProxy(NODE + '/reset', Trigger)().success)
        self.arrives('left', tip)
        rospy.sleep(1.0)
        self.arrives('left', tip)
        self.drag(0, -30)
        self.mouse.up()
        self.arrives('left', tip + self.way(tip, 0, -30))


if __name__ == '__main__':
    rospy.init_node('lead_test')
    rostest.rosrun('meshless_surgery', 'lead', LeadTest, sys.argv)
