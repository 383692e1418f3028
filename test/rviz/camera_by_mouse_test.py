#!/usr/bin/env python3
"""The task camera by a real mouse on a virtual display, in the picture of the endoscope that it leads."""
import os
import sys
import unittest

import numpy
import rospkg
import rospy
import rostest
import tf2_ros

sys.path.insert(0, os.path.dirname(os.path.realpath(__file__)))
sys.path.insert(0, os.path.join(rospkg.RosPack().get_path('meshless_surgery'), 'scripts'))
from play_camera import BACK, CUPS, TROCAR, view  # noqa: E402
from rviz_view import axes, configured_view  # noqa: E402
from virtual_display import Mouse, VirtualDisplay, stop, wait_until  # noqa: E402

from geometry_msgs.msg import Pose, Quaternion  # noqa: E402
from meshless_surgery.msg import State, TaskState  # noqa: E402
from meshless_surgery.srv import GetBody, StartTask  # noqa: E402

NODE = '/deformer'
LONG = 60.0
NOTCH, TURN = 0.005, 10.0  # [m], [degrees] of the wheel
PLANE = 0.05               # [m] before the camera, in which the cursor's way is taken
MOST = 280                 # [px] of a drag


def xyz(point):
    return numpy.array([point.x, point.y, point.z])


class CameraTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.display = VirtualDisplay()

        def shown():
            picture = cls.display.screenshot().astype(int)
            white = (picture.min(axis=2) > 150) & (numpy.ptp(picture, axis=2) < 40)
            cls.red = (picture[:, :, 0] > 90) & (picture[:, :, 0] > 2 * picture[:, :, 1])
            dark = (picture == (20, 6, 5)).all(axis=2)
            rows, columns = numpy.where(dark.sum(axis=1) > 100)[0], numpy.where(dark.sum(axis=0) > 100)[0]
            if len(rows) == 0 or len(columns) == 0:
                return False
            cls.rectangle = rows[0], rows[-1] + 1, columns[0], columns[-1] + 1
            return cls.rectangle[1] - cls.rectangle[0] > 300 and white.any()
        cls.launch = cls.display.start_rviz(['roslaunch', 'meshless_surgery', 'training.launch', 'scene:=camera'], shown)
        cls.mouse = Mouse(cls.display)
        cls.angle = configured_view('camera')['Field of View']

    @classmethod
    def tearDownClass(cls):
        stop(cls.launch)
        cls.display.close()

    def pose(self):
        asked = rospy.Time.now()
        while True:
            state = rospy.wait_for_message(NODE + '/state', State, LONG)
            if state.header.stamp >= asked:
                return state.instruments[0].pose

    def sight(self):
        """Of the endoscope: right, up and ahead in its picture, by tf."""
        rotation = self.frames.lookup_transform('world', 'scope/view', rospy.Time(0), rospy.Duration(5.0)).transform.rotation
        x, y, z = axes(Pose(orientation=rotation))
        return -y, z, x

    def lead_to(self, place):
        """By drags and the wheel, until no notch brings it nearer."""
        for _ in range(12):
            rospy.sleep(0.15)
            right, up, ahead = self.sight()
            left = place - xyz(self.pose().position)
            notches = int(round(left.dot(ahead) / NOTCH))
            scale = 2 * PLANE * numpy.tan(0.5 * self.angle) / (self.rectangle[1] - self.rectangle[0])
            way = numpy.array([-left.dot(up), left.dot(right)]) / scale
            if notches == 0 and numpy.abs(way).max() < 15:
                return
            way *= min(1.0, MOST / max(1.0, numpy.abs(way).max()))
            row, column = self.middle
            self.mouse.move((row, column))
            self.mouse.down()
            self.mouse.move((row + way[0], column + way[1]))
            self.mouse.up()
            self.mouse.wheel(notches)
        self.fail('the mouse does not lead the endoscope to %s; it is at %s' % (place, xyz(self.pose().position)))

    def turn_to(self, orientation):
        rospy.sleep(0.3)
        now, wanted = axes(self.pose()), axes(Pose(orientation=Quaternion(*orientation)))
        angle = numpy.degrees(numpy.arctan2(wanted[2].dot(-now[1]), wanted[2].dot(now[2])))
        self.mouse.key_down('ctrl')
        try:
            self.mouse.wheel(int(round(angle / TURN)))
        finally:
            self.mouse.key_up('ctrl')

    def stage(self):
        return rospy.wait_for_message(NODE + '/task', TaskState, LONG).stage

    def test_the_task_is_passed(self):
        self.frames = tf2_ros.Buffer()
        tf2_ros.TransformListener(self.frames)
        top, bottom, left, right = self.rectangle
        self.middle = (top + bottom) // 2, (left + right) // 2
        rospy.wait_for_service(NODE + '/start_task', LONG)
        answer = rospy.ServiceProxy(NODE + '/start_task', StartTask)(task='camera', trainee='mouse', allow=['slow'])
        self.assertTrue(answer.success, answer.message)
        self.mouse.move(self.middle)
        self.mouse.key('j')
        get_body = rospy.ServiceProxy(NODE + '/get_body', GetBody)
        for number, (ball, side) in enumerate(CUPS.items()):
            middle = numpy.mean([xyz(v) for v in get_body(name=ball).surface.vertices], axis=0)
            eye, orientation = view(tuple(middle), numpy.radians(side))
            above = numpy.array(TROCAR) + BACK * (numpy.array(eye) - TROCAR) / numpy.linalg.norm(numpy.array(eye) - TROCAR)
            out = xyz(self.pose().position) - TROCAR
            self.lead_to(TROCAR + BACK * out / numpy.linalg.norm(out))
            self.lead_to(above)
            self.turn_to(orientation)
            self.lead_to(numpy.array(eye))
            self.turn_to(orientation)
            self.assertTrue(wait_until(lambda: self.stage() == number + 1, 15.0, 0.2), '%s is not shown' % ball)
            file = os.path.join(os.environ.get('ROS_HOME', '/tmp'), 'camera_%s.png' % ball)
            self.display.save(file)
            print('picture: ' + file)
        task = rospy.wait_for_message(NODE + '/task', TaskState, LONG)
        self.assertTrue(task.passed, task)
        print('score %.1f' % task.score)


if __name__ == '__main__':
    rospy.init_node('camera_by_mouse_test')
    rostest.rosrun('meshless_surgery', 'camera_by_mouse', CameraTest, sys.argv)
