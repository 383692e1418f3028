#!/usr/bin/env python3
"""The pages for one task each: their files and commands as they are printed, and each of their mistakes."""
import os
import re
import sys

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from deformer_support import run  # noqa: E402
from page_support import PageTestCase  # noqa: E402


class ScenePageTest(PageTestCase):

    name = 'scene.md'

    def test_the_least_and_the_table(self):
        self.check_setup()
        self.write('table.py', self.files['table.py'])
        with self.running(self.launch()):
            said = self.good('python3 table.py')
        name, volume, low, high = re.search(r'(\w+): (\d+) ml, from z = (-?\d+) to (\d+) mm', said).groups()
        self.assertEqual(('sphere', '0'), (name, low.lstrip('-')))
        self.assertAlmostEqual(500, int(volume), delta=30)
        self.assertTrue(70 < int(high) <= 101, said)  # it is soft
        with self.running(self.launch(1)):
            said = self.good('python3 table.py')
        liver = re.search(r'liver: \d+ ml, from z = (-?\d+) to (\d+) mm', said)
        self.assertLess(int(liver.group(1)), -10, 'it hangs over the edge: ' + said)
        block = re.search(r'block: \d+ ml, from z = (-?\d+) to (\d+) mm', said)
        self.assertLess(abs(int(block.group(1))), 3, said)

    def test_no_key_of_the_least_can_be_left_out(self):
        least = self.files['first.yaml']
        for line in least.splitlines():
            self.write('first.yaml', least.replace(line + '\n', ''))
            with self.running(self.node('$PWD/first.yaml')) as end:
                if 'pose' in line:  # half of it in the ground
                    self.assertRegex(self.good('python3 table.py'), r'sphere: \d+ ml')
                said = end()
            self.assertEqual('pose' in line, 'below the ground' in said, said)
            self.assertTrue('pose' in line or 'accepted' in said, said)

    def loaded(self, old, new, file='table.yaml'):
        self.assertIn(old, self.files[file])
        self.write(file, self.files[file].replace(old, new))
        with self.running(self.node('$PWD/' + file)) as end:
            return end()

    def test_what_is_said_of_each_mistake_is_what_the_page_says(self):
        self.said_of({
            'a misspelt key': lambda: self.loaded('pose', 'poze', 'first.yaml'),
            'a value out of range': lambda: self.loaded('poissons_ratio: 0.45', 'poissons_ratio: 0.5'),
            'centimetres': lambda: self.loaded('sphere: 0.05', 'box: [10, 10, 10]', 'first.yaml'),
            'a name twice': lambda: self.loaded('name: block', 'name: liver'),
            'a material that is not there': lambda: self.loaded('material: soft', 'material: softt'),
            'an attachment beside what it joins': lambda: self.loaded('[-0.08, 0, 0.016]', '[-0.08, 0, 0.116]'),
            '`fixed` beside the body': lambda: self.loaded('[-0.01, -0.05, -0.01]', '[-0.01, -0.05, 0.035]'),
        })


class ClampPageTest(PageTestCase):

    name = 'clamp.md'

    def test_what_is_held_is_shown(self):
        self.check_setup()
        with self.running(self.launch()) as end:
            said = self.good('python3 held.py')
            log = end()
        share = re.search(r'The log says `(.*?)`', self.page).group(1)
        self.assertIn(share, log)
        held = re.search(r'(\d+) % is held, from x = (-?[\d.]+) to (-?[\d.]+) m', said)
        self.assertEqual(share.split(' ')[0], held.group(1))
        self.assertLess(float(held.group(2)), -0.095)
        self.assertLess(abs(float(held.group(3)) + 0.07), 0.02)
        self.assertLess(float(re.search(r'hangs at z = ([\d.]+)', said).group(1)), 0.25)

    def loaded(self, old, new):
        self.assertIn(old, self.files['bar.yaml'])
        self.write('bar.yaml', self.files['bar.yaml'].replace(old, new))
        with self.running(self.node('$PWD/bar.yaml')) as end:
            return end()

    def test_what_is_said_of_each_mistake_is_what_the_page_says(self):
        box = '{min: [-0.11, -0.03, 0.27], max: [-0.07, 0.03, 0.33]}'
        self.said_of({
            'the box is elsewhere': lambda: self.loaded(box, '{min: [-0.11, -0.03, -0.03], max: [-0.07, 0.03, 0.03]}'),
            '`min` and `max` exchanged': lambda: self.loaded(box, '{max: [-0.11, -0.03, 0.27], min: [-0.07, 0.03, 0.33]}'),
            'all of it is held': lambda: self.loaded('max: [-0.07', 'max: [0.11'),
            'the box holds other tissue too': lambda: self.loaded('max: [-0.07', 'max: [-0.035'),
        })


