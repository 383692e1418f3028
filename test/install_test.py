#!/usr/bin/env python3
"""The install space of the build: nothing in it leads back to the build, all of it runs from there, and an outside project builds
against it. Argument: the folder of the build, in which all targets are built."""
import glob
import os
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

CHECKOUT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
BUILD = os.path.realpath(sys.argv.pop(1)) if __name__ == '__main__' else ''
LONG = 300.0  # [s] ends what would never end
SESSION = '''
import rospy
from meshless_surgery import Surgeon
rospy.init_node('installed')
surgeon = Surgeon('/deformer', 120.0)
surgeon.stepped()
surgeon.step(10)
print('bodies', [body.name for body in surgeon.info().bodies])
'''


def cached(name):
    with open(os.path.join(BUILD, 'CMakeCache.txt')) as file:
        return re.search(r'^%s:\w+=(.*)$' % name, file.read(), re.MULTILINE).group(1)


class InstallTest(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        cls.space = cached('CMAKE_INSTALL_PREFIX')
        cls.folder = tempfile.mkdtemp()
        shutil.rmtree(cls.space, ignore_errors=True)
        cls.done(['cmake', '-P', os.path.join(BUILD, 'cmake_install.cmake')])

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(cls.folder)

    @classmethod
    def process(cls, command, **more):
        keep = ('PATH', 'HOME', 'LANG', 'TMPDIR', 'CCACHE_DIR')
        environment = {name: os.environ[name] for name in keep if name in os.environ}
        environment.update(ROS_HOME=os.path.join(cls.folder, 'ros'), ROS_IP='127.0.0.1', **more)
        return subprocess.run(command, cwd=cls.folder, env=environment, timeout=LONG, stdout=subprocess.PIPE,
                              stderr=subprocess.STDOUT, universal_newlines=True)

    @classmethod
    def done(cls, command, **more):
        done = cls.process(command, **more)
        if done.returncode != 0:
            raise AssertionError('%s: %d\n%s' % (command, done.returncode, done.stdout))
        return done.stdout

    def in_space(self, script):
        return self.done(['bash', '-c', 'source %s/setup.bash && %s' % (self.space, script)])

    def test_nothing_names_the_build(self):
        devel = cached('CATKIN_DEVEL_PREFIX')
        # catkin compiles the messages' Python files where it made them; a compiled file names its source for tracebacks.
        installed = [path for path in glob.glob(self.space + '/**', recursive=True)
                     if os.path.isfile(path) and not path.endswith('.pyc')]
        self.assertGreater(len(installed), 200)
        for path in installed:
            self.assertFalse(os.path.islink(path) and not os.path.realpath(path).startswith(os.path.realpath(self.space)), path)
            with open(path, 'rb') as file:
                content = file.read()
            for folder in (BUILD, devel):
                self.assertFalse(folder.encode() + b'/' in content, '%s names %s' % (path, folder))
            # Where a message in the log comes from is named by its source file, and nothing else is.
            for named in re.findall(re.escape(CHECKOUT.encode()) + rb'/[\w./-]*', content):
                self.assertRegex(named, rb'\.(cpp|h)$', path)

    def test_programs_run(self):
        self.in_space('mkdir meshes && rosrun meshless_surgery make_meshes --out meshes')
        self.assertIn('liver.obj', os.listdir(os.path.join(self.folder, 'meshes')))
        self.in_space('rosrun meshless_surgery drive --seed 1 --material elastic_liver --organs 1 --no-cuts --no-hands --budget 60; (( $? < 2 ))')
        self.in_space('rosrun meshless_surgery replay --help')
        self.done([os.path.join(self.space, 'lib', 'meshless_surgery', 'replay'), '--help'])  # finds its libraries by itself
        self.in_space('rosrun meshless_surgery accuracy --help && test -d %s/share/meshless_surgery/bench/truth/data' % self.space)

    def test_the_node_runs_and_python_finds_it(self):
        launch = 'export ROS_MASTER_URI=http://127.0.0.1:11398; '
        launch += 'roslaunch -p 11398 meshless_surgery training.launch rviz:=false scene:=block >log 2>&1 & '
        said = self.in_space(launch + "/usr/bin/python3 -c \"%s\"; status=$?; kill -INT %%1; wait; exit $status" % SESSION)
        self.assertIn("bodies ['block']", said)
        where = self.in_space('/usr/bin/python3 -c "import meshless_surgery.testing as m; print(m.__file__)"').strip()
        self.assertTrue(where.startswith(self.space), where)

    def test_an_outside_project_finds_the_rooms(self):
        self.done(['cmake', '-S', os.path.join(CHECKOUT, 'examples', 'rooms'), '-B', 'rooms', '-DCMAKE_PREFIX_PATH=' + self.space])
        self.done(['cmake', '--build', 'rooms'])
        said = self.done([os.path.join(self.folder, 'rooms', 'cut_a_box')])
        volumes = [float(text) for text in re.findall(r'box\.\d: ([\d.]+) ml', said)]
        self.assertEqual(2, len(volumes), said)
        self.assertAlmostEqual(1000.0, sum(volumes), delta=50.0)


class DisplayTest(unittest.TestCase):

    def test_messages_and_plugin_build_without_the_rest(self):
        folder = tempfile.mkdtemp()
        self.addCleanup(shutil.rmtree, folder)
        hidden = ['-DCMAKE_DISABLE_FIND_PACKAGE_%s=ON' % name for name in ('CGAL', 'PCL', 'TBB', 'CLI11', 'nanoflann', 'cereal')]
        launcher = ['-DCMAKE_CXX_COMPILER_LAUNCHER=ccache'] if shutil.which('ccache') else []
        os.makedirs(os.path.join(folder, 'devel/lib/python3/dist-packages'))
        InstallTest.folder = folder
        InstallTest.done(['cmake', '-G', 'Ninja', '-S', CHECKOUT, '-B', 'build', '-DMESHLESS_SURGERY_PARTS=display',
                         '-DCMAKE_INSTALL_PREFIX=' + folder + '/space', '-DCATKIN_DEVEL_PREFIX=' + folder + '/devel',
                         '-DPYTHON_EXECUTABLE=/usr/bin/python3', '-DPython3_EXECUTABLE=/usr/bin/python3'] + hidden + launcher)
        build = subprocess.run(['cmake', '--build', folder + '/build', '--target', 'install'], stdout=subprocess.PIPE,
                               stderr=subprocess.STDOUT, universal_newlines=True)
        self.assertEqual(0, build.returncode, build.stdout[-4000:])
        for name in ('lib/libmeshless_surgery_rviz.so', 'share/meshless_surgery/rviz_plugin.xml', 'share/meshless_surgery/media/tissue.frag', 'include/meshless_surgery/Pick.h',
                     'lib/python3/dist-packages/meshless_surgery/surgeon.py', 'share/meshless_surgery/config/rviz/liver.rviz'):
            self.assertTrue(os.path.exists(os.path.join(folder, 'space', name)), name)
        needed = subprocess.check_output(['objdump', '-p', folder + '/space/lib/libmeshless_surgery_rviz.so'], universal_newlines=True)
        self.assertNotRegex(needed, r'NEEDED.*(pcl|gmp|tbb)')


if __name__ == '__main__':
    unittest.main()
