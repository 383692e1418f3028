#!/usr/bin/env python3
"""docs/own_package.md: its files in a workspace of their own, on top of this package. It is built, played by its robot, replayed, tested,
installed and shown by its commands as they are printed; and each of its mistakes."""
import os
import re
import shutil
import sys

import numpy
import rospy
import yaml

HERE = os.path.dirname(os.path.realpath(__file__))
sys.path[:0] = [HERE, os.path.join(HERE, '..', 'rviz')]
from deformer_support import LONG, run  # noqa: E402
from meshless_surgery import Surgeon  # noqa: E402
from meshless_surgery.msg import TaskState  # noqa: E402
from page_support import PageTestCase  # noqa: E402
from rviz_view import project, view_rectangle  # noqa: E402
from virtual_display import Mouse, VirtualDisplay, stop, wait_until  # noqa: E402

PATH = re.compile(r'`([\w/]+\.(?:xml|txt|py|yaml|rviz|launch|test))`')
NUMBER = r'(?:\b[0-9a-f]{16}\b|-?\d[\d.e-]*)'

CLOSES_ON_THE_GALLBLADDER = """
import sys
import rospy
sys.path.insert(0, 'src/my_trainer/scripts')
import robot
rospy.init_node('misfires')
surgeon = robot.Surgeon('/deformer')
surgeon.stepped()
applier = robot.Arm(surgeon, 'applier')
applier.go((0.0, -0.05, 0.112), 1.0)
applier.go((0.0, 0.009, 0.112))
applier.go(applier.at, 0.0)
"""

# What a trainee might try in place of the work, by services.
STRETCHES_THE_DUCT = """
import rospy
from meshless_surgery import Surgeon
rospy.init_node('stretches')
surgeon = Surgeon('/deformer')
surgeon.stepped()
surgeon.reset()
surgeon.live(1.0)
for x in (0.036, 0.020):
    surgeon.clip((x, 0, 0.116), (0, 0, 1), width=0.004, body='duct')
surgeon.live(0.5)
pick = surgeon.pick((-0.05, 0, 0.115), body='gallbladder')
for n in range(1, 61):
    surgeon.move(pick.pick_id, (-0.05 - 0.001 * n, -0.0013 * n, 0.115 - 0.0015 * n))
    surgeon.live(0.03)
surgeon.live(1.0)
surgeon.release(pick.pick_id)
surgeon.live(0.5)
report = surgeon.report('stretches')
print('score %.0f, %s' % (report.score, report.passed))
"""


