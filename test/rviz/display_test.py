#!/usr/bin/env python3
"""The Tissue display: cut faces in their inside colour, strain and the force of springs by colour, instruments and the
shadows of their tips, and nothing is asked of the node while it is switched off."""
import os
import sys
import tempfile
import unittest

import numpy
import rospkg
import rospy
import rostest
import yaml

sys.path.insert(0, os.path.dirname(os.path.realpath(__file__)))
sys.path.insert(1, os.path.join(os.path.dirname(os.path.dirname(os.path.realpath(__file__))), 'ros'))
from mapped_cube import laid_at, seen_at  # noqa: E402
from rviz_view import BACKGROUND, configured_view, project, view_rectangle  # noqa: E402
from virtual_display import VirtualDisplay, stop, wait_until  # noqa: E402

from diagnostic_msgs.msg import DiagnosticArray  # noqa: E402
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion, Vector3  # noqa: E402
from meshless_surgery.msg import State, Surfaces  # noqa: E402
from meshless_surgery.srv import Cut, Lock, Pick, Probe, Push, Remove, SetMaterial, Spawn  # noqa: E402
from shape_msgs.msg import SolidPrimitive  # noqa: E402
from std_srvs.srv import SetBool  # noqa: E402
from visualization_msgs.msg import Marker, MarkerArray  # noqa: E402

LONG = 60.0
LOBE = Point(-0.05, -0.03, 0.1)


def call(service, kind, **fields):
    name = '/deformer/' + service
    rospy.wait_for_service(name, LONG)
    reply = rospy.ServiceProxy(name, kind)(**fields)
    assert reply.success, reply.message
    return reply


