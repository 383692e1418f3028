#!/usr/bin/env python3
"""Two hosts: network namespaces with a cable between them. The master and the node are on one, the surgeon on the other, as
docs/stations.md says. Skipped where this process may not make namespaces."""
import os
import signal
import subprocess
import sys
import tempfile
import unittest

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, HERE)
from deformer_support import LONG, run  # noqa: E402

PORT = 11399
NODE_HOST, HAND_HOST = '10.213.77.1', '10.213.77.2'
HAND = '''
import os, threading, traceback
import rospy
from meshless_surgery import Surgeon
def work():
    surgeon = Surgeon('/far/deformer', %r)
    pick = surgeon.pick((-0.15, 0, 0.1), max_distance=0.1)
    stream, done = surgeon.stream('pick'), threading.Event()
    def say():
        while not done.wait(0.01):
            stream.move((-0.15, 0.03, 0.1))
    threading.Thread(target=say, daemon=True).start()
    def target():
        return [p.target for p in surgeon.state().picks if p.pick_id == pick.pick_id][0]
    while abs(target().y - 0.03) > 1e-9:
        pass
    print('moved', pick.body, surgeon.info().step_rate, flush=True)
try:
    rospy.init_node('hand')
    work()
    os._exit(0)
except Exception:
    traceback.print_exc()
    os._exit(1)  # whatever its threads still wait for
'''


def ip(*words, check=True):
    return subprocess.run(('ip',) + words, check=check, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL).returncode


class NetworkTest(unittest.TestCase):

    def setUp(self):
        mark = str(os.getpid())
        self.spaces = ['node' + mark, 'hand' + mark]
        cable = ['c%sa' % mark, 'c%sb' % mark]
        if os.geteuid() != 0 or ip('netns', 'add', self.spaces[0], check=False) != 0:
            self.skipTest('no network namespaces may be made here')
        self.processes = []
        self.addCleanup(self.take_down)
        ip('netns', 'add', self.spaces[1])
        ip('link', 'add', cable[0], 'type', 'veth', 'peer', 'name', cable[1])
        for space, end, address in zip(self.spaces, cable, (NODE_HOST, HAND_HOST)):
            ip('link', 'set', end, 'netns', space)
            ip('-n', space, 'addr', 'add', address + '/24', 'dev', end)
            ip('-n', space, 'link', 'set', end, 'up')
            ip('-n', space, 'link', 'set', 'lo', 'up')
        self.home = tempfile.TemporaryDirectory()
        self.addCleanup(self.home.cleanup)

    def take_down(self):
        for process in reversed(self.processes):
            if process.poll() is None:
                process.send_signal(signal.SIGINT)
                process.wait(LONG)
        for space in self.spaces:
            ip('netns', 'del', space, check=False)

    def start(self, space, address, command, **options):
        environment = dict(os.environ, ROS_MASTER_URI='http://%s:%d' % (NODE_HOST, PORT), ROS_IP=address,
                           ROS_HOME=self.home.name)
        environment.pop('ROS_HOSTNAME', None)
        process = subprocess.Popen(['ip', 'netns', 'exec', space] + command, env=environment, universal_newlines=True,
                                   stdout=subprocess.PIPE, stderr=subprocess.STDOUT, **options)
        self.processes.append(process)
        return process

    def test_a_hand_on_one_host_moves_tissue_on_the_other(self):
        scene = os.path.join(HERE, 'scenes', 'boxes.yaml')
        self.start(self.spaces[0], NODE_HOST, ['roslaunch', '-p', str(PORT), 'meshless_surgery', 'training.launch',
                                               'station:=far', 'rviz:=false', 'scene:=' + scene])
        hand = self.start(self.spaces[1], HAND_HOST, ['/usr/bin/python3', '-c', HAND % LONG])
        output, _ = hand.communicate(timeout=2 * LONG)
        self.assertEqual(0, hand.returncode, output)
        self.assertIn('moved left 120.0', output)


if __name__ == '__main__':
    run('network', NetworkTest)
