#!/usr/bin/env python3
"""A node that does not die: a crowd of clients, listeners that come, go and stall, tf and /clock that jump.
MESHLESS_SURGERY_CROWD_SECONDS sets how long the crowd calls."""
import math
import os
import random
import shutil
import socket
import subprocess
import sys
import tempfile
import threading
import time
import unittest

import rosgraph
import roslib.packages
import rospy
from geometry_msgs.msg import Point, TransformStamped, Vector3
from meshless_surgery.msg import Event, State, Surfaces
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import PointCloud2
from shape_msgs.msg import SolidPrimitive
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import MarkerArray

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from deformer_support import LONG, TYPES, OwnNode, Recorder, header, pose_stamped, run  # noqa: E402

SCENES = os.path.join(os.path.dirname(os.path.abspath(__file__)), 'scenes')
CROWD = 50
SECONDS = float(os.environ.get('MESHLESS_SURGERY_CROWD_SECONDS') or 10.0)
SLOWEST = 60.0  # [s] of a call; the machine may be loaded


class RobustCase(unittest.TestCase):

    def setUp(self):
        self.folder = tempfile.mkdtemp(prefix='meshless_robust_')

    def tearDown(self):
        shutil.rmtree(self.folder, ignore_errors=True)

    def node(self, **parameters):
        settings = dict(scene=os.path.join(SCENES, 'fuzz.yaml'), session_directory=self.folder)
        settings.update(parameters)
        return OwnNode(**settings)

    def lives(self, node):
        """It answers, steps, and its tissue is finite, as it is and after a reset."""
        node.good('pause', data=True)
        before = node.good('hash').step
        node.good('step', steps=5)
        self.assertEqual(before + 5, node.good('hash').step)
        states = Recorder(node.name + '/state', State)
        for body in states.next(lambda state: state.step == before + 5).bodies:
            at = body.centre_of_mass
            self.assertTrue(all(math.isfinite(v) for v in (body.kinetic_energy, at.x, at.y, at.z)), body)
            shape = node.good('get_body', name=body.name)
            self.assertTrue(math.isfinite(shape.volume) and math.isfinite(shape.area), body)
        states.close()
        node.good('reset')
        node.good('step', steps=20)
        for name in ('left', 'right', 'middle'):
            body = node.good('get_body', name=name)
            self.assertTrue(math.isfinite(body.volume) and body.volume > 0.0)


