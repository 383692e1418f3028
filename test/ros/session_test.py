#!/usr/bin/env python3
"""Saving, loading, the autosave and the log of commands: nothing is lost, and what is damaged is refused whole."""
import os
import random
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
import unittest
import xmlrpc.client

import roslib.packages
import rosgraph
import rospy
from geometry_msgs.msg import Point
from shape_msgs.msg import SolidPrimitive

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from deformer_support import ACROSS_X, LONG, Deformer, OwnNode, pose_stamped, run  # noqa: E402

SCENES = os.path.join(os.path.dirname(os.path.abspath(__file__)), 'scenes')
BOXES = os.path.join(SCENES, 'boxes.yaml')
FALLING = os.path.join(SCENES, 'falling.yaml')


def box(size):
    return SolidPrimitive(type=SolidPrimitive.BOX, dimensions=[size, size, size])


def until(holds, what):
    """Waits for it; a bound for what should have happened long before."""
    end = time.monotonic() + LONG
    while not holds():
        if time.monotonic() > end:
            raise AssertionError(what() if callable(what) else what)
        time.sleep(0.05)


class NamedNode(OwnNode):
    """A node of that name, of which there may be others: told apart from them by its process and its output."""

    def __init__(self, name, prefix=(), master=None, **parameters):  # pylint: disable=super-init-not-called
        self.name = name
        namespace, own = name.rsplit('/', 1)
        binary = roslib.packages.find_node('meshless_surgery', 'deformer_node')[0]
        environment = dict(os.environ, ROS_NAMESPACE=namespace or '/', **({'ROS_MASTER_URI': master} if master else {}))
        self.log = tempfile.TemporaryFile(mode='w+', errors='replace')
        self.process = subprocess.Popen(
            list(prefix) + [binary, '__name:=' + own] + ['_%s:=%s' % item for item in parameters.items()],
            stdout=self.log, stderr=self.log, env=environment)
        self.deformer = Deformer(name)

    def service(self):
        """Where the master says that the service is that a node offers last."""
        try:
            return rosgraph.Master('/test').lookupService(self.name + '/spawn')
        except rosgraph.MasterError:
            return None

    def wait_instead_of(self, service):
        until(lambda: self.service() not in (None, service) or self.process.poll() is not None, self.output)
        return self.wait()

    def says(self, text):
        until(lambda: text in self.output() or self.process.poll() is not None,
              lambda: 'no "%s" in: %s' % (text, self.output()))
        if text not in self.output():
            raise AssertionError('the node has ended without "%s": %s' % (text, self.output()))
        return self


class SessionCase(unittest.TestCase):

    def setUp(self):
        self.folder = tempfile.mkdtemp(prefix='meshless_session_')

    def tearDown(self):
        shutil.rmtree(self.folder, ignore_errors=True)

    def node(self, prefix=(), **parameters):
        settings = dict(scene=BOXES, paused=True, session_directory=self.folder)
        settings.update(parameters)
        return OwnNode(prefix, **settings)

    def path(self, name):
        return os.path.join(self.folder, name)

    def read(self, name):
        with open(self.path(name), 'rb') as file:
            return file.read()

    def write(self, name, data):
        with open(self.path(name), 'wb') as file:
            file.write(data)

    def named(self, name, **parameters):
        # So long a period leaves the one autosave that is made when time stands still.
        settings = dict(scene=BOXES, paused='true', session_directory=self.folder, autosave_period=10.0)
        settings.update(parameters)
        node = NamedNode(name, **settings)
        self.addCleanup(node.__exit__)
        return node

    def is_saved(self, name, whole=b'MLSSTATE'):
        """Waits for the file; what it begins with."""
        until(lambda: os.path.exists(self.path(name)), lambda: 'no %s among %s' % (name, os.listdir(self.folder)))
        self.assertEqual(whole, self.read(name)[:len(whole)])

    def work(self, node):
        """Something of everything, that goes on moving afterwards."""
        pick = node.good('pick', point=Point(-0.15, 0.0, 0.1), max_distance=0.1)
        node.good('move_pick', pick_id=pick.pick_id, target=Point(-0.1, 0.03, 0.15))
        node.good('step', steps=10)
        node.good('cut', blades=pose_stamped(0.2, -1.0, 0.1, ACROSS_X), bodies=['right'])
        node.good('spawn', name='guest', primitive=box(0.06), pose=pose_stamped(0.0, 0.3, 0.1), scale=1.0)
        node.good('set_material', body='guest', yaml='{alpha: 0.2}')
        node.good('push', enable=True, radius=0.02, pose=pose_stamped(0.0, 0.3, 0.15))
        node.good('push', enable=True, radius=0.02, pose=pose_stamped(0.0, 0.3, 0.05), speed=0.2)
        node.good('step', steps=15)


