"""A page of docs as its reader finds it: its files in a folder of their own, its commands, and its table of mistakes."""
import contextlib
import os
import re
import shutil
import signal
import subprocess
import tempfile
import unittest

import roslib.packages
import rospy

from deformer_support import LONG

PACKAGE = os.path.realpath(os.path.join(os.path.dirname(os.path.abspath(__file__)), '..', '..'))
NODE = roslib.packages.find_node('meshless_surgery', 'deformer_node')[0]


def words(text):
    return ' '.join(text.split())


class PageTestCase(unittest.TestCase):
    """`name` is that of the page in docs/."""

    name = ''

    @classmethod
    def setUpClass(cls):
        if not cls.name:
            raise unittest.SkipTest('of pages')
        with open(os.path.join(PACKAGE, 'docs', cls.name)) as file:
            cls.page = file.read()
        # A block is the file whose name stands first in the paragraph before it.
        cls.files = {}
        for before, block in re.findall(r'(.*?)^```(?:python|yaml)\n(.*?)^```', cls.page, re.DOTALL | re.MULTILINE):
            paragraph = before.strip().split('\n\n')[-1]
            cls.files[re.findall(r'([a-z_]+\.(?:py|yaml))`', paragraph)[0]] = block
        cls.commands = [line for block in re.findall(r'^```bash\n(.*?)^```', cls.page, re.DOTALL | re.MULTILINE)
                        for line in block.strip().splitlines()]
        wrong = cls.page.split('## What goes wrong')[1]
        cls.rows = re.findall(r'^\| (.*?) \| (.*`.*) \|$', wrong, re.MULTILINE)
        cls.temporary = tempfile.TemporaryDirectory()
        cls.folder = cls.temporary.name

    @classmethod
    def tearDownClass(cls):
        if cls.name:
            cls.temporary.cleanup()

    def setUp(self):
        shutil.rmtree(os.path.join(self.folder, 'home'), ignore_errors=True)
        for name, text in self.files.items():
            self.write(name, text)

    def write(self, name, content):
        with open(os.path.join(self.folder, name), 'wb') as file:
            file.write(content if isinstance(content, bytes) else content.encode())

    def environment(self):
        return dict(os.environ, ROS_HOME=os.path.join(self.folder, 'home'), PYTHONUNBUFFERED='1')

    def shell(self, command):
        """Of the second terminal: exit code and what it prints."""
        done = subprocess.run(['bash', '-c', command], cwd=self.folder, env=self.environment(), timeout=2 * LONG,
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT, universal_newlines=True)
        return done.returncode, done.stdout

    def good(self, command):
        code, said = self.shell(command)
        self.assertEqual(0, code, said)
        return said

    @contextlib.contextmanager
    def running(self, command, until='/deformer/load'):
        """A command that starts a node; gives a function that ends it and returns what it has said."""
        with contextlib.suppress(KeyError):
            rospy.delete_param('/deformer')  # those of the node before
        with tempfile.TemporaryFile('w+', errors='replace') as log:
            launch = subprocess.Popen(['bash', '-c', 'exec ' + command], cwd=self.folder, env=self.environment(),
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
                        rospy.wait_for_service(until, 0.2)
                        break
                yield end
            finally:
                end()

    def command(self, begin):
        """The page's first command that begins so."""
        return [c for c in self.commands if c.startswith(begin)][0].replace('~/.ros', os.path.join(self.folder, 'home'))

    def launch(self, number=0):
        """The page's so many-th launch of a scene, without a display."""
        launches = [command for command in self.commands if command.startswith('roslaunch meshless_surgery training.launch')]
        return launches[number] + ' rviz:=false'

    def node(self, scene, **parameters):
        """The same without roslaunch: faster, and it ends where the scene is refused."""
        named = ''.join(' _%s:=%s' % item for item in parameters.items())
        return NODE + ' __name:=deformer _scene:=%s%s' % (scene, named)

    def said_of(self, mistakes):
        """Does each of the table's mistakes, functions by the cell of the table: what they return has to have the words of the
        cell beside it."""
        self.assertEqual([row[0] for row in self.rows], list(mistakes))
        for what, says in self.rows:
            with self.subTest(mistake=what):
                self.setUp()
                said = words(mistakes[what]())
                phrases = re.findall('`(.*?)`', says.split(' ... : ')[0])
                self.assertTrue(phrases, what)
                for phrase in phrases:
                    self.assertIn(words(phrase), said)

    def check_setup(self):
        setup = self.command('source ')
        self.assertTrue(os.path.isfile(setup.split()[1].replace('/path/to/meshless_surgery', PACKAGE)))
