#!/usr/bin/env python3
"""A real mouse on a virtual display puts clips on a vessel, takes them off and cuts it: where it points, and where the preview was."""
import os
import sys
import unittest

import numpy
import rospy
import rostest

sys.path.insert(0, os.path.dirname(os.path.realpath(__file__)))
from rviz_view import axes, configured_view, project, ray_through, view_rectangle  # noqa: E402
from virtual_display import Mouse, VirtualDisplay, stop, wait_until  # noqa: E402

from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion, Vector3  # noqa: E402
from meshless_surgery.msg import State, TaskState  # noqa: E402
from meshless_surgery.srv import GetBody, Probe, Spawn, StartTask  # noqa: E402
from shape_msgs.msg import SolidPrimitive  # noqa: E402
from std_srvs.srv import SetBool, Trigger  # noqa: E402

NODE = '/deformer'
LONG = 60.0
LINE = (51, 230, 255)  # of the preview
REACH = 0.004  # [m] from the middle of a clip to where the mouse pointed: the radius of the vessel, and what it moved


def call(service, kind, **fields):
    rospy.wait_for_service(NODE + '/' + service, LONG)
    return rospy.ServiceProxy(NODE + '/' + service, kind)(**fields)


def xyz(point):
    return numpy.array([point.x, point.y, point.z])


class ClipTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.view = configured_view('vessel')
        cls.display = VirtualDisplay()

        def shown():
            cls.rectangle = view_rectangle(cls.display.screenshot())
            if cls.rectangle is None or cls.rectangle[1] - cls.rectangle[0] < 300:
                return False
            picture = cls.display.screenshot().astype(int)
            return ((picture[:, :, 0] > picture[:, :, 1] + 60) & (picture[:, :, 0] > 100)).sum() > 2000
        cls.launch = cls.display.start_rviz(['roslaunch', 'meshless_surgery', 'training.launch', 'scene:=vessel'], shown)
        cls.mouse = Mouse(cls.display)

    @classmethod
    def tearDownClass(cls):
        stop(cls.launch)
        cls.display.close()

    def setUp(self):
        call('stop_task', Trigger)  # one that runs refuses a pause
        self.assertTrue(call('pause', SetBool, data=False).success)
        self.assertTrue(call('reset', Trigger).success)
        rospy.sleep(1.0)  # it hangs
        self.assertTrue(call('pause', SetBool, data=True).success)
        self.mouse.key('m')
        self.mouse.move(self.air())
        self.mouse.key('l')

    def air(self):
        return self.rectangle[0] + 30, self.rectangle[2] + 30

    def state(self):
        asked = rospy.Time.now()
        while True:
            state = rospy.wait_for_message(NODE + '/state', State, LONG)
            if state.header.stamp >= asked:
                return state

    def clips(self):
        return [a for a in self.state().attachments if a.jaws > 0.0]

    def until(self, condition, what):
        self.assertTrue(wait_until(condition, LONG, 0.1), what)

    def pixel(self, place):
        return project(numpy.array([place]), self.view, self.rectangle)[0]

    def vertices(self, name):
        return numpy.array([xyz(v) for v in call('get_body', GetBody, name=name).surface.vertices])

    def middle(self, x):
        """Of the vessel's section at x, as it hangs."""
        vertices = self.vertices('vessel')
        return vertices[numpy.abs(vertices[:, 0] - x) < 0.001].mean(axis=0)

    def preview(self):
        top, bottom, left, right = self.rectangle
        near = numpy.abs(self.display.screenshot()[top:bottom, left:right].astype(int) - LINE).max(axis=2) < 12
        return numpy.argwhere(near) + (top, left)

    def point_at(self, place):
        row, column = self.pixel(place)
        self.mouse.move((row + 2, column + 2))
        self.mouse.move((row, column))
        self.until(lambda: len(self.preview()) > 30, 'no jaws in the picture')
        return row, column

    def save(self, name):
        file = os.path.join(os.environ.get('ROS_HOME', '/tmp'), 'clip_%s.png' % name)
        self.display.save(file)
        print('picture: ' + file)

    def test_a_click_puts_a_clip_where_the_jaws_were_shown(self):
        self.assertEqual(0, len(self.preview()))
        place = self.middle(-0.007)
        row, column = self.point_at(place)
        rospy.sleep(0.5)
        jaws = self.preview()
        self.save('jaws')
        # Around the cursor, on either side of the vessel.
        self.assertLess(numpy.abs(0.5 * (jaws.min(axis=0) + jaws.max(axis=0)) - (row, column)).max(), 12)
        self.assertTrue(jaws[:, 0].min() < row - 5 and jaws[:, 0].max() > row + 5, jaws)
        self.assertEqual([], self.clips(), 'what is shown does nothing')
        self.mouse.click()
        self.until(lambda: len(self.clips()) == 1, 'no clip')
        clip, = self.clips()
        self.assertEqual(['vessel'], clip.ends)
        self.assertLess(numpy.linalg.norm(xyz(clip.middle) - place), REACH)
        # It closes, and a second one goes beside it.
        call('pause', SetBool, data=False)
        rospy.sleep(0.5)
        call('pause', SetBool, data=True)
        self.assertLess(self.clips()[0].jaws, 0.5 * clip.jaws)
        other = self.middle(0.007)
        self.point_at(other)
        self.mouse.click()
        self.until(lambda: len(self.clips()) == 2, 'no second clip')
        self.assertLess(numpy.linalg.norm(xyz(self.clips()[1].middle) - other), REACH)
        self.mouse.move(self.air())
        self.until(lambda: len(self.preview()) == 0, 'the jaws stay in the air')
        self.save('two')

    def test_shift_and_click_takes_the_clip_off_that_is_there(self):
        for x in (-0.007, 0.007):
            before = len(self.clips())
            self.point_at(self.middle(x))
            self.mouse.click()
            self.until(lambda: len(self.clips()) == before + 1, 'no clip')
        first, second = self.clips()
        self.mouse.key_down('shift')
        try:
            self.mouse.move(self.pixel(0.5 * (xyz(first.middle) + xyz(second.middle))))  # where none is
            self.mouse.click()
            rospy.sleep(1.0)
            self.assertEqual(2, len(self.clips()))
            self.mouse.move(self.pixel(xyz(second.middle)))
            self.mouse.click()
            self.until(lambda: len(self.clips()) == 1, 'the clip stays')
        finally:
            self.mouse.key_up('shift')
        self.assertEqual([first.name], [clip.name for clip in self.clips()])

    # --- scissors

    def open_blades(self, x):
        """Over the vessel at x, with their line on it; the pixel of the cursor, and the tissue under it."""
        self.mouse.key('x')
        row, column = self.point_at(self.middle(x))
        rospy.sleep(0.5)
        origin, direction = ray_through((row, column), self.view, self.rectangle)
        met = call('probe', Probe, point=Point(*origin), direction=Vector3(*direction))
        self.assertEqual('vessel', met.body)
        return (row, column), xyz(met.position)

    def bodies(self):
        return sorted(body.name for body in self.state().bodies)

    def test_scissors_cut_what_is_under_the_cursor(self):
        for x in (-0.008, 0.0, 0.008):
            cursor, tissue = self.open_blades(x)
            line = self.preview()
            self.save('scissors_%+d' % (1e3 * x))
            self.assertLess(numpy.linalg.norm(line - cursor, axis=1).min(), 6, 'the line is beside the cursor')
            pose = rospy.wait_for_message(NODE + '/scissors/measured_cp', PoseStamped, LONG).pose
            normal = axes(pose)[2]
            self.assertLess(abs((tissue - xyz(pose.position)).dot(normal)), 5e-4)
            self.mouse.down()
            self.until(lambda: len(self.bodies()) == 2, 'not cut')
            self.mouse.up()
            sides = [(self.vertices(name) - tissue).dot(normal) for name in self.bodies()]
            lower, upper = sorted(sides, key=lambda heights: heights.mean())
            self.assertTrue(lower.max() < 1e-3 and upper.min() > -1e-3, (lower.max(), upper.min()))
            self.assertTrue(call('undo_cut', Trigger).success)

    def test_scissors_that_meet_nothing_say_so(self):
        self.open_blades(0.0)
        row, column = self.pixel(numpy.array([0.0, 0.0, 0.075]))  # above the vessel
        self.mouse.move((row, column))
        self.until(lambda: len(self.preview()) == 0, 'a line in the air')
        help_text = self.quiet_status()
        self.mouse.down()
        rospy.sleep(1.5)
        self.mouse.up()
        self.until_said(help_text)
        self.save('missed')
        self.assertEqual(['vessel'], self.bodies())

    def test_the_task_is_passed_by_what_its_brief_says(self):
        self.assertTrue(call('start_task', StartTask, task='transect', trainee='mouse').success)
        self.assertTrue(call('pause', SetBool, data=False).success)
        rospy.sleep(1.0)  # it hangs
        for x in (-0.009, 0.009):
            self.mouse.key('m')
            self.mouse.move(self.air())
            self.mouse.key('l')
            before = len(self.clips())
            self.point_at(self.middle(x))
            self.mouse.click()
            self.until(lambda: len(self.clips()) == before + 1, 'no clip')
        rospy.sleep(1.0)
        self.open_blades(0.0)
        self.save('transect')
        self.mouse.down()
        self.until(lambda: len(self.bodies()) == 2, 'not cut')
        self.mouse.up()
        task = [rospy.wait_for_message(NODE + '/task', TaskState, LONG)]

        def done():
            task.append(rospy.wait_for_message(NODE + '/task', TaskState, LONG))
            return not task[-1].running
        self.until(done, 'the task does not end')
        self.assertTrue(task[-1].passed, task[-1])

    def quiet_status(self):
        """The line of help, once what was said is gone."""
        rospy.sleep(5.0)
        return self.status()

    def status(self):
        return self.display.screenshot()[self.rectangle[1]:, :-150].astype(int)  # without the frames a second

    def until_said(self, help_text):
        """Something else is there for some time."""
        self.until(lambda: (self.status() != help_text).any(axis=2).sum() > 200, 'nothing was said')
        self.until(lambda: (self.status() != help_text).any(axis=2).sum() < 50, 'it is said for ever')

    def test_what_is_refused_is_said(self):
        bead = numpy.array([0.0, -0.02, 0.06])
        self.assertTrue(call('spawn', Spawn, name='bead', primitive=SolidPrimitive(type=SolidPrimitive.SPHERE, dimensions=[0.004]),
                             pose=PoseStamped(pose=Pose(position=Point(*bead), orientation=Quaternion(w=1.0)))).success)
        self.point_at(bead)
        help_text = self.quiet_status()
        self.mouse.click()  # nothing is hollow there
        self.until_said(help_text)
        self.assertEqual([], self.clips())


if __name__ == '__main__':
    rospy.init_node('clip_test')
    rostest.rosrun('meshless_surgery', 'clip', ClipTest, sys.argv)