class SaveTest(SessionCase):

    def test_it_goes_on_as_if_nothing_had_been(self):
        with self.node() as node:
            self.work(node)
            answer = node.good('save', file='one.state')
            self.assertIn('one.state', answer.message)
            saved = node.hash()
            node.good('step', steps=40)
            later = node.hash()
            self.assertNotEqual(saved, later)
            node.good('load', file='one.state')
            self.assertEqual(saved, node.hash())
            node.good('step', steps=40)
            self.assertEqual(later, node.hash())
            self.assertEqual(['one.state'], os.listdir(self.folder))
        # Another process, another scene, more of them at once.
        with self.node(scene=FALLING) as other:
            other.good('load', file='one.state')
            self.assertEqual(saved, other.hash())
            other.good('step', steps=40)
            self.assertEqual(later, other.hash())
            self.assertTrue(other.call('get_body', name='guest').success)
            other.good('reset')
            self.assertTrue(other.call('get_body', name='left').success)
            self.assertFalse(other.call('get_body', name='guest').success)

    def test_names_only(self):
        with self.node() as node:
            before = node.hash()
            for name in ('', '.', '..', '../up', '/etc/passwd', 'a/b', '.hidden', 'a b', 'a\nb', 'x' * 101,
                         'x' * 10000000):
                for service in ('save', 'load'):
                    answer = node.call(service, file=name)
                    self.assertFalse(answer.success, repr(name[:50]))
                    self.assertIn('accepted', answer.message)
                    self.assertLess(len(answer.message), 3000)
            self.assertFalse(node.call('save', file='autosave_x.state').success)
            self.assertEqual([], os.listdir(self.folder))
            self.assertEqual(before, node.hash())

    def test_what_is_damaged_is_refused_whole(self):
        with self.node() as node:
            self.work(node)
            node.good('save', file='good')
            node.good('step', steps=5)
            good = self.read('good')
            before = node.hash()
            self.write('cut_off', good[:len(good) // 2])
            self.write('nothing', b'')
            self.write('longer', good + b'x')
            self.write('foreign', b'solid box\n' * 1000)
            self.write('newer', good[:8] + b'\x07' + good[9:])
            turned = bytearray(good)
            turned[len(good) // 3] ^= 16
            self.write('turned', bytes(turned))
            os.mkfifo(self.path('pipe'))
            os.mkdir(self.path('folder'))
            with tempfile.NamedTemporaryFile() as outside:
                outside.write(good)
                outside.flush()
                os.symlink(outside.name, self.path('link'))
                self.write('sparse', good[:24])
                os.truncate(self.path('sparse'), 500 << 20)
                self.write('endless', good)
                os.truncate(self.path('endless'), 1 << 40)
                for name in ('cut_off', 'nothing', 'longer', 'foreign', 'newer', 'turned', 'pipe', 'folder', 'link',
                             'missing', 'sparse', 'endless'):
                    answer = node.call('load', file=name)
                    self.assertFalse(answer.success, name)
                    self.assertIn(name, answer.message)
                    self.assertEqual(before, node.hash(), name)
            self.assertTrue(node.call('load', file='good').success)

    def test_a_full_disk_keeps_what_was_there(self):
        with self.node() as node:
            node.good('save', file='state')
        old = self.read('state')
        limit = str(len(old) // 2)
        with self.node(prefix=('prlimit', '--fsize=%s:%s' % (limit, limit)), command_log='log') as node:
            before = node.hash()
            answer = node.call('save', file='state')
            self.assertFalse(answer.success)
            self.assertIn('state', answer.message)
            self.assertEqual(before, node.hash())
            self.assertEqual(old, self.read('state'))
            self.assertEqual(['log', 'log.index', 'state'], sorted(os.listdir(self.folder)))
            # The log of commands has ended, and says so; the node has not.
            node.good('step', steps=10)
            end = time.monotonic() + LONG
            while 'log of commands ends here' not in node.output() and time.monotonic() < end:
                time.sleep(0.1)
            self.assertIn('log of commands ends here', node.output())
            node.good('load', file='state')

    def test_a_disk_without_space_keeps_what_was_there(self):
        """A file system of its own with room for one state and a half, where the machine lets us make one."""
        small = ('unshare', '-rm', 'sh', '-c', 'mount -t tmpfs -o size=%dk none "$0" && exec "$@"')
        if subprocess.run(small[:4] + (small[4] % 64, self.folder, 'true'), stderr=subprocess.DEVNULL,
                          check=False).returncode != 0:
            self.skipTest('no mounts in a user namespace')
        with self.node() as node:
            node.good('save', file='state')
        kilobytes = os.path.getsize(self.path('state')) * 3 // 2048
        with self.node(prefix=small[:4] + (small[4] % kilobytes, self.folder)) as node:
            inside = os.path.join('/proc/%d/root' % node.process.pid, self.folder[1:])
            node.good('save', file='state')
            with open(os.path.join(inside, 'state'), 'rb') as file:
                old = file.read()
            node.good('step', steps=20)
            before = node.hash()
            answer = node.call('save', file='other')
            self.assertFalse(answer.success)
            self.assertIn('No space left', answer.message)
            self.assertEqual(before, node.hash())
            self.assertFalse(node.call('save', file='state').success)
            self.assertEqual(['state'], os.listdir(inside))
            with open(os.path.join(inside, 'state'), 'rb') as file:
                self.assertEqual(old, file.read())
            node.good('load', file='state')
            self.assertEqual(0, node.end(signal.SIGTERM), node.output())

    def test_killed_while_saving_it_leaves_a_whole_file(self):
        """kill -9 as soon as a write has begun: the file is that of one save or another, and no half of one stays."""
        whole = set()
        with self.node() as node:
            for _ in range(2):
                node.good('step', steps=1)
                whole.add(node.hash())
        for _ in range(4):
            with self.node() as node:
                node.good('step', steps=1)
                node.good('save', file='state')
                node.good('step', steps=1)
                node.good('hash')
                stop = threading.Event()

                def save(stop=stop, node=node):
                    while not stop.is_set():
                        try:
                            node.call('save', file='state')
                        except (rospy.ServiceException, rospy.ROSException, OSError):
                            return

                thread = threading.Thread(target=save)
                thread.daemon = True
                thread.start()
                end = time.monotonic() + LONG
                while len(os.listdir(self.folder)) < 2 and time.monotonic() < end:
                    pass
                node.end(signal.SIGKILL)
                stop.set()
                thread.join(LONG)
            with self.node() as node:
                self.assertEqual(['state'], os.listdir(self.folder))
                node.good('load', file='state')
                self.assertIn(node.hash(), whole)

    def test_waiting_calls_are_answered(self):
        with self.node(paused=False) as node:
            node.good('save', file='state')
            answers = []
            thread = threading.Thread(target=lambda: answers.append(
                node.call('cut', blades=pose_stamped(-1.0, 0.0, 0.1), close_time=50.0)))
            thread.start()
            time.sleep(0.5)
            node.good('load', file='state')
            thread.join(LONG)
            self.assertFalse(answers[0].success)
            self.assertIn('loaded', answers[0].message)


class LogTest(SessionCase):

    def replay(self, name, *arguments):
        binary = roslib.packages.find_node('meshless_surgery', 'replay')[0]
        return subprocess.run([binary, self.path(name)] + list(arguments), stdout=subprocess.PIPE,
                              stderr=subprocess.STDOUT, universal_newlines=True, timeout=LONG, check=False)

    def test_a_session_is_replayed_to_the_same_hash(self):
        with self.node(command_log='log', paused=False) as node:
            self.work(node)
            time.sleep(0.5)
            node.good('pause', data=True)
            node.good('save', file='state')
            node.good('reset')
            self.work(node)
            node.good('load', file='state')
            self.work_again(node)
            last = node.good('hash')
            self.assertEqual(0, node.end(signal.SIGTERM))
        for threads in ('1', '2'):
            result = self.replay('log', '--threads', threads)
            self.assertEqual(0, result.returncode, result.stdout)
            self.assertIn('step %d hash %016x' % (last.step, last.hash), result.stdout)
            self.assertNotIn('breaks off', result.stdout)

    def work_again(self, node):
        node.good('step', steps=20)
        node.good('clear_picks')
        node.good('remove', name='guest')
        node.good('step', steps=20)

    def test_a_kill_loses_the_last_second_at_most(self):
        with self.node(command_log='log') as node:
            self.work(node)
            last = node.good('hash')
            time.sleep(1.0)
            node.end(signal.SIGKILL)
        result = self.replay('log')
        self.assertEqual(0, result.returncode, result.stdout)
        self.assertIn('breaks off', result.stdout)
        # A log knows of steps by what comes after them: up to the last command it is the same.
        with self.node(command_log='log') as node:
            self.work(node)
            self.assertEqual(last.hash, node.hash())
            node.end(signal.SIGINT)
        second = self.replay('log.2')  # the first one is still there
        self.assertEqual(0, second.returncode, second.stdout)
        self.assertIn('hash %016x' % last.hash, second.stdout)

    def test_what_is_no_log(self):
        self.write('log', b'nothing of that kind')
        self.assertEqual(2, self.replay('log').returncode)

    def test_names_only(self):
        for name in ('../log', 'autosave_own_deformer.state', 'autosave_x'):
            node = self.node(command_log=name, autosave_period=0.1)
            self.addCleanup(node.__exit__)
            self.assertNotEqual(0, node.process.wait(LONG))
            self.assertIn('command_log', node.output())
            self.assertIn(name, node.output())
            self.assertIn('accepted', node.output())
        self.assertEqual([], os.listdir(self.folder))

    def test_a_state_is_not_saved_over_a_log(self):
        for name in ('log', 'log.2'):
            with self.node(command_log='log') as node:
                node.good('step', steps=3)
                self.assertFalse(node.call('save', file=name).success)
                self.assertEqual(0, node.end(signal.SIGTERM))
        before = self.read('log')
        with self.node(command_log='log') as node:
            for name in ('log', 'log.2', 'log.3'):
                answer = node.call('save', file=name)
                self.assertFalse(answer.success)
                self.assertIn(name, answer.message)
                self.assertIn('accepted', answer.message)
            node.good('save', file='state')
        self.assertEqual(before, self.read('log'))
        for name in ('log', 'log.2'):
            self.assertEqual(0, self.replay(name).returncode)

    def test_a_folder_that_cannot_be_is_said_at_once(self):
        self.write('file', b'')
        for folder in ('/proc/x', self.path('file'), self.path('file/below')):
            for asked in (dict(autosave_period=0.5), dict(command_log='log')):
                node = self.node(session_directory=folder, **asked)
                self.addCleanup(node.__exit__)
                self.assertNotEqual(0, node.process.wait(LONG))
                self.assertIn(folder, node.output())
                self.assertIn(list(asked)[0], node.output())
        with self.node(session_directory='/proc/x') as node:  # nobody needs it
            self.assertIn('/proc/x', node.call('save', file='state').message)


class SignalTest(SessionCase):

    def test_it_ends_in_good_order_whatever_it_does(self):
        """SIGTERM and SIGINT while it steps, cuts, saves and loads: exit code 0, and every file is whole."""
        rng = random.Random(11)
        sizes = set()
        for turn in range(6):
            number = (signal.SIGTERM, signal.SIGINT)[turn % 2]
            with self.node(paused=False, autosave_period=0.05, command_log='log') as node:
                node.good('save', file='first')
                stop = threading.Event()

                def ask(service, stop=stop, node=node, **fields):
                    while not stop.is_set():
                        try:
                            node.call(service, **fields)
                        except (rospy.ServiceException, rospy.ROSException, OSError):
                            return

                threads = [threading.Thread(target=ask, args=('save',), kwargs=dict(file='busy')),
                           threading.Thread(target=ask, args=('load',), kwargs=dict(file='first')),
                           threading.Thread(target=ask, args=('cut',),
                                            kwargs=dict(blades=pose_stamped(-1.0, 0.0, 0.1))),
                           threading.Thread(target=ask, args=('reset',))]
                for thread in threads:
                    thread.daemon = True
                    thread.start()
                time.sleep(rng.uniform(0.3, 1.0))
                code = node.end(number)
                stop.set()
                self.assertEqual(0, code, node.output())
            self.assertEqual([], [name for name in os.listdir(self.folder) if name.endswith('.part')])
            self.assertEqual([], [name for name in os.listdir(self.folder) if name.startswith('autosave')])
            if os.path.exists(self.path('busy')):
                sizes.add(len(self.read('busy')))
                with self.node() as node:
                    node.good('load', file='busy')
                    node.good('step', steps=2)
            os.remove(self.path('log'))
        self.assertGreater(len(sizes), 0)


class AutosaveTest(SessionCase):

    def test_what_failed_is_tried_again_while_time_stands_still(self):
        # What the node says has to fit below the limit too.
        node = self.named('/limited', prefix=('prlimit', '--fsize=5000:unlimited'), autosave_period=0.5).wait()
        node.good('step', steps=50)
        node.says('the autosave failed')
        time.sleep(3.0)  # several more
        self.assertEqual(1, node.output().count('the autosave failed'))
        self.assertFalse(os.path.exists(self.path('autosave_limited.state')))
        subprocess.check_call(['prlimit', '--pid', str(node.process.pid), '--fsize=unlimited'])
        self.is_saved('autosave_limited.state')
        node.says('written again')
        node.end(signal.SIGKILL)
        self.assertEqual(50, self.named('/limited').wait().good('hash').step)

    def test_names_do_not_collide(self):
        names = {'/a_b': 10, '/a/b': 20, '/' + 'long_' * 20 + 'a': 30, '/' + 'long_' * 20 + 'b': 40}
        nodes = [self.named(name).wait() for name in names]
        for node in nodes:
            node.good('step', steps=names[node.name])
        until(lambda: len([name for name in os.listdir(self.folder) if name.startswith('autosave_')]) == len(nodes),
              lambda: str(os.listdir(self.folder)))
        self.assertEqual(0, nodes.pop().end(signal.SIGTERM))
        for node in nodes:
            node.end(signal.SIGKILL)
        for name in list(names)[:-1]:
            node = self.named(name).wait()
            self.assertEqual(names[name], node.good('hash').step)
            self.assertEqual(0, node.end(signal.SIGTERM))
        self.assertEqual([], os.listdir(self.folder))

    def test_the_second_of_a_name_waits_for_the_end_of_the_first(self):
        """The master ends the first, which puts its things in order: not those of the second."""
        first = self.named('/twice').wait()
        first.good('step', steps=216)
        self.is_saved('autosave_twice.state')
        service = first.service()
        first.process.send_signal(signal.SIGSTOP)  # or it may have ended before the second looks
        second = self.named('/twice').says('waiting for its end')
        first.process.send_signal(signal.SIGCONT)
        self.assertEqual(0, first.process.wait(LONG))
        second.wait_instead_of(service)
        self.assertEqual(0, second.good('hash').step)
        self.assertNotIn('this node\'s autosave is', second.output())
        second.good('step', steps=7)
        self.is_saved('autosave_twice.state')
        last = second.good('hash')
        second.end(signal.SIGKILL)
        third = self.named('/twice').wait()
        self.assertIn('took up the session', third.output())
        self.assertEqual(last.hash, third.good('hash').hash)
        self.assertEqual(0, third.end(signal.SIGTERM))
        self.assertEqual([], os.listdir(self.folder))

    def test_a_first_that_does_not_end_keeps_its_own(self):
        first = self.named('/twice').wait()
        first.good('step', steps=216)
        self.is_saved('autosave_twice.state')
        whole = self.read('autosave_twice.state')
        service = first.service()
        first.process.send_signal(signal.SIGSTOP)
        second = self.named('/twice').says('this node\'s autosave is autosave_twice.state.2')
        self.assertIn('process %d' % first.process.pid, second.output())
        second.wait_instead_of(service).good('step', steps=7)
        self.is_saved('autosave_twice.state.2')
        self.assertEqual(whole, self.read('autosave_twice.state'))
        first.process.send_signal(signal.SIGCONT)
        self.assertEqual(0, first.end(signal.SIGTERM))
        self.assertEqual(['.autosave_twice.state.2.lock', 'autosave_twice.state.2'], sorted(os.listdir(self.folder)))
        second.end(signal.SIGKILL)
        third = self.named('/twice').wait()
        self.assertEqual(7, third.good('hash').step)

    def test_two_masters_on_one_machine(self):
        """The older one ends by SIGTERM, and leaves alone what the younger one has written."""
        with socket.socket() as free:
            free.bind(('127.0.0.1', 0))
            port = free.getsockname()[1]
        master = subprocess.Popen(['rosmaster', '--core', '-p', str(port)], stdout=subprocess.DEVNULL,
                                  stderr=subprocess.DEVNULL)
        self.addCleanup(master.wait)
        self.addCleanup(master.terminate)
        uri = 'http://127.0.0.1:%d/' % port
        older = self.named('/deformer_of_two').wait()
        older.good('step', steps=5)
        name = 'autosave_deformer_of_two.state'
        self.is_saved(name)
        for start in ('this node\'s autosave is ' + name + '.2', 'took up the session'):
            younger = self.named('/deformer_of_two', master=uri, paused='false', autosave_period=0.1).says(start)
            self.is_saved(name + '.2')
            self.assertFalse(os.path.exists(self.path(name + '.before')))
            if older.process.poll() is None:
                self.assertEqual(5, older.good('hash').step)
                self.assertEqual(0, older.end(signal.SIGTERM))
            self.assertFalse(os.path.exists(self.path(name)))
            self.is_saved(name + '.2')
            younger.end(signal.SIGKILL)

    def test_a_state_that_kills_is_set_aside(self):
        for turn in range(5):
            node = self.named('/dying').wait()
            if turn == 0:
                node.good('step', steps=9)
                self.is_saved('autosave_dying.state')
            self.assertEqual(9 if turn < 4 else 0, node.good('hash').step)
            node.end(signal.SIGKILL)
        self.assertIn('taken up 3 times', node.output())
        with self.node() as other:
            other.good('load', file='autosave_dying.state.before')
            self.assertEqual(9, other.good('hash').step)


class RespawnTest(SessionCase):

    def pid(self, name):
        """The process behind a node, once it answers."""
        end = time.monotonic() + LONG
        while time.monotonic() < end:
            try:
                code, _, pid = xmlrpc.client.ServerProxy(rosgraph.Master('/test').lookupNode(name)).getPid('/test')
                if code == 1:
                    return pid
            except (OSError, rosgraph.MasterError, xmlrpc.client.Error):
                pass
            time.sleep(0.1)
        raise AssertionError('no node ' + name)

    def test_after_a_kill_it_takes_up_from_the_last_autosave(self):
        launch = subprocess.Popen(['roslaunch', 'meshless_surgery', 'training.launch', 'rviz:=false', 'scene:=' + BOXES,
                                   'station:=kept', 'respawn:=true', 'session_directory:=' + self.folder],
                                  stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            node = Deformer('/kept/deformer')
            rospy.wait_for_service('/kept/deformer/spawn', LONG)
            self.assertEqual(0.5, rospy.get_param('/kept/deformer/autosave_period'))
            for turn in range(2):
                answer = node.call('cut', blades=pose_stamped(-1.0, 0.0, 0.1, (0, 0, 0, 1)),
                                   bodies=['left' if turn == 0 else 'right'])
                self.assertTrue(answer.success, answer.message)
                pieces = answer.new_bodies
                self.assertTrue(node.call('step', steps=240).success)
                self.assertTrue(node.call('pause', data=True).success)
                time.sleep(2.0)  # a change while time stands still is saved too
                before = node.call('hash')
                pid = self.pid('/kept/deformer')
                os.kill(pid, signal.SIGKILL)
                end = time.monotonic() + LONG
                while self.pid('/kept/deformer') == pid and time.monotonic() < end:
                    time.sleep(0.1)
                rospy.wait_for_service('/kept/deformer/spawn', LONG)
                self.assertTrue(node.call('pause', data=True).success)
                after = node.call('hash')
                # It runs again since, so that it may be farther; it never begins more than a second before.
                self.assertGreaterEqual(after.sim_time, before.sim_time - 1.0)
                for piece in pieces:
                    self.assertTrue(node.call('get_body', name=piece).success)
                self.assertTrue(node.call('pause', data=False).success)
        finally:
            launch.send_signal(signal.SIGINT)
            launch.wait(LONG)
        self.assertEqual([], [name for name in os.listdir(self.folder) if name.startswith('autosave')])

    def test_killed_at_any_time_it_loses_a_second_at_most(self):
        rng = random.Random(5)
        for turn in range(3):
            node = self.node(paused=False, autosave_period=0.5).wait()
            steps = node.good('step', steps=rng.randint(100, 400))
            time.sleep(rng.uniform(0.0, 0.7))
            before = node.good('hash')
            self.assertGreater(steps.sim_time, 0.5)
            node.end(signal.SIGKILL)
            node.log.close()
            OwnNode.count -= 1  # the same name
            with self.node(paused=True, autosave_period=0.5) as again:
                after = again.good('hash')
                self.assertIn('took up the session from the autosave', again.output())
                self.assertGreaterEqual(after.sim_time, before.sim_time - 1.0)
                self.assertGreater(after.sim_time, 0.0)
                self.assertEqual(0, again.end(signal.SIGTERM))

    def test_an_autosave_of_another_scene_is_set_aside(self):
        node = self.node(paused=True, autosave_period=0.1).wait()
        node.good('step', steps=60)
        time.sleep(1.0)
        node.end(signal.SIGKILL)
        name = 'autosave%s.state' % node.name.replace('/', '_')
        whole = self.read(name)
        node.log.close()
        for scene, left, aside in ((FALLING, whole, '.before'), (BOXES, whole[:1000], '.before.2')):
            self.write(name, left)
            OwnNode.count -= 1
            with self.node(scene=scene, autosave_period=0.1) as again:
                self.assertEqual(0, again.good('hash').step)
                self.assertIn('is not taken up', again.output())
                self.assertEqual(left, self.read(name + aside))
                self.assertEqual(0, again.end(signal.SIGTERM))
        self.assertEqual(whole, self.read(name + '.before'))


if __name__ == '__main__':
    run('session', SaveTest, LogTest, SignalTest, AutosaveTest, RespawnTest)