class PythonPageTest(PageTestCase):

    name = 'python.md'

    def test_the_script_does_what_it_says_and_the_same_again(self):
        self.check_setup()
        with self.running(self.launch() + ' paused:=true'):
            said = self.good('python3 pull_and_cut.py')
            again = self.good('python3 pull_and_cut.py')
        self.assertEqual(said.split('hash')[1], again.split('hash')[1])
        self.assertRegex(said, r'pieces: liver\.1 liver\.2\n')
        self.assertRegex(said, r'liver\.1: \d+ ml\nliver\.2: \d+ ml\n')
        self.assertIn('as expected: no tissue within', said)
        self.assertNotIn('failed', said)

    def script(self, old, new, scene='liver'):
        self.assertIn(old, self.files['pull_and_cut.py'])
        self.write('pull_and_cut.py', self.files['pull_and_cut.py'].replace(old, new))
        if scene is None:
            return self.shell('timeout 100 python3 pull_and_cut.py')[1]
        with self.running(self.node(scene, paused='true')):
            return self.shell('python3 pull_and_cut.py')[1]

    def test_what_is_said_of_each_mistake_is_what_the_page_says(self):
        self.said_of({
            'no node runs, or it has another name': lambda: self.script('timeout=10.0', 'timeout=0.5', None),
            'the name of a body that was cut': lambda: self.script('surgeon.body(piece)', "surgeon.body('liver')"),
            'beside the tissue': lambda: self.script('0.03), max_distance=0.1', '0.5), max_distance=0.05'),
            'the blades pass it': lambda: self.script('(0, -1, 0.1), reach=(0, 1, 0), normal=(1, 0, 0)',
                                                      '(0, -1, 0.5), reach=(0, 1, 0), normal=(0, 0, 1)'),
            'a number that is none': lambda: self.script('0.09))', "float('nan')))"),
            'a pick that was released': lambda: self.script('    surgeon.lock(', '    surgeon.release(1)\n    surgeon.lock('),
        })


    def test_force_grows_with_the_way_as_the_spring_has_it(self):
        with self.running(self.launch() + ' paused:=true'):
            said = self.good('python3 force.py')
            self.assertEqual(said, self.good('python3 force.py'))
        rows = [[float(word) for word in line.split()] for line in said.splitlines() if re.match(r' *\d', line)]
        self.assertEqual([2.0 * n for n in range(1, 11)], [free for free, _, _ in rows])
        forces = [force for _, _, force in rows]
        self.assertGreater(forces[-1], 2.0 * forces[0])
        for free, tissue, force in rows:  # 500 N/m; the mean over a step lags behind the free end by half of 0.17 mm
            self.assertTrue(0.0 < tissue < free, said)
            self.assertAlmostEqual(0.5 * (free - tissue), force, delta=0.2, msg=said)


TWO_NODES = """
import rospy
import tf2_ros
from geometry_msgs.msg import TransformStamped
rospy.init_node('two')
frames, at = tf2_ros.TransformBroadcaster(), TransformStamped(child_frame_id='tool0')
at.header.frame_id = 'world'
at.transform.rotation.w = 1.0
for n in range(100):
    at.header.stamp = rospy.Time.now()
    at.transform.translation.x = 0.2 * (n % 2)
    frames.sendTransform(at)
    rospy.sleep(0.02)
"""

