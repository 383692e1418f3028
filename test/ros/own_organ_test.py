#!/usr/bin/env python3
"""docs/own_organ.md: its files and commands, as they are printed, on an STL in millimetres; and each of its mistakes."""
import contextlib
import os
import re
import signal
import struct
import subprocess
import sys
import tempfile
import unittest

import roslib.packages
import rospy

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, HERE)
from deformer_support import LONG, run  # noqa: E402

PACKAGE = os.path.realpath(os.path.join(HERE, '..', '..'))
TRIANGLE = struct.Struct('<12fH')


def read_obj(path):
    vertices, faces = [], []
    with open(path) as file:
        for line in file:
            words = line.split()
            if words and words[0] == 'v':
                vertices.append([float(x) for x in words[1:4]])
            elif words and words[0] == 'f':
                faces.append([int(x) - 1 for x in words[1:4]])
    return [[vertices[k] for k in face] for face in faces]


def stl(triangles):
    return b'as 3D Slicer writes it'.ljust(80) + struct.pack('<I', len(triangles)) + b''.join(
        TRIANGLE.pack(0, 0, 0, *[x for corner in triangle for x in corner], 0) for triangle in triangles)


def moved(triangles, scale, by):
    return [[[scale * x + b for x, b in zip(corner, by)] for corner in triangle] for triangle in triangles]


