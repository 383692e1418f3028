#!/usr/bin/env python3
"""The Debian package, unpacked in a folder and used from there: what the docs use is in it, what tests alone use is not, and it runs.
Argument: the folder. scripts/package_debian makes it; nothing of the package needs to be installed."""
import ctypes
import glob
import os
import shutil
import subprocess
import sys
import tempfile
import unittest
import xml.etree.ElementTree

CHECKOUT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
ROOT = os.path.realpath(sys.argv.pop(1)) if __name__ == '__main__' else ''
LONG = 300.0  # [s] ends what would never end
PORT = 11397
SESSION = '''
import os
import rospy
import meshless_surgery
from meshless_surgery import Surgeon
rospy.init_node('packaged')
surgeon = Surgeon('/deformer', 120.0)
surgeon.stepped()
held = surgeon.pick([-0.06, -0.08, 0.03], max_distance=0.1)
surgeon.step(10)
pieces = surgeon.cut([0.0, 0.0, 0.3], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0])
surgeon.step(10)
print('module', os.path.dirname(meshless_surgery.__file__))
print('held', held.body, held.pick_id)
print('pieces', *pieces.new_bodies)
'''


def share(*parts):
    return os.path.join(ROOT, 'usr', 'share', 'meshless_surgery', *parts)


def under(folder, *patterns):
    """Files of the checkout, relative to it."""
    found = [path for pattern in patterns for path in glob.glob(os.path.join(CHECKOUT, folder, pattern), recursive=True)]
    return sorted(os.path.relpath(path, CHECKOUT) for path in found if os.path.isfile(path))