class DisplayTest(unittest.TestCase):
    def start(self, change=lambda display: None, name='Tissue', scene='liver', more=()):
        """rviz with the scene's configuration, whose display of that name (None: each) `change` may alter, and more displays."""
        file = os.path.join(rospkg.RosPack().get_path('meshless_surgery'), 'config', 'rviz', scene + '.rviz')
        with open(file) as text:
            config = yaml.safe_load(text)
        for display in config['Visualization Manager']['Displays']:
            if name in (None, display['Name']):
                change(display)
        config['Visualization Manager']['Displays'] += more
        with tempfile.NamedTemporaryFile('w', suffix='.rviz', delete=False) as changed:
            yaml.safe_dump(config, changed)
        self.addCleanup(os.remove, changed.name)
        self.view = configured_view(scene)
        self.display = VirtualDisplay()
        self.addCleanup(self.display.close)

        def shown():
            self.rectangle = view_rectangle(self.display.screenshot())
            return self.rectangle is not None and self.rectangle[1] - self.rectangle[0] > 300
        launch = self.display.start_rviz(['roslaunch', 'meshless_surgery', 'training.launch', 'scene:=' + scene,
                                          'rviz_config:=' + changed.name], shown)
        self.addCleanup(stop, launch)
        rospy.wait_for_service('/deformer/pick', LONG)
        rospy.sleep(2.0)

    def pixels(self):
        top, bottom, left, right = self.rectangle
        return self.display.screenshot()[top:bottom, left:right].astype(float)

    def save(self, name):
        file = os.path.join(os.environ.get('ROS_HOME', '/tmp'), 'display_%s.png' % name)
        self.display.save(file)
        print('picture: ' + file)

    def until(self, condition, what):
        self.assertTrue(wait_until(condition, LONG), what)

    def pull(self, target):
        pick = call('pick', Pick, point=LOBE, max_distance=0.1)
        call('lock', Lock, pick_id=pick.pick_id, at_target=True, target=target)

    def test_faces_of_a_cut_have_the_inside_colour(self):
        self.start()

        def inside():
            picture = self.pixels()
            red, green = picture[:, :, 0], picture[:, :, 1]
            return ((red > green + 35) & (green > 0.42 * red)).sum()
        self.until(lambda: (self.pixels()[:, :, 0] > 100).sum() > 2000, 'no liver')
        before = inside()
        call('cut', Cut, blades=PoseStamped(pose=Pose(position=Point(0.0, -1, 0.1),
                                                      orientation=Quaternion(0.5, 0.5, 0.5, 0.5))))
        # The camera looks from the right: it sees the face of what lies left of the cut.
        pieces = rospy.wait_for_message('/deformer/state', State, LONG).bodies
        call('remove', Remove, name=max(pieces, key=lambda body: body.centre_of_mass.x).name)
        self.until(lambda: inside() > before + 500, 'no face of the cut is seen')
        self.save('inside')

    def test_tissue_is_wet_and_patterned(self):
        def without(display):
            display['Shine'] = False

        def look():
            """Shares of the liver's pixels that mirror a lamp, and how much neighbours differ in the median."""
            picture = self.pixels()
            liver = (picture[:, :, 0] > picture[:, :, 2] + 35)
            if liver.sum() < 2000:
                return 0.0, 0.0
            both = liver[:, 1:] & liver[:, :-1]
            return (picture[liver][:, 1] > 110).mean(), numpy.median(numpy.abs(numpy.diff(picture[:, :, 0], axis=1))[both])
        self.start(without)
        self.until(lambda: look()[1] > 0.0, 'no liver')
        dull, smooth = look()
        self.doCleanups()
        self.start()
        self.until(lambda: look()[0] > dull + 0.002, 'no lamp is mirrored')
        print('mirrored %.4f, without %.4f; neighbours differ by %.1f, without %.1f' % (look()[0], dull, look()[1], smooth))
        self.assertGreater(look()[1], smooth + 1.0, 'no pattern')
        self.save('shine')

    def test_tissue_shows_its_image(self):
        image = os.path.join(rospkg.RosPack().get_path('meshless_surgery'), 'test', 'ros', 'scenes', 'pixels.png')

        def of_each_colour():
            """Pixels that are green, blue and yellow: nothing else in the picture is."""
            red, green, blue = (self.pixels()[:, :, k] for k in range(3))
            return min(((green > red + 40) & (green > blue + 40)).sum(), ((blue > red + 40) & (blue > green + 40)).sum(),
                       ((red > blue + 60) & (green > blue + 60)).sum())
        for shine in (True, False):
            self.start(lambda display: display.update(Shine=shine))
            self.until(lambda: (self.pixels()[:, :, 0] > 100).sum() > 2000, 'no liver')
            self.assertLess(of_each_colour(), 50)
            yaml_text = 'appearance: {outer: {image: "%s", scale: 0.12}}'
            call('set_material', SetMaterial, body='liver', yaml=yaml_text % image)
            self.until(lambda: of_each_colour() > 500, 'no image, shine %s' % shine)
            self.save('image_%s' % shine)
            # One that cannot be had is said, and the plain colour is shown.
            answer = call('set_material', SetMaterial, body='liver', yaml=yaml_text % 'no_such.png')
            self.assertIn("there is no file 'no_such.png'", answer.message)
            self.until(lambda: of_each_colour() < 50, 'the image stays')
            self.doCleanups()

    def test_a_file_lays_its_image_on_its_surface(self):
        self.start()
        call('pause', SetBool, data=True)
        call('remove', Remove, name='liver')
        scenes = os.path.join(rospkg.RosPack().get_path('meshless_surgery'), 'test', 'ros', 'scenes')
        place = numpy.array([0.0, 0.0, 0.1])
        call('spawn', Spawn, file=os.path.join(scenes, 'mapped.obj'), units='mm', name='cube',
             pose=PoseStamped(pose=Pose(position=Point(*place), orientation=Quaternion(w=1.0))))
        call('set_material', SetMaterial, body='cube',
             yaml='{inside_color: [0.1, 0.1, 0.1], appearance: {outer: {image: "%s", wetness: 0}}}' % os.path.join(scenes, 'pixels.png'))

        def off():
            """How far the colours of the sides +x, -y and +z are from those of the file's image, but for the light; 0 to 2."""
            most, picture = 0.0, self.display.screenshot().astype(float)
            for side, axis in ((1, 0), (2, 1), (5, 2)):
                for right in (-0.6, -0.2, 0.3, 0.7):
                    for up in (-0.6, 0.0, 0.6):
                        at = 0.05 * numpy.roll([1.0 if side % 2 else -1.0, right, up], axis)
                        row, column = project((place + at)[None], self.view, self.rectangle)[0]
                        seen = picture[row - 1:row + 2, column - 1:column + 2].mean(axis=(0, 1))
                        u, v = laid_at(side, at)
                        wanted = seen_at(u, v / 2.0)
                        most = max(most, numpy.abs(seen / max(numpy.linalg.norm(seen), 1.0) - wanted / numpy.linalg.norm(wanted)).sum())
            return most
        self.until(lambda: off() < 0.25, 'the image lies elsewhere')
        call('cut', Cut, blades=PoseStamped(pose=Pose(position=Point(0.004, -1, 0.1), orientation=Quaternion(0.5, 0.5, 0.5, 0.5))))
        wait_until(lambda: len(rospy.wait_for_message('/deformer/state', State, LONG).bodies) == 2, LONG)
        rospy.sleep(1.0)
        self.save('uv')
        self.until(lambda: off() < 0.25, 'the image lies elsewhere on the pieces')

    def test_edges_of_cuts_are_bloody(self):
        self.start()

        def red():
            picture = self.pixels()
            return ((picture[:, :, 0] > 1.35 * picture[:, :, 1]) & (picture[:, :, 0] > 45)).sum()
        call('set_material', SetMaterial, yaml='{color: [0.7, 0.7, 0.7], inside_color: [0.7, 0.7, 0.7], appearance: none}')
        self.until(lambda: red() < 50, 'it is not grey')
        before = red()
        call('cut', Cut, blades=PoseStamped(pose=Pose(position=Point(0.0, -1, 0.1),
                                                      orientation=Quaternion(0.5, 0.5, 0.5, 0.5))))
        self.until(lambda: red() > before + 100, 'no blood at the edges')
        self.save('edges')

    def test_strain_is_shown_where_tissue_is_pulled(self):
        def by_strain(display):
            display['Colour by'] = {'Value': 'Strain', 'Full strain': 0.3}
        self.start(by_strain)

        def count(strong, weak):
            picture = self.pixels()
            return (picture[:, :, strong] > 1.5 * picture[:, :, weak] + 30).sum()
        # Blue where the liver lies as it was made.
        self.until(lambda: count(2, 0) > 2000, 'no undeformed tissue in the picture')
        calm = count(0, 2)
        self.pull(Point(-0.09, -0.08, 0.2))
        self.until(lambda: count(0, 2) > calm + 500, 'no strained tissue in the picture')
        self.save('strain')

    def test_a_spring_is_red_under_a_large_force(self):
        def wire(display):
            display['Tools'] = {'Value': True, 'Full force': 5}
            display['Opacity'] = 0.2  # the spring's end in the tissue is inside of it
        self.start(wire)
        target = numpy.array([-0.1, -0.1, 0.25])
        call('pause', SetBool, data=False)
        self.pull(Point(*target))
        rospy.sleep(2.0)

        def colour_along_spring():
            """The most saturated colours near the free end, where the tissue is not."""
            end = project(target[None], self.view, self.rectangle)[0]
            part = self.display.screenshot()[end[0] + 2:end[0] + 40, end[1] - 25:end[1] + 40].reshape(-1, 3).astype(float)
            return part[(part[:, 0] > 120) & (part[:, 1] < 0.5 * part[:, 0]) & (part[:, 2] < 0.5 * part[:, 0])]
        self.until(lambda: len(colour_along_spring()) > 3, 'no red spring in the picture')
        self.save('spring')

    def show_probe(self, place=(0.0, -0.14, 0.12)):
        """A small sphere in the air before the liver, at a shaft that comes along x."""
        call('pause', SetBool, data=True)
        call('push', Push, enable=True, radius=0.004, pose=PoseStamped(pose=Pose(position=Point(*place), orientation=Quaternion(w=1.0))))
        return numpy.array(place)

    def steel_along_shaft(self):
        """The share of pixels along the shaft of the probe that are grey: its pose is what ~surfaces says."""
        part, = rospy.wait_for_message('/deformer/surfaces', Surfaces, LONG).instruments
        q = part.pose.orientation
        reach = numpy.array([1 - 2 * (q.y ** 2 + q.z ** 2), 2 * (q.x * q.y + q.w * q.z), 2 * (q.x * q.z - q.w * q.y)])
        start = numpy.array([part.pose.position.x, part.pose.position.y, part.pose.position.z])
        places = start - numpy.linspace(0.02, 0.1, 30)[:, None] * reach
        rows, columns = project(places, self.view, self.rectangle).T
        colours = self.display.screenshot()[rows, columns].astype(int)
        background = numpy.abs(colours - BACKGROUND).max(axis=1) < 16
        return ((colours.max(axis=1) - colours.min(axis=1) < 40) & ~background).mean()

    def test_instruments_are_drawn_where_they_are(self):
        def dull(display):
            display['Shine'] = False

        def markers_alone(display):
            display['Enabled'] = display['Value'] = display['Name'] == 'Markers'

        def without_tools(display):
            display['Tools'] = {'Value': False}
        for name, change, shown in (('Tissue', lambda display: None, True), ('Tissue', dull, True), (None, markers_alone, True),
                                    ('Tissue', without_tools, False)):
            self.start(change, name)
            self.show_probe()
            if shown:
                self.until(lambda: self.steel_along_shaft() > 0.9, 'no shaft: %s' % change.__name__)
            else:
                rospy.sleep(2.0)
                self.assertLess(self.steel_along_shaft(), 0.2)
            self.save('instrument_' + change.__name__.strip('<>'))
            self.doCleanups()

    def test_tips_cast_shadows_on_tissue_below_them(self):
        def without(display):
            display['Tools'] = {'Value': True, 'Full force': 20, 'Shadows': False}

        def brightness():
            """Of the tissue below the sphere, and of that beside it: what is straight below is found by a ray."""
            colours = []
            for x in (-0.05, 0.0):
                met = call('probe', Probe, point=Point(x, -0.02, 0.3), direction=Vector3(0, 0, -1)).position
                row, column = project(numpy.array([[met.x, met.y, met.z]]), self.view, self.rectangle)[0]
                colours.append(self.display.screenshot()[row - 3:row + 4, column - 3:column + 4].astype(float).mean())
            return numpy.array(colours)
        seen = []
        for change in (without, lambda display: None):
            self.start(change)
            call('pause', SetBool, data=True)
            self.until(lambda: brightness().min() > 20, 'no tissue')
            call('push', Push, enable=True, radius=0.006, pose=PoseStamped(pose=Pose(position=Point(-0.05, -0.02, 0.125), orientation=Quaternion(w=1.0))))
            rospy.sleep(2.0)
            seen.append(brightness())
            self.save('shadow_%d' % len(seen))
            self.doCleanups()
        lit, shaded = seen
        print('below the tip and beside it: %s without shadows, %s with' % (lit, shaded))
        self.assertLess(shaded[0], 0.85 * lit[0])
        self.assertAlmostEqual(lit[1], shaded[1], delta=0.03 * lit[1])

    def test_two_eyes_see_what_is_at_the_focal_distance_at_one_place(self):
        eyes, distance = 0.02, configured_view('liver')['Distance']  # the liver is about there
        for focus in (distance, 3.0 * distance):
            self.start(more=[{'Class': 'meshless_surgery/Stereo', 'Name': 'Stereo', 'Enabled': True, 'Value': True,
                              'Eye distance': eyes, 'Focal distance': focus}])
            call('pause', SetBool, data=True)
            rospy.sleep(1.0)

            def columns():
                """Where the tissue is, in the mean, in both halves; how much of it they have."""
                picture = self.pixels()
                half = picture.shape[1] // 2
                halves = [(part[:, :, 0] > part[:, :, 2] + 35) for part in (picture[:, :half], picture[:, -half:])]
                return [numpy.argwhere(part)[:, 1].mean() if part.any() else 0.0 for part in halves], [part.sum() for part in halves]
            self.until(lambda: min(columns()[1]) > 2000, 'an eye sees no liver')
            (left, right), (many, other) = columns()
            self.save('stereo')
            self.assertAlmostEqual(1.0, other / many, delta=0.05)
            scale = 0.5 * (self.rectangle[1] - self.rectangle[0]) / numpy.tan(0.5 * self.view['Field of View'])
            wanted = -eyes * (1.0 / distance - 1.0 / focus) * scale
            print('the right eye sees it %.1f px beside where the left one does, wanted %.1f' % (right - left, wanted))
            self.assertAlmostEqual(wanted, right - left, delta=4.0)
            self.doCleanups()

    def test_contacts_are_shown_where_bodies_press(self):
        def on(display):
            display['Enabled'] = display['Value'] = True
        self.start(on, 'Contacts', 'block')
        markers = rospy.wait_for_message('/deformer/contacts', MarkerArray, LONG)

        def points(kinds=('points', 'forces')):
            array = rospy.wait_for_message('/deformer/contacts', MarkerArray, LONG)
            return numpy.array([[p.x, p.y, p.z] for m in array.markers if m.ns in kinds for p in m.points])
        self.assertEqual(Marker.DELETEALL, markers.markers[0].action)
        self.until(lambda: len(points()) > 3, 'nothing presses on the ground')
        # A box on the block: now bodies press on each other.
        call('spawn', Spawn, name='upper', primitive=SolidPrimitive(type=SolidPrimitive.BOX, dimensions=[0.08, 0.08, 0.08]),
             pose=PoseStamped(pose=Pose(position=Point(0.0, 0.0, 0.2), orientation=Quaternion(w=1.0))))
        self.until(lambda: (points(['points']).reshape(-1, 3)[:, 2] > 0.03).sum() > 4, 'the bodies do not press on each other')

        def yellow():
            """Pixels of the markers' hue, in the light of rviz's lamp."""
            picture = self.display.screenshot().astype(float)
            red, green, blue = picture[:, :, 0], picture[:, :, 1], picture[:, :, 2]
            return (red > 90) & (numpy.abs(green / numpy.maximum(red, 1) - 0.75) < 0.08) & (blue < 0.25 * red)
        self.until(lambda: yellow().sum() > 20, 'no contact in the picture')
        # They are where the node says that they are: some points are seen, none of the colour is elsewhere.
        call('pause', SetBool, data=True)
        rospy.sleep(1.5)
        self.save('contacts')
        marked = points()
        # Along the lines of the forces, too.
        count = (len(marked) // 3)
        starts, ends = marked[count::2], marked[count + 1::2]
        lines = [starts + share * (ends - starts) for share in numpy.linspace(0.0, 1.0, 11)]
        pixels = project(numpy.concatenate(lines), self.view, self.rectangle)
        seen = numpy.argwhere(yellow())
        self.assertGreater(len(seen), 20)
        gaps = numpy.array([numpy.abs(pixels - place).max(axis=1).min() for place in seen])
        self.assertLess(numpy.percentile(gaps, 95), 12)

    def test_nothing_is_built_while_it_is_off(self):
        def off(display):
            display['Enabled'] = display['Value'] = False
        self.start(off)
        built = []
        for _ in range(3):
            array = rospy.wait_for_message('/diagnostics', DiagnosticArray, LONG)
            values = {value.key: value.value for status in array.status for value in status.values}
            built += [values[what + ' built'] for what in ('surfaces', 'marker arrays', 'clusters', 'contacts', 'point clouds')]
        self.assertEqual(15, len(built))
        self.assertEqual({'0'}, set(built))


if __name__ == '__main__':
    rospy.init_node('display_test')
    rostest.rosrun('meshless_surgery', 'display', DisplayTest, sys.argv)