class OwnPackagePageTest(PageTestCase):

    name = 'own_package.md'

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        # Text between blocks names the file of the next one; a block right after one of commands is what these print.
        cls.sources, cls.printed = {}, []
        parts = re.split(r'^```(\w*)\n(.*?)^```\n', cls.page, flags=re.DOTALL | re.MULTILINE)
        for before, language, block in zip(parts[::3], parts[1::3], parts[2::3]):
            named = PATH.findall(before.strip().split('\n\n')[-1])
            if language == 'text' and not named:
                cls.printed.append(block.splitlines())
            elif language not in ('bash', ''):
                cls.sources[named[0]] = block
        tree = cls.page.split('```')[1]
        assert set(cls.sources) == set(re.findall(r'[\w/]+\.(?:xml|txt|py|yaml|rviz|launch|test)', tree)), cls.sources.keys()

    def setUp(self):
        super().setUp()
        self.workspace = os.path.join(self.folder, 'trainer_ws')
        self.package = os.path.join(self.workspace, 'src', 'my_trainer')
        for name, text in self.sources.items():
            os.makedirs(os.path.dirname(os.path.join(self.package, name)), exist_ok=True)
            self.write('trainer_ws/src/my_trainer/' + name, text)
        if not os.path.isdir(os.path.join(self.workspace, 'devel')):
            for begin in ('mkdir', '/usr/bin/python3', 'chmod', 'catkin_make'):
                self.there(self.command(begin), None)
            self.assertEqual({'liver.stl', 'gallbladder.stl', 'duct.stl'}, set(os.listdir(os.path.join(self.package, 'meshes'))))

    def sourced(self, command, space='devel'):
        return "bash -c 'cd trainer_ws && source %s/setup.bash && exec %s'" % (space, command)

    def there(self, command, space='devel'):
        """A command of the page in the workspace: what it prints."""
        return self.good(self.sourced(command, space) if space else 'cd trainer_ws && ' + command)

    def change(self, name, old, new):
        text = self.sources[name]
        self.assertIn(old, text)
        self.write('trainer_ws/src/my_trainer/' + name, text.replace(old, new))

    def train(self, space='devel'):
        return self.sourced(self.command('roslaunch my_trainer') + ' rviz:=false', space)

    def said_at_launch(self, space='devel', client=None):
        with self.running(self.train(space)) as end:
            if client:
                self.write('trainer_ws/client.py', client)
                self.there('python3 client.py')
            return end()

    def prints(self, number, said):
        """Each line of the page's block, with whatever numbers."""
        for line in self.printed[number]:
            line = line.replace('~/.ros', os.path.join(self.folder, 'home'))
            self.assertRegex(said, NUMBER.join(re.escape(part) for part in re.split(NUMBER, line)))

    def test_the_robot_passes_and_its_log_says_the_same(self):
        with self.running(self.train()) as end:
            task = rospy.wait_for_message('/deformer/task', TaskState, LONG)
            self.assertEqual(('remove', 'ann', 6), (task.task, task.trainee, len(task.stages)))
            self.assertEqual(0.015, rospy.get_param('/deformer/tools/scissors/length'))
            said = self.there(self.command('rosrun my_trainer'))
            said_by_the_node = end()
        self.prints(0, said_by_the_node)
        self.prints(1, said)
        self.assertEqual(self.printed[1][:3], said.splitlines()[:3])
        self.assertIn(', passed; ', said)
        self.prints(2, self.there(self.command('rosrun meshless_surgery replay')) + self.there(self.command('rosrun meshless_surgery report')))
        self.assertEqual('', self.there(self.command('diff')))

    def test_its_own_test_passes(self):
        self.there(self.command('catkin_make run_tests'))
        self.assertRegex(self.there(self.command('catkin_test_results')), r'Summary: \d+ tests, 0 errors, 0 failures')

    def test_who_stretches_the_duct_does_not_pass(self):
        self.write('trainer_ws/client.py', STRETCHES_THE_DUCT)
        with self.running(self.train()):
            self.assertEqual('score 0, False\n', self.there('python3 client.py'))

    def test_rviz_shows_it_and_clips_by_the_mouse(self):
        view = yaml.safe_load(self.sources['rviz/train.rviz'])['Visualization Manager']['Views']['Current']
        view['Field of View'] = 0.785398  # rviz's own
        display = VirtualDisplay()
        try:
            def shown():
                picture = display.screenshot().astype(int)
                red, green, blue = picture[:, :, 0], picture[:, :, 1], picture[:, :, 2]
                return (red > green + 60).sum() > 5000 and ((green > red + 10) & (green > blue + 30)).sum() > 1000
            launch = display.start_rviz(['bash', '-c', 'cd %s && source devel/setup.bash && exec %s' % (
                self.workspace, self.command('roslaunch my_trainer'))], shown)
            try:
                display.save(os.path.join(os.environ.get('ROS_HOME', '/tmp'), 'own_package.png'))
                surgeon, mouse = Surgeon('/deformer'), Mouse(display)
                vertices = numpy.array([(v.x, v.y, v.z) for v in surgeon.body('duct').surface.vertices])
                place = vertices[abs(vertices[:, 0] - 0.036) < 0.001].mean(axis=0)
                rectangle = view_rectangle(display.screenshot())
                row, column = project(numpy.array([place]), view, rectangle)[0]
                mouse.move((rectangle[0] + 30, rectangle[2] + 30))
                mouse.key('l')

                def clipped():
                    mouse.move((row + 2, column + 2))
                    mouse.move((row, column))
                    mouse.click()
                    return [a for a in surgeon.state().attachments if a.jaws > 0.0]
                self.assertTrue(wait_until(clipped, LONG, 2.0), 'no clip')
                self.assertEqual(1, rospy.wait_for_message('/deformer/task', TaskState, LONG).stage)
            finally:
                stop(launch)
        finally:
            display.close()

    def without_data_folders(self):
        self.change('launch/train.launch', '<arg name="data_folders" value="[$(find my_trainer)]"/>', '')

    def without_meshes(self):
        meshes = os.path.join(self.package, 'meshes')
        os.rename(meshes, meshes + '_away')
        try:
            return self.said_at_launch()
        finally:
            os.rename(meshes + '_away', meshes)

    def a_mesh_that_may_not_be_read(self):
        self.without_data_folders()
        return self.said_at_launch()

    def a_material_that_may_not_be_read(self):
        self.without_data_folders()
        scene = self.sources['scenes/gall.yaml'].replace('file: ../meshes/liver.stl', 'primitive: {box: [0.16, 0.12, 0.05]}')
        self.write('trainer_ws/src/my_trainer/scenes/gall.yaml', scene.replace('elastic_liver', 'gall_wall'))
        return self.said_at_launch()

    def not_sourced(self):
        with self.running(self.node('package://my_trainer/scenes/gall.yaml')) as end:
            return end()

    def of_another_body(self):
        self.change('tasks/remove.yaml', 'target: {body: gallbladder', 'target: {body: spleen')
        return self.said_at_launch()

    def without_a_node(self):
        self.change('scripts/robot.py', 'timeout=20.0', 'timeout=0.5')
        return self.shell(self.sourced(self.command('rosrun my_trainer')))[1]

    def test_what_is_said_of_each_mistake_is_what_the_page_says(self):
        self.said_of({
            '`make_meshes.py` was not run': self.without_meshes,
            '`data_folders` left out, and a mesh in `meshes/`': self.a_mesh_that_may_not_be_read,
            '`data_folders` left out, and a material in `materials/`': self.a_material_that_may_not_be_read,
            'the workspace was not sourced': self.not_sourced,
            "a task of another scene's body": self.of_another_body,
            'the applier closed on what is not a vessel': lambda: self.said_at_launch(client=CLOSES_ON_THE_GALLBLADDER),
            'a robot where no node runs': self.without_a_node,
        })

    def test_what_is_installed_is_whole(self):
        self.there(self.command('catkin_make') + ' install', None)
        shutil.move(self.package, self.package + '_away')
        try:
            said = self.said_at_launch('install')
        finally:
            shutil.move(self.package + '_away', self.package)
        self.assertNotIn('accepted', said)
        self.assertIn('attachment bed', said)
        self.assertTrue(os.access(os.path.join(self.workspace, 'install', 'lib', 'my_trainer', 'robot.py'), os.X_OK))


if __name__ == '__main__':
    run('own_package', OwnPackagePageTest)