class CrowdTest(RobustCase):

    def test_many_clients_at_once(self):
        with self.node(autosave_period=0.2, command_log='log') as node:
            node.good('save', file='start')
            faults, counts, slowest = [], [0] * CROWD, [(0.0, '', {}, '')] * CROWD
            until = time.monotonic() + SECONDS

            def client(number):
                rng = random.Random(number)
                proxies = {}

                def call(service, **fields):
                    proxy = proxies.setdefault(
                        service, rospy.ServiceProxy(node.name + '/' + service, TYPES[service], persistent=True))
                    began = time.monotonic()
                    answer = proxy(**fields)
                    slowest[number] = max(slowest[number], (time.monotonic() - began, service, fields, answer.message),
                                          key=lambda slow: slow[0])
                    counts[number] += 1
                    if not answer.message:
                        faults.append('~%s said nothing' % service)
                    return answer

                try:
                    while time.monotonic() < until:
                        kind = rng.randrange(18)
                        at = Point(rng.uniform(-0.25, 0.25), rng.uniform(-0.05, 0.05), rng.uniform(0.0, 0.1))
                        if kind < 4:
                            pick = call('pick', point=at, max_distance=0.05)
                            if pick.success:
                                call('move_pick', pick_id=pick.pick_id, target=Point(at.x, at.y, at.z + 0.02))
                                if rng.random() < 0.3:
                                    call('lock', pick_id=pick.pick_id)
                                call('release', pick_id=pick.pick_id)
                        elif kind == 4:
                            # The pieces are left alone: cut again and again they would be work without end.
                            call('cut', blades=pose_stamped(-1.0, 0.0, rng.uniform(0.0, 0.1)),
                                 close_time=rng.choice([0.0, 0.05]), bodies=[rng.choice(['left', 'middle'])])
                        elif kind == 5:
                            call('get_body', name=rng.choice(['left', 'right', 'middle', 'left.1']))
                        elif kind == 6:
                            call('push', enable=rng.random() < 0.8, pose=pose_stamped(at.x, at.y, at.z), speed=0.1)
                        elif kind == 7:
                            call('reset')
                        elif kind == 8:
                            call(rng.choice(['save', 'load']), file=rng.choice(['start', 'busy']))
                        elif kind == 9:
                            call('hash')
                        elif kind == 10:
                            call('step', steps=rng.randint(1, 5))
                        elif kind == 11:
                            call('probe', point=Point(at.x, at.y, 1.0), direction=Vector3(0, 0, -1))
                        elif kind == 12:
                            call('set_material', body=rng.choice(['left', 'right']),
                                 yaml='{alpha: %.2f}' % rng.uniform(0.1, 1.0))
                        elif kind == 13:
                            guest = call('spawn', name='', scale=1.0, pose=pose_stamped(at.x, at.y, 1.0),
                                         primitive=SolidPrimitive(type=SolidPrimitive.BOX, dimensions=[0.05] * 3))
                            if guest.success:
                                call('remove', name=guest.name)
                        elif kind == 14:
                            call('incise', blade=pose_stamped(at.x, 0.0, 0.1), length=0.02, depth=0.02,
                                 bodies=[rng.choice(['left', 'right'])])
                        elif kind == 15:
                            call(rng.choice(['clear_picks', 'open_scissors', 'lift_scissors']))
                            call('pause', data=rng.random() < 0.3)
                        elif kind == 16:
                            call('pick', point=at, header=header('nowhere'))  # it waits for the transform
                        else:
                            call('undo_cut')
                except Exception as fault:  # pylint: disable=broad-except
                    faults.append('client %d: %s' % (number, fault))

            threads = [threading.Thread(target=client, args=(number,)) for number in range(CROWD)]
            for thread in threads:
                thread.daemon = True
                thread.start()
            for thread in threads:
                thread.join(SECONDS + LONG)
            self.assertFalse(any(thread.is_alive() for thread in threads), 'a client still waits')
            self.assertIsNone(node.process.poll(), node.output()[-3000:])
            self.assertEqual([], faults[:5])
            self.assertGreater(min(counts), 0)
            slow = max(slowest, key=lambda call: call[0])
            print('crowd: %d clients, %d calls in %.0f s, the slowest took %.2f s: ~%s %s: %s' % (
                CROWD, sum(counts), SECONDS, slow[0], slow[1], str(slow[2]).replace('\n', ' '), slow[3][:200]))
            self.assertLess(slow[0], SLOWEST)
            self.lives(node)
            last = node.good('hash')
            self.assertEqual(0, node.end(15))
        replay = subprocess.run([roslib.packages.find_node('meshless_surgery', 'replay')[0],
                                 os.path.join(self.folder, 'log')], stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                                universal_newlines=True, check=False)
        self.assertEqual(0, replay.returncode, replay.stdout[-2000:])
        self.assertIn('step %d hash %016x' % (last.step, last.hash), replay.stdout)