DISABLES = """
import rospy
from meshless_surgery.crtk import StringStamped, operating_state
from std_srvs.srv import Trigger
rospy.init_node('disables')
command = rospy.Publisher('/deformer/scissors/state_command', StringStamped, queue_size=1)
while not command.get_num_connections():
    rospy.sleep(0.02)
command.publish(StringStamped(string='disable'))
while rospy.wait_for_message('/deformer/scissors/operating_state', operating_state, 10).state != 'DISABLED':
    rospy.sleep(0.02)
print(rospy.ServiceProxy('/deformer/reset', Trigger)().message)
"""


class RobotPageTest(PageTestCase):

    name = 'robot.md'

    def node_of_the_page(self):
        """Without the silence that ends a pick: on a machine that stands still, it would come between two poses."""
        return self.command('rosrun meshless_surgery deformer_node') + ' _tools/silence:=0'

    def test_the_hand_lifts_the_liver_and_feels_it(self):
        self.check_setup()
        with self.running(self.node_of_the_page()):
            said = self.good('python3 robot.py')
        up, most = re.fullmatch(r'tissue (\d+) mm up, (\d+\.\d+) N at most\n', said).groups()
        self.assertTrue(3 < int(up) < 20, said)
        self.assertTrue(0.2 < float(most) < 10.0, said)

    def test_the_blades_cut_by_topics_alone(self):
        with self.running(self.node_of_the_page()):
            self.assertEqual('the scissors are ENABLED\ncut into: liver.1 liver.2\n', self.good('python3 blades.py'))

    def script(self, old='', new='', **parameters):
        self.assertIn(old, self.files['robot.py'])
        self.write('robot.py', self.files['robot.py'].replace(old, new))
        with self.running(self.node('liver', **parameters)) as end:
            return self.shell('python3 robot.py')[1] + end()

    def test_what_is_said_of_each_mistake_is_what_the_page_says(self):
        move = 'arm.move((at.x, at.y, at.z + 0.01 * min(t, 2.0)))'
        with self.running(self.launch() + ' pick_frame:=tool0') as end:
            follows = self.shell('python3 robot.py')[1] + end()
        self.write('two.py', TWO_NODES)
        with self.running(self.node('liver', **{'tools/pick/follow_frame': 'tool0'})) as end:
            self.good('python3 two.py')
            two = end()
        self.write('disable.py', DISABLES)
        with self.running(self.node('liver')):
            disabled = self.good('python3 disable.py')
        self.said_of({
            'a stream that stopped for more than half a second': lambda: self.script('rate.sleep()', 'surgeon.live(2.0)'),
            'a frame without a transform': lambda: self.script("stream('pick')", "stream('pick', frame='base')"),
            'a pose that is no number': lambda: self.script(move, "arm.move((at.x, at.y, float('nan')))"),
            'stamps of two clocks': lambda: self.script(
                move, 'arm.move((at.x, at.y, at.z)); arm.move((at.x, at.y, at.z), stamp=rospy.Time.now() - rospy.Duration(0.3))'),
            'two nodes that say where one tool is': lambda: two,
            'a tool that was disabled, and then a reset': lambda: disabled,
            'a stream to a tool that follows a frame': lambda: follows,
            'a frame to follow that is not there': lambda: follows,
        })


