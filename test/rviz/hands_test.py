#!/usr/bin/env python3
"""A real mouse on a virtual display works with the tools of the rviz plugin: what the node says of its world, and what the
picture shows, is what the hand did."""
import contextlib
import os
import re
import signal
import sys
import unittest
from xmlrpc.client import ServerProxy

import numpy
import rosgraph
import rospy
import rostest

sys.path.insert(0, os.path.dirname(os.path.realpath(__file__)))
from rviz_view import axes, camera_axes, configured_view, project, ray_through, view_rectangle  # noqa: E402
from virtual_display import Mouse, VirtualDisplay, stop, wait_until  # noqa: E402

from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion, Vector3  # noqa: E402
from meshless_surgery.msg import Event, State  # noqa: E402
from meshless_surgery.srv import Cut, GetBody, Probe, Remove, Spawn  # noqa: E402
from shape_msgs.msg import SolidPrimitive  # noqa: E402
from std_srvs.srv import SetBool, Trigger  # noqa: E402

NODE = '/deformer'
LONG = 60.0
# On the right lobe of the liver, as it lies at the start: in the middle of what the camera sees of it.
LOBE = (-0.05, -0.03, 0.075)


def call(service, kind, **fields):
    rospy.wait_for_service(NODE + '/' + service, LONG)
    return rospy.ServiceProxy(NODE + '/' + service, kind)(**fields)


def process_of(node):
    return ServerProxy(rosgraph.Master('/hands_test').lookupNode(node)).getPid('/hands_test')[2]


def vector(point):
    return numpy.array([point.x, point.y, point.z])


class HandsTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.view = configured_view('liver')
        cls.display = VirtualDisplay()

        def shown():
            cls.rectangle = view_rectangle(cls.display.screenshot())
            return cls.rectangle is not None and cls.rectangle[1] - cls.rectangle[0] > 300 and cls.tissue().sum() > 2000
        cls.launch = cls.display.start_rviz(['roslaunch', 'meshless_surgery', 'training.launch', 'scene:=liver'], shown)
        cls.events = []
        cls.poses = {'push': [], 'scissors': []}
        rospy.wait_for_service(NODE + '/reset', LONG)
        cls.heard = [rospy.Subscriber(NODE + '/events', Event, cls.events.append, queue_size=100)]
        for tool, poses in cls.poses.items():
            cls.heard.append(rospy.Subscriber('%s/%s/measured_cp' % (NODE, tool), PoseStamped, poses.append, queue_size=10))
        cls.mouse = Mouse(cls.display)

    @classmethod
    def tearDownClass(cls):
        stop(cls.launch)
        cls.display.close()

    def setUp(self):
        self.assertTrue(call('reset', Trigger).success)
        self.mouse.key('m')  # no tool of ours holds anything
        self.mouse.move((self.rectangle[0] + 20, self.rectangle[2] + 20))
        self.assertTrue(wait_until(lambda: self.state().sim_time > 0.05 and not self.state().picks, LONG, 0.1))
        self.events.clear()

    # --- what there is

    def state(self):
        """As it is after everything that was answered before."""
        asked = rospy.Time.now()
        while True:
            state = rospy.wait_for_message(NODE + '/state', State, LONG)
            if state.header.stamp >= asked:
                return state

    def body(self, name='liver'):
        surface = call('get_body', GetBody, name=name).surface
        return numpy.array([vector(v) for v in surface.vertices])

    @classmethod
    def tissue(cls, picture=None):
        """Which pixels of the view are reddish, as the liver is outside and inside."""
        picture = (cls.display.screenshot() if picture is None else picture).astype(int)
        top, bottom, left, right = cls.rectangle
        part = picture[top:bottom, left:right]
        return (part[:, :, 0] > part[:, :, 1] + 35) & (part[:, :, 0] > part[:, :, 2] + 35)

    def ray(self, place):
        """As ~probe wants it, through a pixel."""
        origin, direction = ray_through(place, self.view, self.rectangle)
        return {'point': Point(*origin), 'direction': Vector3(*direction)}

    def pixel(self, point):
        return project(numpy.array([point]), self.view, self.rectangle)[0]

    def colour_at(self, place, around=3):
        """Mean colour of a few pixels."""
        row, column = place
        return self.display.screenshot()[row - around:row + around + 1, column - around:column + around + 1].reshape(
            -1, 3).astype(float)

    def save(self, name):
        file = os.path.join(os.environ.get('ROS_HOME', '/tmp'), 'hands_%s.png' % name)
        self.display.save(file)
        print('picture: ' + file)

    def until(self, condition, what, pause=0.1):
        self.assertTrue(wait_until(condition, LONG, pause), what)

    def said(self, kind):
        return [event for event in self.events if event.type == kind]

    # --- what a hand does

    def take(self, key):
        """The tool, with the cursor on the tissue."""
        self.mouse.key(key)
        place = self.pixel(LOBE)
        self.mouse.move((place[0] + 3, place[1] + 3))
        self.mouse.move(place)
        rospy.sleep(0.5)
        return place

    def grab(self):
        """Holds the lobe; its pick."""
        place = self.take('k')
        self.mouse.down()
        self.until(lambda: len(self.state().picks) == 1, 'nothing was grabbed')
        rospy.sleep(0.3)
        return place, self.state().picks[0]

    def let_go(self):
        self.mouse.up()
        self.until(lambda: not self.state().picks, 'the spring was not let go')

    def pick(self):
        picks = self.state().picks
        self.assertEqual(1, len(picks))
        return picks[0]

    # --- pick

    def test_a_drag_pulls_in_the_plane_of_the_view_and_lets_go(self):
        eye, side, up, back = camera_axes(self.view)
        place, grabbed = self.grab()
        self.assertEqual('liver', grabbed.body)
        start = vector(grabbed.target)
        # The grabbed point is under the cursor.
        self.assertLess(numpy.abs(self.pixel(start) - place).max(), 3)
        self.mouse.move((place[0] - 90, place[1] - 60))
        self.until(lambda: (vector(self.pick().target) - start).dot(up) > 0.03, 'the free end did not follow')
        rospy.sleep(1.0)
        pick = self.pick()
        moved = vector(pick.target) - start
        self.assertLess(abs(moved.dot(back)), 1e-4)
        self.assertLess(moved.dot(side), -0.02)
        end = self.pixel(vector(pick.target))
        self.assertLess(numpy.abs(end - (place[0] - 90, place[1] - 60)).max(), 3)
        # The tissue follows its spring, and in the picture the red sphere is where the free end is.
        self.assertGreater((vector(pick.position) - start).dot(up), 0.02)
        self.assertGreater(vector(pick.force).dot(up), 0.1)
        red = self.colour_at(end)  # brighter than the tissue
        self.assertTrue(((red[:, 0] > 185) & (red[:, 1] < 70) & (red[:, 2] < 70)).any(), red)
        self.save('pick')
        self.let_go()
        self.assertEqual(1, len(self.said('picked')))
        self.assertEqual(1, len(self.said('released')))

    def test_the_cursor_tells_what_is_under_it(self):
        for key in 'khx':
            place = self.take(key)
            corner = (self.rectangle[1] - 60, self.rectangle[2] + 60)
            self.mouse.move(corner)
            rospy.sleep(1.0)
            air = self.display.cursor()
            self.mouse.move(place)
            self.until(lambda: self.display.cursor() != air, 'the cursor is the same over tissue, with ' + key)
            if key == 'k':
                over = self.display.cursor()
                self.mouse.down()
                self.until(lambda: self.display.cursor() not in (air, over), 'the cursor is the same in a drag')
                self.mouse.up()
            self.mouse.move(corner)
            self.until(lambda: self.display.cursor() == air, 'the cursor over tissue stays in the air, with ' + key)

    def test_the_key_of_the_tool_in_hand_keeps_it(self):
        for key in 'khx':
            place = self.take(key)
            over = self.display.cursor()
            self.mouse.key('m')
            self.mouse.move((place[0] + 4, place[1]))
            self.until(lambda: self.display.cursor() != over, 'the cursor of rviz is that of ' + key)
            self.mouse.key(key)
            self.mouse.key(key)  # before the mouse has moved
            self.mouse.move((place[0] + 2, place[1]))
            self.until(lambda: self.display.cursor() == over, 'put away by its own key: ' + key)
            self.mouse.key(key)
            rospy.sleep(0.5)
            self.mouse.move(place)
            rospy.sleep(0.5)
            self.assertEqual(over, self.display.cursor(), 'put away by its own key: ' + key)

    def test_the_wheel_moves_the_plane_and_keeps_its_normal(self):
        back = camera_axes(self.view)[3]
        place, grabbed = self.grab()
        start = vector(grabbed.target)
        self.mouse.wheel(4)  # away
        self.until(lambda: (vector(self.pick().target) - start).dot(back) < -0.015, 'the plane did not move away')
        self.assertAlmostEqual(-0.02, (vector(self.pick().target) - start).dot(back), delta=5e-4)
        self.mouse.wheel(-8)  # towards
        self.until(lambda: (vector(self.pick().target) - start).dot(back) > 0.015, 'the plane did not come')
        self.mouse.move((place[0] - 40, place[1] - 40))
        self.until(lambda: numpy.linalg.norm(vector(self.pick().target) - start) > 0.03, 'the free end did not follow')
        self.assertAlmostEqual(0.02, (vector(self.pick().target) - start).dot(back), delta=5e-4)
        self.save('wheel')
        self.let_go()

    def test_right_click_locks_and_the_view_and_the_tool_can_change(self):
        place, _ = self.grab()
        self.mouse.move((place[0] - 80, place[1] - 40))
        rospy.sleep(0.5)
        self.mouse.click(3)
        self.until(lambda: self.pick().locked, 'the right button locked nothing')
        locked = self.pick()
        self.mouse.move((place[0] - 120, place[1] + 60))  # the left button is still down
        self.mouse.up()
        rospy.sleep(0.5)
        self.assertEqual(locked.target, self.pick().target)
        self.assertTrue(self.pick().locked)
        # Another tool, and a view that turns.
        self.mouse.key('m')
        before = self.tissue()
        corner = (self.rectangle[1] - 60, self.rectangle[2] + 60)
        self.mouse.move(corner)
        self.mouse.down()
        self.mouse.move((corner[0], corner[1] + 150))
        self.until(lambda: (self.tissue() != before).sum() > 0.2 * before.sum(), 'the view does not turn')
        self.mouse.move(corner)
        self.mouse.up()
        self.until(lambda: (self.tissue() != before).sum() < 0.05 * before.sum(), 'the view did not come back')
        self.assertEqual(locked.target, self.pick().target)
        self.assertTrue(self.pick().locked)
        self.save('lock')

    def locked_sphere(self):
        place, _ = self.grab()
        self.mouse.move((place[0] - 80, place[1] - 40))
        rospy.sleep(0.3)
        self.mouse.click(3)
        self.mouse.up()
        self.until(lambda: self.pick().locked, 'the right button locked nothing')
        rospy.sleep(0.3)
        return self.pick(), self.pixel(vector(self.pick().target))

    def test_a_locked_sphere_is_taken_up_again(self):
        locked, place = self.locked_sphere()
        self.mouse.move((place[0] + 60, place[1] + 120))
        self.mouse.move(place)
        self.mouse.down()
        self.until(lambda: not self.pick().locked, 'the sphere was not taken up')
        self.assertEqual(locked.pick_id, self.pick().pick_id)
        self.mouse.move((place[0] - 50, place[1] + 50))
        self.until(lambda: numpy.abs(self.pixel(vector(self.pick().target)) - (place[0] - 50, place[1] + 50)).max() < 4,
                   'the sphere did not follow')
        self.save('regain')
        self.let_go()

    def test_escape_undoes_the_drag(self):
        locked, place = self.locked_sphere()
        self.mouse.move((place[0] + 60, place[1] + 120))
        self.mouse.move(place)
        self.mouse.down()
        self.until(lambda: not self.pick().locked, 'the sphere was not taken up')
        self.mouse.move((place[0] - 60, place[1] + 60))
        self.mouse.key('Escape')
        self.until(lambda: self.pick().locked, 'Escape did not lock it again')
        self.assertLess(numpy.abs(vector(self.pick().target) - vector(locked.target)).max(), 1e-6)
        self.mouse.up()
        # A drag of fresh tissue lets go, and the tool is still there.
        start = self.pixel(LOBE)
        self.mouse.key('r')
        self.until(lambda: not self.state().picks, 'springs were not cleared')
        self.mouse.move(start)
        rospy.sleep(1.0)
        self.mouse.down()
        self.until(lambda: len(self.state().picks) == 1, 'nothing was grabbed')
        self.mouse.move((start[0] - 60, start[1]))
        self.mouse.key('Escape')
        self.until(lambda: not self.state().picks, 'Escape did not let go')
        self.mouse.up()

    def test_a_key_clears_all_springs(self):
        for column in (0, 40):
            place = self.take('k')
            self.mouse.move((place[0], place[1] + column))
            rospy.sleep(0.5)
            before = len(self.state().picks)
            self.mouse.down()
            self.until(lambda: len(self.state().picks) == before + 1, 'nothing was grabbed')
            self.mouse.move((place[0] - 60, place[1] + 2 * column))
            rospy.sleep(0.3)
            self.mouse.click(3)
            self.mouse.up()
            self.until(lambda: all(p.locked for p in self.state().picks), 'not locked')
            self.mouse.key('m')
        self.save('two_locks')
        self.take('k')
        self.mouse.key('r')
        self.until(lambda: not self.state().picks, 'R cleared nothing')
        self.assertEqual(2, len(self.said('released')))

    def test_a_drag_beside_the_tissue_turns_the_view_and_grabs_nothing(self):
        self.take('k')
        before = self.tissue()
        corner = (self.rectangle[1] - 60, self.rectangle[2] + 60)
        self.mouse.move(corner)
        rospy.sleep(0.3)
        self.mouse.down()
        rospy.sleep(0.5)
        self.mouse.move((corner[0], corner[1] + 200))
        rospy.sleep(0.5)
        turned = self.tissue()
        self.mouse.move(corner)
        self.mouse.up()
        self.assertGreater((turned != before).sum(), 0.2 * before.sum())
        self.assertEqual([], self.state().picks)
        self.assertEqual([], self.said('picked'))
        # It has come back, up to what the first pixels of the drag were before the node had answered.
        self.until(lambda: (self.tissue() != before).sum() < 0.1 * before.sum(), 'the view is not as it was')

    def turns(self):
        """How often the thread of rviz' windows has begun to wait, so far."""
        rviz = process_of('/rviz')
        with open('/proc/%d/task/%d/status' % (rviz, rviz)) as status:
            return re.search(r'\nvoluntary_ctxt_switches:\s*(\d+)', status.read()).group(1)

    @contextlib.contextmanager
    def long_picture(self):
        """One that takes far longer than the node waits for a stream."""
        with self.display.stalled():
            rospy.sleep(0.5)
            before = self.turns()
            rospy.sleep(1.5)
            yield
            self.assertEqual(before, self.turns(), 'rviz went on drawing: this is no test')
        self.until(lambda: self.turns() != before, 'rviz does not go on')

    def test_what_the_hand_holds_outlasts_a_picture_that_takes_long(self):
        place, grabbed = self.grab()
        self.mouse.move((place[0] - 60, place[1] - 40))
        with self.long_picture():
            self.assertEqual([grabbed.pick_id], [pick.pick_id for pick in self.state().picks], 'it was dropped')
        self.mouse.move((place[0] - 90, place[1] - 60))
        self.until(lambda: numpy.abs(self.pixel(vector(self.pick().target)) - (place[0] - 90, place[1] - 60)).max() < 4,
                   'the free end does not follow any more')
        self.let_go()
        self.take('h')
        self.mouse.down()
        self.until(lambda: self.pushes(), 'no sphere')
        with self.long_picture():
            self.assertTrue(self.pushes(), 'the sphere is gone')
        self.mouse.up()
        self.until(lambda: not self.pushes(), 'the sphere was not lifted off')
        self.take('x')
        self.blades()
        with self.long_picture():
            self.poses['scissors'].clear()
            rospy.sleep(0.5)
            self.assertTrue(self.poses['scissors'], 'the scissors are gone')
        self.assertEqual([], self.said('lifted'))

    def test_a_node_that_hangs_does_not_freeze_the_view(self):
        place, _ = self.grab()
        process = process_of(NODE)
        os.kill(process, signal.SIGSTOP)
        try:
            self.mouse.move((place[0] - 60, place[1] - 40))  # a drag, to nobody
            self.mouse.wheel(2)
            self.mouse.click(3)                              # a lock that nobody answers
            self.mouse.up()
            self.mouse.key('x')                              # another tool, that asks what is under the cursor
            self.mouse.move(place)
            self.mouse.key('h')
            self.mouse.down()
            self.mouse.move((place[0] - 20, place[1]))
            self.mouse.move(place)  # where no tissue is known, a drag turns the view: and back
            self.mouse.up()
            self.mouse.key('m')
            # The view turns as ever.
            before = self.tissue()
            corner = (self.rectangle[1] - 60, self.rectangle[2] + 60)
            self.mouse.move(corner)
            self.mouse.down()
            self.mouse.move((corner[0], corner[1] + 150))
            self.assertTrue(wait_until(lambda: (self.tissue() != before).sum() > 0.2 * before.sum(), 10, 0.1),
                            'the view hangs with the node')
            self.mouse.move(corner)
            self.mouse.up()
        finally:
            os.kill(process, signal.SIGCONT)
        # What was asked is then done in the order of its asking: one lock, no sphere.
        self.until(lambda: [p.locked for p in self.state().picks] == [True], 'the lock is lost')
        self.until(lambda: not self.pushes(), 'the sphere stays')

    # --- push

    def pushes(self):
        """The sphere's poses that come from now on, for half a second."""
        self.poses['push'].clear()
        rospy.sleep(0.5)
        return list(self.poses['push'])

    def sphere(self):
        """Where it is now, whenever that is said."""
        self.poses['push'].clear()
        self.until(lambda: self.poses['push'], 'no sphere', 0.02)
        return vector(self.poses['push'][-1].pose.position)

    def test_a_sphere_pushes_while_the_button_is_down(self):
        eye, side, up, back = camera_axes(self.view)
        rospy.sleep(1.0)
        call('pause', SetBool, data=True)  # so that the tissue is where it was when the ghost was put before it
        self.addCleanup(call, 'pause', SetBool, data=False)
        rest = self.body()
        place = self.take('h')
        self.assertEqual([], self.pushes())  # a ghost alone
        ghost = self.colour_at(place).mean(axis=0)
        self.assertGreater(ghost[2], 70, 'no ghost in the picture')
        self.mouse.key_down('ctrl')
        self.mouse.wheel(2)  # larger
        self.mouse.key_up('ctrl')
        self.mouse.down()
        self.until(lambda: self.pushes(), 'no sphere')
        first = self.sphere()
        # Before the tissue, touching it where the cursor is, with the radius of the wheel.
        point = self.pixel(first)
        self.assertLess(numpy.abs(point - place).max(), 4)
        self.assertAlmostEqual(0.02 * 1.15 ** 2, numpy.linalg.norm(rest - first, axis=1).min(), delta=0.004)
        call('pause', SetBool, data=False)
        self.mouse.wheel(5)  # away: into the tissue
        self.until(lambda: (self.sphere() - first).dot(back) < -0.02, 'the sphere stays')
        self.until(lambda: self.said('touched'), 'it touched nothing')
        now = self.body()
        dented = numpy.linalg.norm(now - rest, axis=1)
        self.assertGreater(dented.max(), 0.01)
        self.save('push')
        self.mouse.up()
        self.until(lambda: not self.pushes(), 'the sphere was not lifted off')

    def test_a_right_click_leaves_the_sphere_and_it_is_taken_up_again(self):
        place = self.take('h')
        self.mouse.down()
        self.until(lambda: self.pushes(), 'no sphere')
        self.mouse.click(3)
        self.mouse.up()
        rospy.sleep(0.5)
        left = self.sphere()
        self.mouse.key('m')
        self.assertLess(numpy.linalg.norm(self.sphere() - left), 1e-6)
        self.mouse.key('h')
        self.mouse.move((place[0] + 2, place[1]))
        self.mouse.down()
        self.mouse.move((place[0] - 80, place[1]))
        self.until(lambda: (self.sphere() - left)[2] > 0.02, 'the sphere was not taken up')
        self.mouse.up()
        self.until(lambda: not self.pushes(), 'the sphere was not lifted off')

    # --- cut

    def blades(self):
        self.poses['scissors'].clear()
        self.until(lambda: self.poses['scissors'], 'no scissors')
        return self.poses['scissors'][-1].pose

    def test_blades_that_are_let_go_early_cut_nothing(self):
        self.take('x')
        self.blades()
        self.mouse.down()
        rospy.sleep(0.25)
        self.mouse.up()
        rospy.sleep(1.5)
        self.assertEqual(['liver'], [b.name for b in self.state().bodies])
        self.mouse.down()
        rospy.sleep(0.2)
        self.mouse.key('Escape')
        rospy.sleep(1.5)
        self.mouse.up()
        self.assertEqual(['liver'], [b.name for b in self.state().bodies])
        self.assertEqual([], self.said('cut'))

    def test_blades_that_meet_sever_what_they_hold_and_z_undoes_it(self):
        place = self.take('x')
        pose = self.blades()
        # Their middle is on the tissue under the cursor.
        middle = call('probe', Probe, **self.ray(place))
        self.assertTrue(middle.success)
        self.assertLess(numpy.linalg.norm(vector(pose.position) + 0.03 * axes(pose)[0] - vector(middle.position)), 0.003)
        call('pause', SetBool, data=True)  # so that the pieces stay where they were cut
        self.addCleanup(call, 'pause', SetBool, data=False)
        volume = self.state().bodies[0].volume
        rest = self.tissue()
        self.mouse.down()
        self.until(lambda: self.said('cut'), 'the blades did not meet')
        self.mouse.up()
        bodies = self.state().bodies
        self.assertEqual(['liver.1', 'liver.2'], [b.name for b in bodies])
        self.assertAlmostEqual(1.0, sum(b.volume for b in bodies) / volume, delta=5e-4)
        # The plane of the blades lies between the pieces.
        pose = self.blades()
        normal = axes(pose)[2]
        heights = [(self.body(b.name) - vector(pose.position)).dot(normal) for b in bodies]
        upper = heights[0] if heights[0].mean() > heights[1].mean() else heights[1]
        lower = heights[1] if upper is heights[0] else heights[0]
        # The surface follows the tissue of its own side from the cut on, which may draw it over by parts of a millimetre.
        self.assertGreater(upper.min(), -1e-3)
        self.assertLess(lower.max(), 1e-3)
        call('pause', SetBool, data=False)
        rospy.sleep(1.0)
        self.mouse.move((place[0] + 150, place[1] + 200))
        self.save('cut')
        self.assertGreater((self.tissue() != rest).sum(), 100)
        self.mouse.key('z')
        self.until(lambda: [b.name for b in self.state().bodies] == ['liver'], 'the cut was not undone')
        self.assertEqual(1, len(self.said('undone')))

    CUT_LINE = (51, 230, 255)

    def cut_line(self):
        """Rows and columns of the pixels that say where the blades will cut."""
        near = numpy.abs(self.display.screenshot().astype(int) - self.CUT_LINE).max(axis=2) < 12
        top, bottom, left, right = self.rectangle
        near[:top] = near[bottom:] = False
        near[:, :left] = near[:, right:] = False
        return numpy.argwhere(near)

    def test_a_line_on_the_tissue_says_where_the_blades_will_cut(self):
        rospy.sleep(1.0)
        call('pause', SetBool, data=True)  # so that the tissue stays below its line
        self.addCleanup(call, 'pause', SetBool, data=False)
        self.assertEqual(0, len(self.cut_line()))
        place = self.take('x')
        self.until(lambda: len(self.cut_line()) > 50, 'no line on the tissue')
        rospy.sleep(0.5)
        line = self.cut_line()
        self.save('cut_line')
        # Each of its pixels is beside an edge of the tissue that the plane of the blades goes through.
        pose = self.blades()
        normal = axes(pose)[2]
        surface = call('get_body', GetBody, name='liver').surface
        vertices = numpy.array([vector(v) for v in surface.vertices])
        triangles = numpy.array([t.vertex_indices for t in surface.triangles])
        heights = (vertices - vector(pose.position)).dot(normal)
        crossings = []
        for a, b in ((0, 1), (1, 2), (2, 0)):
            i, j = triangles[:, a], triangles[:, b]
            crossed = (heights[i] < 0) != (heights[j] < 0)
            i, j = i[crossed], j[crossed]
            share = (heights[i] / (heights[i] - heights[j]))[:, None]
            crossings.append(vertices[i] + share * (vertices[j] - vertices[i]))
        crossings = project(numpy.concatenate(crossings), self.view, self.rectangle)
        gaps = numpy.array([numpy.linalg.norm(crossings - pixel, axis=1).min() for pixel in line])
        self.assertLess(numpy.percentile(gaps, 95), 8)
        # In the air the blades hold nothing, and a tool that is put away shows nothing.
        self.mouse.move((self.rectangle[0] + 30, self.rectangle[2] + 30))
        self.until(lambda: len(self.cut_line()) == 0, 'the line stays though the blades are in the air')
        self.mouse.move(place)
        self.until(lambda: len(self.cut_line()) > 50, 'no line on the tissue')
        self.mouse.key('m')
        self.until(lambda: len(self.cut_line()) == 0, 'the line stays without the tool')

    def test_shift_drag_turns_the_blades_and_the_wheel_moves_them(self):
        place = self.take('x')
        before = self.blades()
        self.mouse.key_down('shift')
        self.mouse.down()
        self.mouse.move((place[0], place[1] + 100))
        self.mouse.up()
        self.mouse.key_up('shift')
        self.mouse.move(place)
        rospy.sleep(0.5)
        after = self.blades()
        dot = abs(sum(getattr(before.orientation, a) * getattr(after.orientation, a) for a in 'xyzw'))
        self.assertAlmostEqual(0.8, 2 * numpy.arccos(min(1.0, dot)), delta=0.05)  # 100 px of 0.008 rad
        # About the tissue under the cursor.
        middles = [vector(pose.position) + 0.03 * axes(pose)[0] for pose in (before, after)]
        self.assertLess(numpy.linalg.norm(middles[1] - middles[0]), 0.003)
        self.mouse.wheel(3)
        rospy.sleep(0.5)
        moved = vector(self.blades().position) - vector(after.position)
        self.assertLess(numpy.linalg.norm(moved - 0.015 * axes(after)[0]), 0.003)  # along themselves
        self.assertEqual(['liver'], [b.name for b in self.state().bodies])
        self.mouse.key('m')
        rospy.sleep(1.0)
        self.poses['scissors'].clear()
        rospy.sleep(0.5)
        self.assertEqual([], self.poses['scissors'], 'the scissors stayed when the tool was put away')

    def test_control_drag_draws_an_incision(self):
        place = self.take('x')
        self.mouse.key_down('ctrl')
        self.mouse.down()
        self.mouse.move((place[0] + 10, place[1] + 60))
        rospy.sleep(0.5)
        self.save('incision_line')
        self.mouse.up()
        self.mouse.key_up('ctrl')
        self.until(lambda: self.said('incised'), 'nothing was opened')
        bodies = self.state().bodies
        self.assertEqual(['liver'], [b.name for b in bodies])
        # The surface is larger by both wound faces.
        self.mouse.move((place[0] + 150, place[1] + 200))
        rospy.sleep(1.0)
        self.save('incision')
        self.mouse.key('z')
        self.until(lambda: self.said('undone'), 'the incision was not undone')
        self.assertLess(self.state().bodies[0].triangles, bodies[0].triangles)


    # --- the panel

    def panel(self):
        """Where its parts are, told from the picture: the plot's dashed green line, and the blue of the sliders below it."""
        picture = self.display.screenshot().astype(int)[:, :self.rectangle[2] - 20]
        green = (numpy.abs(picture - (40, 150, 70)).max(axis=2) < 30)
        rows, columns = numpy.where(green)
        self.assertGreater(len(rows), 20, 'no plot in the picture')
        left, right, line = columns.min(), columns.max(), int(numpy.median(rows))
        blue = (picture[:, :, 2] > picture[:, :, 0] + 60) & (picture[:, :, 2] > picture[:, :, 1] + 15)
        sliders, row = [], line
        while row < picture.shape[0]:
            count = blue[row].sum()
            # The bar of a slider is a few pixels high; the selected body above it is a whole row of the table.
            if count > 8:
                end = row
                while end < picture.shape[0] and blue[end].sum() > 8:
                    end += 1
                if end - row > 10:
                    sliders = []
                else:
                    sliders.append(((row + end) // 2, int(numpy.where(blue[(row + end) // 2])[0].max()) + 7))
                row = end
            row += 1
        return {'left': left, 'right': right, 'line': line, 'sliders': sliders}

    def press(self, button):
        """Pause, Step, Reset, Undo: 0 to 3. They share the plot's width, above it."""
        panel = self.panel()
        width = (panel['right'] - panel['left']) / 4
        self.mouse.move((panel['line'] - 65, int(panel['left'] + (button + 0.5) * width)))
        self.mouse.click()
        rospy.sleep(0.5)

    def test_the_panel_pauses_steps_resets_and_undoes(self):
        rospy.sleep(2.0)  # of the plot
        self.press(0)
        self.until(lambda: self.state().paused, 'the panel did not pause')
        step = self.state().step
        self.press(1)
        self.until(lambda: self.state().step == step + 1, 'the panel did not step')
        self.assertTrue(call('cut', Cut, blades=PoseStamped(pose=Pose(
            position=Point(-0.01, -1, 0.1), orientation=Quaternion(0.5, 0.5, 0.5, 0.5)))).success)
        self.until(lambda: len(self.state().bodies) == 2, 'not cut')
        rospy.sleep(0.5)
        self.save('panel')
        self.press(3)
        self.until(lambda: [b.name for b in self.state().bodies] == ['liver'], 'the panel did not undo the cut')
        self.press(2)
        self.until(lambda: self.state().step < step, 'the panel did not reset')
        self.press(0)
        self.until(lambda: not self.state().paused, 'the panel did not go on')

    def slide(self, slider, way):
        row, column = slider
        self.mouse.move((row, column))
        self.mouse.down()
        self.mouse.move((row, column + way))
        self.mouse.up()

    def test_the_panel_changes_the_material(self):
        box = SolidPrimitive(type=SolidPrimitive.BOX, dimensions=[0.05, 0.05, 0.05])
        pose = PoseStamped(pose=Pose(position=Point(0, -0.15, 0.03), orientation=Quaternion(w=1)))
        reply = call('spawn', Spawn, name='box', primitive=box, pose=pose, material='liver')
        self.assertTrue(reply.success, reply.message)
        self.assertTrue(call('remove', Remove, name='liver').success)
        rospy.sleep(2.0)
        before = self.state().bodies[0]
        sliders = self.panel()['sliders']
        self.assertEqual(3, len(sliders), 'alpha, beta and damping')
        self.slide(sliders[0], -80)
        self.until(lambda: self.state().bodies[0].alpha < before.alpha - 0.2, 'alpha did not change')
        after = self.state().bodies[0]
        self.assertEqual(before.beta, after.beta)
        self.assertEqual(before.damping, after.damping)
        self.slide(sliders[2], 40)
        self.until(lambda: self.state().bodies[0].damping > before.damping + 1.0, 'damping did not change')
        self.save('material')

    def test_the_panel_offers_of_an_elastic_material_what_it_uses(self):
        rospy.sleep(2.0)
        sliders = self.panel()['sliders']
        self.assertEqual(3, len(sliders), "Young's modulus, Poisson's ratio and damping")
        self.save('elastic')
        numbers = 'youngs_modulus', 'poissons_ratio', 'damping', 'alpha', 'beta'
        for moved, way, changed in ((0, 40, lambda old, new: new > 1.2 * old), (1, -40, lambda old, new: new < old - 0.02),
                                    (2, 40, lambda old, new: new > old + 1.0)):
            before = self.state().bodies[0]
            self.slide(sliders[moved], way)
            self.until(lambda: changed(*(getattr(body, numbers[moved]) for body in (before, self.state().bodies[0]))),
                       numbers[moved] + ' did not change')
            after = self.state().bodies[0]
            for other in set(numbers) - {numbers[moved]}:
                self.assertEqual(getattr(before, other), getattr(after, other), other)


if __name__ == '__main__':
    rospy.init_node('hands_test')
    rostest.rosrun('meshless_surgery', 'hands', HandsTest, sys.argv)