class ListenerTest(RobustCase):

    def stalled(self, node, topic, message_type):
        """A subscriber that connects, shakes hands and then never reads."""
        master = rosgraph.Master('/stalled')
        for name, publishers in master.getSystemState()[0]:
            if name == node.name + '/' + topic and publishers:
                break
        else:
            raise AssertionError('nobody publishes ' + topic)
        import xmlrpc.client
        proxy = xmlrpc.client.ServerProxy(master.lookupNode(node.name))
        code, _, (_, host, port) = proxy.requestTopic('/stalled', node.name + '/' + topic, [['TCPROS']])
        self.assertEqual(1, code)
        connection = socket.create_connection((host, port))
        fields = ['callerid=/stalled', 'topic=%s/%s' % (node.name, topic), 'type=' + message_type._type,
                  'md5sum=' + message_type._md5sum, 'tcp_nodelay=0']
        body = b''.join(len(f).to_bytes(4, 'little') + f.encode() for f in fields)
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        connection.sendall(len(body).to_bytes(4, 'little') + body)
        return connection

    def test_listeners_that_come_go_and_stall(self):
        topics = [('markers', MarkerArray), ('points', PointCloud2), ('state', State), ('surfaces', Surfaces),
                  ('events', Event)]
        with self.node() as node:
            stalled = [self.stalled(node, topic, kind) for topic, kind in topics for _ in range(2)]
            rng = random.Random(3)
            coming = []
            for _ in range(60):
                topic, kind = rng.choice(topics)
                coming.append(Recorder(node.name + '/' + topic, kind, wait=rng.random() < 0.5))
                if len(coming) > 5:
                    coming.pop(rng.randrange(len(coming))).close()
                if rng.random() < 0.2:
                    stalled.append(self.stalled(node, *rng.choice(topics)))
                if rng.random() < 0.2:
                    stalled.pop(rng.randrange(len(stalled))).close()
            # Who listens properly still hears.
            state = Recorder(node.name + '/state', State)
            first = state.next()
            self.assertGreater(state.next(lambda s: s.step > first.step + 20).step, first.step)
            for recorder in coming + [state]:
                recorder.close()
            self.lives(node)
            for connection in stalled:
                connection.close()
            self.lives(node)
            self.assertEqual(0, node.end(15))

    def test_half_a_handshake(self):
        with self.node() as node:
            import xmlrpc.client
            master = rosgraph.Master('/stalled')
            uri = master.lookupService(node.name + '/hash')
            host, port = uri.split('//')[1].split(':')
            for data in (b'', b'\xff\xff\xff\xff', b'\x00\x00\x00\x00', b'\x10\x00\x00\x00abc',
                         b'GET / HTTP/1.1\r\n\r\n',
                         b'\x04\x00\x00\x00\xff\xff\xff\x7f', bytes(range(256)) * 100):
                connection = socket.create_connection((host, int(port)))
                try:
                    connection.sendall(data)
                    connection.close()
                except OSError:
                    pass
            proxy = xmlrpc.client.ServerProxy(master.lookupNode(node.name))
            for call in (lambda: proxy.requestTopic('/x', '/no', [['TCPROS']]), lambda: proxy.nonsense(1),
                         lambda: proxy.getPid()):
                try:
                    call()
                except (xmlrpc.client.Error, OSError):
                    pass
            self.lives(node)


class TimeTest(RobustCase):

    def transform(self, stamp, x):
        t = TransformStamped(header=header('world', stamp), child_frame_id='tool')
        t.transform.translation.x = x
        t.transform.rotation.w = 1.0
        return TFMessage([t])

    def test_tf_that_goes_back_in_time(self):
        publisher = rospy.Publisher('/tf', TFMessage, queue_size=100)
        with self.node(paused=True, tools__push__follow_frame='tool') as node:
            now = rospy.Time.now()
            node.call('push', enable=True, pose=pose_stamped(frame='tool'))  # from the first request on it listens
            rng = random.Random(9)
            for number in range(300):
                shift = rng.choice([0.0, -10.0, -1e6, 1e6, 10.0])
                stamp = rospy.Time.from_sec(max(0.001, now.to_sec() + shift + 0.01 * number))
                publisher.publish(self.transform(stamp, rng.choice([0.0, 0.1, math.nan, 1e300])))
                if number % 10 == 0:
                    answer = node.call('push', enable=True, pose=pose_stamped(0.0, 0.0, 0.2, frame='tool'))
                    self.assertNotEqual('', answer.message)
            self.lives(node)
            self.assertEqual(0, node.end(15))
        publisher.unregister()

    def test_a_clock_that_jumps(self):
        """Last: from here on this process would have simulated time, too."""
        publisher = rospy.Publisher('/clock', Clock, queue_size=100, latch=True)
        rospy.set_param('/use_sim_time', True)
        try:
            with self.node() as node:
                rng = random.Random(4)
                now = 100.0
                last = 0
                for _ in range(8):
                    now = rng.choice([now + 1000.0, max(0.5, now - 1000.0), 0.0, 1e9, now])
                    for _ in range(40):
                        now += 0.02
                        publisher.publish(Clock(clock=rospy.Time.from_sec(now)))
                        time.sleep(0.005)
                    answer = node.good('hash')
                    # A jump is not caught up with: 0.8 s of steps, and the backlog, at most.
                    self.assertLess(answer.step, last + 400)
                    last = answer.step
                self.assertGreater(last, 0)
                self.lives(node)
                self.assertEqual(0, node.end(15))
        finally:
            rospy.delete_param('/use_sim_time')
            publisher.unregister()


if __name__ == '__main__':
    run('robust', CrowdTest, ListenerTest, TimeTest)