class TaskPageTest(PageTestCase):

    name = 'own_task.md'

    def test_the_task_is_done_and_reported(self):
        self.check_setup()
        with self.running(self.launch().replace('$PWD/lift.yaml', '$PWD/lift.yaml session_directory:=$PWD/session')):
            said = self.good('python3 lift.py')
        self.assertRegex(said, r'score \d+, passed; wrote .*report.html')
        self.assertTrue(os.path.isfile(os.path.join(self.folder, 'session', 'reports', 'first', 'report.html')))

    def loaded(self, old, new):
        self.assertIn(old, self.files['lift.yaml'])
        self.write('lift.yaml', self.files['lift.yaml'].replace(old, new))
        with self.running(self.node('$PWD/flap.yaml', task='$PWD/lift.yaml')) as end:
            return end()

    def without(self):
        with self.running(self.node('$PWD/flap.yaml')):
            return self.shell('python3 lift.py')[1]

    def test_what_is_said_of_each_mistake_is_what_the_page_says(self):
        self.said_of({
            'a body that the scene lacks': lambda: self.loaded('body: flap', 'body: flop'),
            'a misspelt condition': lambda: self.loaded('stretch_to', 'strech_to'),
            'a metric that is not there': lambda: self.loaded('force_peak', 'force_peek'),
            'a report without a task': self.without,
        })


class RecordingPageTest(PageTestCase):

    name = 'recording.md'

    def recorded(self, command='session.py'):
        with self.running(self.launch()) as end:
            return self.shell('python3 ' + command)[1] + end()

    def test_what_was_recorded_is_replayed_and_shown(self):
        self.check_setup()
        said = self.recorded()
        number = re.search(r'hash \w+', said).group()
        sizes = {name: 1e-6 * os.path.getsize(os.path.join(self.folder, 'home', 'meshless_surgery', name)) for name in ('monday', 'monday.index')}
        print('MB: %s' % sizes)
        start = float(re.search(r'([\d.]+) MB for the\s+scene `liver`', self.page).group(1))
        self.assertAlmostEqual(start, sizes['monday'], delta=0.2 * start)
        self.assertGreater(sizes['monday.index'], 0.0)
        replayed = self.good(self.command('rosrun meshless_surgery replay'))
        self.assertIn(number, replayed)
        with self.running(self.command('roslaunch meshless_surgery review.launch') + ' rviz:=false', until='/review/seek'):
            said = self.good('python3 seek.py')
        self.assertRegex(said, r'\d\.\d+ s: .*cut')
        self.assertRegex(said.splitlines()[-1], r'^shows step 1[0-9][0-9] of \d+')

    def test_what_is_said_of_each_mistake_is_what_the_page_says(self):
        replay = self.command('rosrun meshless_surgery replay').split(' ')
        load = self.files['session.py'].replace("surgeon.save('after_the_cut')", "surgeon.load('tuesday')")
        self.write('no_log.txt', 'nothing')
        self.said_of({
            'a log that is not there': lambda: self.shell(' '.join(replay[:3] + ['tuesday']))[1],
            'a file that is no log': lambda: self.shell(' '.join(replay[:3] + ['no_log.txt']))[1],
            'the name is in use': lambda: self.recorded('-c ""') + self.recorded('-c ""'),
            'a state that is not there': lambda: (self.write('load.py', load), self.recorded('load.py'))[1],
        })


class StationsPageTest(PageTestCase):

    name = 'stations.md'

    def lab(self, **arguments):
        named = ''.join(' %s:=%s' % item for item in arguments.items())
        return self.command('roslaunch meshless_surgery lab.launch') + ' rviz:=false' + named

    def test_a_script_works_on_both(self):
        self.check_setup()
        with self.running(self.lab(), until='/station2/deformer/load'):
            said = self.good('python3 two.py')
        self.assertRegex(said, r'/station1/deformer \w+\n/station2/deformer \w+\n')

    def beside(self):
        self.write('two.py', self.files['two.py'].replace('/station1', '').replace('timeout=20.0', 'timeout=0.5'))
        return self.shell('python3 two.py')[1]

    def test_what_is_said_of_each_mistake_is_what_the_page_says(self):
        self.said_of({'a client without the namespace': self.beside,
                      'a scene that is not there': lambda: self.shell('timeout -s INT 30 ' + self.lab(scene1='livr'))[1]})


if __name__ == '__main__':
    run('pages', ScenePageTest, ClampPageTest, PythonPageTest, RobotPageTest, TaskPageTest, RecordingPageTest, StationsPageTest)