class OwnOrganTest(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        with open(os.path.join(PACKAGE, 'docs', 'own_organ.md')) as file:
            cls.page = file.read()
        cls.files = {name: re.search(r'`%s`.*?```(?:python|yaml)\n(.*?)```' % re.escape(name), cls.page, re.DOTALL).group(1)
                     for name in ('look.yaml', 'look.py', 'organ.yaml', 'cut.py')}
        commands = re.findall(r'```bash\n(.*?)```', cls.page, re.DOTALL)
        cls.setup, cls.launch = commands[0].strip().splitlines()
        cls.look = commands[1].strip()
        cls.cut = re.search(r'run `(python3 cut.py)`', cls.page).group(1)
        cls.rows = re.findall(r'^\| (.*?) \| (`.*) \|$', cls.page.split('## What goes wrong')[1], re.MULTILINE)
        cls.temporary = tempfile.TemporaryDirectory()
        cls.folder = cls.temporary.name
        make_meshes = roslib.packages.find_node('meshless_surgery', 'make_meshes')[0]
        subprocess.run([make_meshes, '--out', cls.folder], check=True, stdout=subprocess.DEVNULL)
        # In the patient's coordinates.
        cls.organ = moved(read_obj(os.path.join(cls.folder, 'liver.obj')), 1000, (-20, 130, -900))

    @classmethod
    def tearDownClass(cls):
        cls.temporary.cleanup()

    def setUp(self):
        self.write('organ.stl', stl(self.organ))
        for name, text in self.files.items():
            self.write(name, text)

    def write(self, name, content):
        with open(os.path.join(self.folder, name), 'wb') as file:
            file.write(content if isinstance(content, bytes) else content.encode())

    def shell(self, command):
        done = subprocess.run(['bash', '-c', command], cwd=self.folder, timeout=LONG, stdout=subprocess.PIPE,
                              stderr=subprocess.STDOUT, universal_newlines=True)
        return done.returncode, done.stdout

    @contextlib.contextmanager
    def running(self, command):
        """A command that starts the node; gives a function that ends it and returns what it has said."""
        with tempfile.TemporaryFile('w+', errors='replace') as log:
            environment = dict(os.environ, ROS_HOME=os.path.join(self.folder, 'home'), PYTHONUNBUFFERED='1')
            launch = subprocess.Popen(['bash', '-c', 'exec ' + command], cwd=self.folder, env=environment,
                                      stdout=log, stderr=subprocess.STDOUT)

            def end():
                if launch.poll() is None:
                    launch.send_signal(signal.SIGINT)
                launch.wait(LONG)
                log.seek(0)
                return log.read()
            try:
                while launch.poll() is None:
                    with contextlib.suppress(rospy.ROSException):
                        rospy.wait_for_service('/deformer/load', 0.2)
                        break
                yield end
            finally:
                end()

    def test_the_page_from_the_file_to_the_pieces(self):
        self.assertTrue(os.path.isfile(self.setup.split()[1].replace('/path/to/meshless_surgery', PACKAGE)))
        with self.running(self.launch + ' rviz:=false'):
            code, output = self.shell(self.look)
        self.assertEqual(0, code, output)
        self.assertIn('size: 0.217 0.154 0.093 m', output)
        self.assertIn(re.search('pose: .*', output).group(), self.files['organ.yaml'])
        with self.running(self.launch.replace('look.yaml', 'organ.yaml') + ' rviz:=false') as end:
            code, output = self.shell(self.cut)
            log = end()
        self.assertEqual(0, code, output)
        self.assertIn('into 2 pieces', output)
        volumes = [float(v) for v in re.findall(r'organ\.\d: (\d+) ml', output)]
        self.assertEqual(2, len(volumes), output)
        self.assertAlmostEqual(1207, sum(volumes), delta=40)
        self.assertGreater(min(volumes), 200)
        self.assertIn('of it is held', log)

    def test_what_is_said_of_each_mistake_is_what_the_page_says(self):
        scene = self.files['organ.yaml']
        no_units = re.sub(r'    (units|pose|fixed|  - box).*\n', '', scene)
        beside = self.files['cut.py'].replace('(0, -1, 0.1), reach=(0, 1, 0), normal=(1, 0, 0)',
                                              '(0, -1, 0.5), reach=(0, 1, 0), normal=(0, 0, 1)')
        far = self.files['cut.py'].replace('0.03), max_distance=0.1', '0.5), max_distance=0.05')
        lobe = moved(self.organ, 1.0, (0, 0, 15))
        half = [t for t in self.organ if max(corner[2] for corner in t) < -890]
        mistakes = {
            '`units: mm` forgotten': {'organ.yaml': no_units},
            '`pose` forgotten': {'organ.yaml': re.sub(r'    pose.*\n', '', scene)},
            'a lobe and its organ in one file': {'organ.stl': stl(self.organ + lobe)},
            'the same with `repair: none`': {'organ.stl': stl(self.organ + lobe), 'organ.yaml': scene.replace('mend', 'none')},
            'half of the surface is missing': {'organ.stl': stl(half)},
            'the file was not copied to its end': {'organ.stl': stl(self.organ)[:100000]},
            'the file is elsewhere': {'organ.yaml': scene.replace('organ.stl', '/etc/hostname')},
            'a kind of file that is not read': {'organ.yaml': scene.replace('organ.stl', 'organ.glb'), 'organ.glb': 'x'},
            'too fine': {'organ.yaml': scene.replace('resolution: medium', 'spacing: 0.0015')},
            'a misspelt material or key': {'organ.yaml': scene.replace('elastic_liver', 'elastc_liver')},
            'a cut or a pick beside the tissue': {'cut.py': beside, 'far.py': far},
        }
        self.assertEqual([row[0] for row in self.rows], list(mistakes))
        node = roslib.packages.find_node('meshless_surgery', 'deformer_node')[0]
        for what, says in self.rows:
            with self.subTest(mistake=what):
                self.setUp()
                for name, content in mistakes[what].items():
                    self.write(name, content)
                with self.running(node + ' __name:=deformer _scene:=$PWD/organ.yaml') as end:
                    said = ''
                    if what.startswith(('half', 'a cut')):
                        for client in ('cut.py', 'far.py') if 'far.py' in mistakes[what] else ('cut.py',):
                            said += self.shell('python3 ' + client)[1]
                    said += end()
                for words in re.findall('`(.*?)`', says.split(' ... : ')[0]):
                    self.assertIn(' '.join(words.split()), ' '.join(said.split()))


if __name__ == '__main__':
    run('own_organ', OwnOrganTest)