class PackagedTest(unittest.TestCase):

    maxDiff = None

    def setUp(self):
        self.folder = tempfile.mkdtemp()
        self.addCleanup(shutil.rmtree, self.folder)

    def process(self, command, **more):
        environment = {name: os.environ[name] for name in ('PATH', 'HOME', 'LANG', 'TMPDIR', 'CCACHE_DIR') if name in os.environ}
        environment.update(ROS_HOME=os.path.join(self.folder, 'ros'), ROS_IP='127.0.0.1', ROS_MASTER_URI='http://127.0.0.1:%d' % PORT,
                           CMAKE_PREFIX_PATH=ROOT + '/usr', ROS_PACKAGE_PATH=ROOT + '/usr/share',
                           PYTHONPATH=ROOT + '/usr/lib/python3/dist-packages', PYTHONDONTWRITEBYTECODE='1', **more)
        return subprocess.run(command, cwd=self.folder, env=environment, timeout=LONG, stdout=subprocess.PIPE,
                              stderr=subprocess.STDOUT, universal_newlines=True)

    def done(self, command, **more):
        done = self.process(command, **more)
        self.assertEqual(0, done.returncode, '%s\n%s' % (command, done.stdout))
        return done.stdout

    def test_what_the_docs_use_is_in_it(self):
        wanted = [share(path) for folder in ('config', 'launch', 'media', 'icons', 'msg', 'srv', 'action', 'bench/measured', 'bench/truth/data')
                  for path in under(folder, '**/*')]
        wanted += [share('package.xml'), share('rviz_plugin.xml')]
        usr = os.path.join(ROOT, 'usr')
        wanted += [os.path.join(usr, 'lib/python3/dist-packages', os.path.relpath(path, 'python')) for path in under('python', '**/*.py')]
        wanted += [os.path.join(usr, 'lib/meshless_surgery', os.path.basename(path)) for path in under('scripts', '*.py')]
        wanted += [os.path.join(usr, path) for path in under('include', '**/*.h')]
        wanted += [os.path.join(usr, 'share/doc/meshless-surgery', path)
                   for path in under('examples', '**/*') + under('docs', '**/*.md', 'images/*') + ['README.md', 'CHANGELOG.rst', 'CONTRIBUTING.md']]
        for folder, ending in (('msg', '.msg'), ('srv', '.srv')):
            for path in under(folder, '*' + ending):
                name = os.path.basename(path)[:-len(ending)]
                wanted += [os.path.join(usr, 'include/meshless_surgery', name + '.h'),
                           os.path.join(usr, 'lib/python3/dist-packages/meshless_surgery', folder, '_%s.py' % name)]
        self.assertGreater(len(wanted), 300)
        self.assertEqual([], [path for path in wanted if not os.path.isfile(path)])

    def test_what_tests_alone_use_is_not(self):
        programs = os.listdir(os.path.join(ROOT, 'usr/lib/meshless_surgery'))
        self.assertEqual([], [name for name in programs if name.endswith(('_test.py', '_tests', '.a')) or name.startswith('bench_')])
        self.assertFalse(os.path.exists(os.path.join(ROOT, 'usr/setup.bash')))

    def test_programs_run(self):
        programs = os.path.join(ROOT, 'usr/lib/meshless_surgery')
        nodes = {'deformer_node', 'review_node', 'device.py'}  # have no --help, and begin at once
        named = sorted(name for name in os.listdir(programs) if os.access(os.path.join(programs, name), os.X_OK) and name not in nodes)
        for name in ('accuracy', 'drive', 'make_meshes', 'measured', 'replay', 'report', 'learning_curves.py', 'play_liver.py'):
            self.assertIn(name, named)
        for name in named:
            self.assertIn('-h', self.done(['rosrun', 'meshless_surgery', name, '--help']), name)
        self.done(['rosrun', 'meshless_surgery', 'make_meshes', '--out', self.folder])
        self.assertIn('liver.obj', os.listdir(self.folder))
        self.assertLess(self.process(['rosrun', 'meshless_surgery', 'drive', '--seed', '1', '--material', 'elastic_liver', '--organs', '1',
                                      '--triangles', '2000', '--no-cuts', '--no-hands']).returncode, 2)

    def test_a_scene_is_launched_picked_and_cut(self):
        launch = 'roslaunch -p %d meshless_surgery training.launch rviz:=false scene:=liver command_log:=session session_directory:=%s' % (PORT, self.folder)
        script = launch + ' >said 2>&1 & /usr/bin/python3 -c "$SESSION"; status=$?; kill -INT %1; wait; cat said; exit $status'
        said = self.done(['bash', '-c', 'set -m; ' + script], SESSION=SESSION)
        self.assertIn('module %s/usr/lib/python3/dist-packages/meshless_surgery\n' % ROOT, said)
        self.assertIn('held liver 1\n', said)
        self.assertIn('pieces liver.1 liver.2\n', said)
        # What the node has written, the programs read.
        self.assertIn('steps', self.done(['rosrun', 'meshless_surgery', 'replay', os.path.join(self.folder, 'session')]))

    def test_rviz_finds_the_plugins(self):
        described = os.path.join(ROOT, 'usr/share/meshless_surgery/rviz_plugin.xml')
        self.assertIn(described, self.done(['rospack', 'plugins', '--attrib=plugin', 'rviz']))
        name = xml.etree.ElementTree.parse(described).getroot().get('path')
        library, = glob.glob(ROOT + '/usr/lib/*/ros/%s.so' % name)  # where Debian's pluginlib looks, after the installation
        ctypes.CDLL(library, os.RTLD_NOW)  # all that it needs is there

    def test_an_outside_project_finds_the_rooms(self):
        example = os.path.join(ROOT, 'usr/share/doc/meshless-surgery/examples/rooms')
        self.done(['cmake', '-S', example, '-B', 'rooms'])
        self.done(['cmake', '--build', 'rooms'])
        self.assertIn('box.1', self.done([os.path.join(self.folder, 'rooms', 'cut_a_box')]))

    def test_two_stations_need_no_workspace(self):
        said = self.process(['env', '-u', 'CMAKE_PREFIX_PATH', 'roslaunch', '--dump-params', 'meshless_surgery', 'lab.launch', 'rviz:=false'])
        self.assertIn('/station2/deformer/scene: incision', said.stdout)


if __name__ == '__main__':
    unittest.main()
