#!/usr/bin/env python3
"""Every service and input topic with structured random requests, and mesh files that lie: the node answers each call, a
refusal has a message and changes nothing, and what is accepted leaves finite tissue. MESHLESS_SURGERY_FUZZ_CALLS sets
the number of calls, MESHLESS_SURGERY_FUZZ_SEED the seed, MESHLESS_SURGERY_FUZZ_HANG the seconds that a call may
take."""
import math
import os
import random
import shutil
import struct
import sys
import tempfile
import time
import unittest

import rospy
from geometry_msgs.msg import Point, PoseStamped, Quaternion, Vector3
from meshless_surgery.msg import State
from sensor_msgs.msg import JointState, PointCloud2, PointField
from shape_msgs.msg import SolidPrimitive
from std_msgs.msg import Header

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from deformer_support import LONG, TYPES, OwnNode, Recorder, pose_stamped, run  # noqa: E402

SCENES = os.path.join(os.path.dirname(os.path.abspath(__file__)), 'scenes')
CALLS = int(os.environ.get('MESHLESS_SURGERY_FUZZ_CALLS') or 2500)
SEED = int(os.environ.get('MESHLESS_SURGERY_FUZZ_SEED') or 1)
# [s]; the machine may be loaded, or the node under sanitizers. The longest call is printed.
HANG = float(os.environ.get('MESHLESS_SURGERY_FUZZ_HANG') or 30.0)
# [bytes] that the node may take on the way: requests of 100 MB are among them, and its threads keep what they have had.
MOST_MEMORY = 2 << 30
LARGE_STRING = 'x' * 10000000

NUMBERS = (0.0, -0.0, 1.0, -1.0, 0.1, 0.05, 0.01, -0.01, 1e-6, 1e-12, 1e-320, 1e6, 1e9, 1e18, 1e154, 1e308, -1e308,
           math.nan, math.inf, -math.inf)


def stolen():
    """[s] of processors that the host has given to other machines so far."""
    with open('/proc/stat', encoding='utf-8') as stat:
        return int(stat.readline().split()[8]) / os.sysconf('SC_CLK_TCK')


def mesh_files(folder, outside):
    """Files that claim more than they have, or other things than they are: none of them is a body."""
    files = {
        'vertices.ply': b'ply\nformat ascii 1.0\nelement vertex 4294967295\nproperty float x\nproperty float y\n'
                        b'property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n'
                        b'0 0 0\n',
        'binary.ply': b'ply\nformat binary_little_endian 1.0\nelement vertex 4000000000\nproperty float x\n'
                      b'property float y\nproperty float z\nend_header\n' + bytes(120),
        'list.ply': b'ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\nproperty float y\n'
                    b'property float z\nelement face 1\nproperty list int int vertex_indices\nend_header\n' +
                    bytes(36) + struct.pack('<i', 2000000000),
        'negative.ply': b'ply\nformat ascii 1.0\nelement vertex -5\nproperty float x\nend_header\n',
        'count.stl': bytes(80) + struct.pack('<I', 0xffffffff) + bytes(100),
        'cut_off.stl': bytes(80) + struct.pack('<I', 12) + bytes(200),
        'points.pcd': b'VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 4294967295\nHEIGHT 1\n'
                      b'VIEWPOINT 0 0 0 1 0 0 0\nPOINTS 4294967295\nDATA binary\n' + bytes(64),
        'height.pcd': b'VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 65536\nHEIGHT 65536\n'
                      b'VIEWPOINT 0 0 0 1 0 0 0\nPOINTS 0\nDATA ascii\n0 0 0\n',
        'fields.pcd': b'VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1000000000\nWIDTH 3\nHEIGHT 1\n'
                      b'POINTS 3\nDATA binary\n' + bytes(64),
        'compressed.pcd': b'VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 3\nHEIGHT 1\n'
                          b'POINTS 3\nDATA binary_compressed\n' + struct.pack('<II', 0xfffffff0, 0xfffffff0) +
                          bytes(64),
        'points.vtk': b'# vtk DataFile Version 3.0\nx\nASCII\nDATASET POLYDATA\nPOINTS 4294967295 float\n0 0 0\n',
        'polygons.vtk': b'# vtk DataFile Version 3.0\nx\nASCII\nDATASET POLYDATA\nPOINTS 3 float\n0 0 0 1 0 0 0 1 0\n'
                        b'POLYGONS 1000000000 2147483647\n3 0 1 2\n',
        'index.obj': b'v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4000000000\n',
        'negative.obj': b'v 0 0 0\nv 1 0 0\nv 0 1 0\nf -1 -2 -9\n',
        'nan.obj': b'v nan 0 0\nv 1 inf 0\nv 0 1 0\nf 1 2 3\n',
        'line.obj': b'v 0 0 0' + b' 0' * 2000000 + b'\n',
        'empty.obj': b'', 'empty.ply': b'', 'empty.stl': b'', 'empty.pcd': b'', 'empty.vtk': b'',
        'noise.obj': bytes(range(256)) * 400, 'noise.ply': b'ply\n' + bytes(range(256)) * 400,
        'noise.stl': bytes(range(256)) * 400, 'noise.pcd': b'VERSION .7\n' + bytes(range(256)) * 400,
        'noise.vtk': b'# vtk DataFile Version 3.0\n' + bytes(range(256)) * 400,
        'scene.yaml': b'a: &a [1]\n',
    }
    for name, data in files.items():
        with open(os.path.join(folder, name), 'wb') as file:
            file.write(data)
    with open(os.path.join(folder, 'sparse.stl'), 'wb') as file:
        file.truncate(1 << 40)
    os.mkdir(os.path.join(folder, 'folder.obj'))
    os.mkfifo(os.path.join(folder, 'pipe.obj'))
    with open(os.path.join(outside, 'secret.obj'), 'wb') as file:
        file.write(b'v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n')
    os.symlink(os.path.join(outside, 'secret.obj'), os.path.join(folder, 'link.obj'))
    return [os.path.join(folder, name) for name in sorted(os.listdir(folder))]


def yaml_bombs():
    bomb = 'a0: &a0 [x, x, x, x, x, x, x, x, x]\n' + ''.join(
        'a%d: &a%d [%s]\n' % (i, i, ', '.join(['*a%d' % (i - 1)] * 9)) for i in range(1, 30))
    return [bomb, '[' * 60000, '{a: ' * 15000, '- ' * 30000, '&a [*a]', '<<: *x', '!!binary x', 'alpha: ' + '9' * 60000,
            '"' + 'a' * 60000, 'x' * 70000, LARGE_STRING, '{alpha: .nan}', '{alpha: 1e999}', '{density: -1}', 'alpha',
            '\0', '{alpha: 0.3, alpha: 0.4}', '? ? ? ?', '{volume: [[0, 1], [0, 1]]}', '%YAML 9.9\n---\na',
            '---\n---\n']


class Fuzzer:

    def __init__(self, rng, files, names):
        self.rng = rng
        self.files = files
        self.names = names
        self.strings = ['', 'left', 'right', 'middle', 'left.1', 'left.2', 'no_such', '/', '../..', 'a/b',
                        '/etc/passwd', 'package://meshless_surgery/config/meshes/fish.obj', 'package://', 'ä' * 200, 'x\n\0y',
                        'x' * 300, '%s%n%d', ' ', 'world', '/world', 'no_such_frame', 'default', 'soft', 'box'] + names
        self.picks = [0]
        self.sensible = False  # half of the requests are such as a user's, so that the state is not always the start

    def number(self):
        if self.sensible or self.rng.random() < 0.6:
            return self.rng.uniform(-0.3, 0.3)
        if self.rng.random() < 0.5:
            return self.rng.choice(NUMBERS)
        return math.copysign(10.0 ** self.rng.uniform(-320, 308), self.rng.random() - 0.5)

    def string(self):
        if self.sensible:
            return self.rng.choice(['', 'left', 'right', 'middle', 'left.1', 'right.2', 'guest'])
        if self.rng.random() < 0.004:
            return LARGE_STRING
        if self.rng.random() < 0.1:
            return ''.join(chr(self.rng.randint(1, 0x2fff)) for _ in range(self.rng.randint(0, 40)))
        return self.rng.choice(self.strings)

    def stamp(self):
        if self.sensible or self.rng.random() < 0.5:
            return rospy.Time(0)
        now = rospy.Time.now().to_sec()
        return rospy.Time.from_sec(self.rng.choice([now, now - 3600.0, now + 3600.0, 1.0, 4e9]))

    def header(self):
        known = self.sensible or self.rng.random() < 0.7
        frame = self.rng.choice(['', 'world', '/world']) if known else self.string()
        return Header(frame_id=frame, stamp=self.stamp())

    def quaternion(self):
        kind = self.rng.random()
        if self.sensible or kind < 0.5:
            q = [self.rng.gauss(0, 1) for _ in range(4)]
            norm = math.sqrt(sum(v * v for v in q))
            return Quaternion(*[v / norm for v in q])
        if kind < 0.7:
            return Quaternion(0, 0, 0, 1)
        if kind < 0.75:
            return Quaternion(0, 0, 0, 0)
        return Quaternion(*[self.number() for _ in range(4)])

    def pose(self):
        stamped = PoseStamped(header=self.header())
        stamped.pose.position = self.point()
        stamped.pose.orientation = self.quaternion()
        return stamped

    def point(self):
        if self.sensible or self.rng.random() < 0.6:
            return Point(self.rng.uniform(-0.3, 0.3), self.rng.uniform(-0.1, 0.1), self.rng.uniform(0, 0.15))
        return Point(self.number(), self.number(), self.number())

    def vector(self):
        if self.sensible or self.rng.random() < 0.5:
            return Vector3(0, 0, 0)
        return Vector3(self.number(), self.number(), self.number())

    def list_of_names(self):
        if self.sensible or self.rng.random() < 0.7:
            return []
        return [self.string() for _ in range(self.rng.choice([1, 1, 2, 5, 2000]))]

    def pick_id(self):
        return self.rng.choice([self.rng.choice(self.picks[-20:]), self.picks[-1]] + [0, 0xffffffff] * (not self.sensible))

    def primitive(self):
        if self.sensible or self.rng.random() < 0.6:
            return SolidPrimitive(type=SolidPrimitive.BOX, dimensions=[self.rng.uniform(0.02, 0.2) for _ in range(3)])
        return SolidPrimitive(type=self.rng.choice([0, 1, 2, 3, 4, 255]),
                              dimensions=[self.number() for _ in range(self.rng.randint(0, 5))])

    def cloud(self):
        """Points all around a ball, or fields, sizes and bytes that do not belong together."""
        r = self.rng
        count = r.choice([0, 1, 3, 50, 400])
        rows = []
        for _ in range(count):
            v = [r.gauss(0, 1) for _ in range(3)]
            length = math.sqrt(sum(x * x for x in v)) or 1.0
            rows.append([0.05 * x / length for x in v] if self.sensible or r.random() < 0.9 else [self.number()] * 3)
        data = b''.join(struct.pack('<3f', *(min(max(x, -3e38), 3e38) for x in row)) for row in rows)
        fields = [PointField(name, 4 * k, PointField.FLOAT32, 1) for k, name in enumerate('xyz')]
        cloud = PointCloud2(header=self.header(), height=1, width=count, fields=fields, point_step=12, row_step=12 * count,
                            data=data, is_dense=True)
        if self.sensible or r.random() < 0.3:
            return cloud
        sizes = [0, 1, 7, 12, count, 12 * count, 65536, 0x7fffffff, 0xffffffff]
        for name in ('height', 'width', 'point_step', 'row_step'):
            if r.random() < 0.3:
                setattr(cloud, name, r.choice(sizes))
        for field in cloud.fields:
            if r.random() < 0.2:
                field.offset = r.choice(sizes)
            if r.random() < 0.2:
                field.datatype = r.randint(0, 255)
            if r.random() < 0.2:
                field.count = r.choice(sizes)
            if r.random() < 0.1:
                field.name = self.string()[:200]
        cloud.is_bigendian = r.random() < 0.1
        if r.random() < 0.3:
            cloud.data = data[:r.randint(0, len(data))]
        return cloud

    def request(self, service):
        """Fields of a call: sensible ones, and others."""
        r = self.rng
        self.sensible = r.random() < 0.5
        if service == 'pick':
            return dict(header=self.header(), point=self.point(), direction=self.vector(),
                        body='' if self.sensible else self.maybe_name(),
                        max_distance=0.2 if self.sensible else r.choice([0.0, self.number()]),
                        stiffness=r.choice([0.0, self.amount()]))
        if service == 'move_pick':
            return dict(header=self.header(), pick_id=self.pick_id(), target=self.point())
        if service == 'lock':
            return dict(header=self.header(), pick_id=self.pick_id(), at_target=r.random() < 0.5, target=self.point())
        if service == 'release':
            return dict(pick_id=self.pick_id())
        if service == 'push':
            return dict(enable=r.random() < 0.8, radius=r.choice([0.0, self.amount()]), pose=self.pose(),
                        speed=r.choice([0.0, self.amount()]))
        if service == 'cut':
            return dict(blades=self.pose(), length=r.choice([0.0, self.amount()]), width=r.choice([0.0, self.amount()]),
                        close_time=r.choice([0.0, self.amount()]), roughness=r.choice([0.0, 0.0, 0.1 * self.amount()]),
                        bodies=self.list_of_names())
        if service == 'incise':
            return dict(blade=self.pose(), length=abs(self.number()), depth=self.amount(), bodies=self.list_of_names())
        if service == 'spawn':
            return dict(name=self.string(), file='' if self.sensible else r.choice(['', self.string(), r.choice(self.files)]),
                        primitive=self.primitive(), pose=self.pose(), scale=r.choice([0.0, 1.0, self.number()]),
                        material='' if self.sensible else r.choice(['', 'soft', self.string()]))
        if service == 'spawn_cloud':
            return dict(name=self.string(), cloud=self.cloud(), topic='' if self.sensible else r.choice(['', self.string()]),
                        timeout=0.001, scale=r.choice([0.0, 1.0, self.number()]), voxel=r.choice([0.0, self.amount()]),
                        outliers=r.choice([0.0, self.amount()]), material='' if self.sensible else self.string())
        if service in ('remove', 'get_body'):
            fields = dict(name=self.maybe_name())
            if service == 'get_body':
                fields['rest'] = r.random() < 0.5
            return fields
        if service == 'set_material' and self.sensible:
            return dict(body='', yaml='{%s: %.3f}' % (r.choice(['restitution', 'friction', 'damping']), r.random()))
        if service == 'set_material':
            yaml = r.choice(yaml_bombs()) if r.random() < 0.3 else '{%s: %s}' % (
                r.choice(['alpha', 'beta', 'mode', 'density', 'youngs_modulus', 'friction', 'damping', 'colour', 'stiffening', 'asymmetry', 'toughness', 'relaxation', 'fibres',
                          'volume']),
                r.choice([self.number(), self.string()[:200], '[1, 2]', '[[0, 0.5]]', '{}']))
            return dict(body=self.maybe_name(), yaml=yaml)
        if service == 'get_load':
            return dict(name=self.maybe_name(), header=self.header(), points=[self.point() for _ in range(r.choice([0, 1, 3, 10001]))])
        if service == 'move_clamp':
            return dict(name=self.maybe_name(), clamp=r.choice([0, 0, 1, 7, 0xffffffff]), header=self.header(), shift=self.vector(),
                        turn=self.pose().pose.orientation, time=self.number())
        if service == 'apply_force':
            return dict(name=self.maybe_name(), header=self.header(), centre=self.point(), radius=r.choice([0.0, self.amount()]),
                        force=self.vector(), time=r.choice([0.1, 0.1, self.number()]))
        if service == 'set_gravity':
            return dict(header=self.header(), gravity=r.choice([Vector3(0, 0, -9.81), self.vector()]))
        if service == 'set_pose':
            return dict(name=self.maybe_name(), pose=self.pose())
        if service == 'reset_bodies':
            return dict(bodies=self.list_of_names())
        if service == 'attach_instrument':
            yaml = r.choice(['{type: grasper}', '{type: probe}', '{type: hook, max_force: %s}' % self.number(), '{type: scissors, grip: %s}' % self.number(), '{type: scalpel, sharpness: %s}' % self.number(), '{type: endoscope, view_angle: %s}' % self.number(), '{type: %s}' % self.string()[:40], '[1]'])
            return dict(name=r.choice(['left', 'right', 'push', self.string()[:60]]), yaml=yaml, pose=self.pose())
        if service == 'detach_instrument':
            return dict(name=r.choice(['left', 'right', self.string()[:60]]))
        if service == 'probe':
            return dict(header=self.header(), point=self.point(),
                        direction=Vector3(0, 0, -1) if self.sensible else self.vector())
        if service == 'step':
            return dict(steps=r.choice([0, 1, 2, 3, 100001, 0xffffffff]))
        if service == 'pause':
            return dict(data=True)
        if service in ('save', 'load'):
            return dict(file=r.choice(['state', 'other', self.string()]))
        if service == 'start_task':
            return dict(task=r.choice(['palpate', 'none', self.string()]), trainee=self.string())
        if service == 'observe':
            bodies = [self.maybe_name() for _ in range(r.choice([0, 1, 3, 10001]))]
            return dict(bodies=bodies, particles=[r.choice([0, 5, 0xffffffff]) for _ in bodies][r.choice([0, 0, 1]):])
        if service == 'report':
            return dict(name=r.choice(['', 'mine', self.string()]))
        if service == 'attach':
            return dict(header=self.header(), name=self.joint(), body=self.maybe_name(), other=r.choice(['world', self.maybe_name()]),
                        distance=r.choice([0.0, 0.1, self.amount()]), stiffness=1e4 if self.sensible else self.amount(),
                        strength=r.choice([0.0, self.amount()]), centre=self.point(), radius=r.choice([0.0, self.amount()]))
        if service == 'detach':
            return dict(header=self.header(), name=self.joint(), centre=self.point(), radius=r.choice([0.0, self.amount()]))
        if service == 'clip':
            return dict(header=self.header(), name=self.joint(), body=self.maybe_name(), point=self.point(),
                        direction=Vector3(0, 0, 1) if self.sensible else self.vector(),
                        width=r.choice([0.0, self.amount()]), opening=r.choice([0.0, self.amount()]))
        if service == 'unclip':
            return dict(name=self.joint())
        assert not TYPES[service]._request_class.__slots__, '~%s has fields' % service
        return {}

    def joint(self):
        return self.rng.choice(['', 'joint', 'bed', self.string()])

    def amount(self):
        return abs(self.number()) if self.sensible else self.number()

    def maybe_name(self):
        return self.rng.choice(['', 'left', 'right', 'middle', self.string(), self.string()])


class FuzzCase(unittest.TestCase):

    def setUp(self):
        self.folder = tempfile.mkdtemp(prefix='meshless_fuzz_')
        for name in ('meshes', 'outside', 'session'):
            os.mkdir(os.path.join(self.folder, name))
        self.files = mesh_files(os.path.join(self.folder, 'meshes'), os.path.join(self.folder, 'outside'))
        self.node = OwnNode(scene=os.path.join(SCENES, 'fuzz.yaml'), paused=True,
                            data_folders=[os.path.join(self.folder, 'meshes')],
                            session_directory=os.path.join(self.folder, 'session')).wait()
        self.proxies = {}
        self.longest = (0.0, '', 0.0)
        self.over_a_second = 0
        self.times = {}

    def tearDown(self):
        self.node.__exit__()
        shutil.rmtree(self.folder, ignore_errors=True)

    def call(self, service, **fields):
        if service not in self.proxies:
            self.proxies[service] = rospy.ServiceProxy(self.node.name + '/' + service, TYPES[service], persistent=True)
        began, before = time.monotonic(), stolen()
        try:
            answer = self.proxies[service](**fields)
        except (rospy.ServiceException, rospy.exceptions.TransportException) as fault:
            code = self.node.process.poll()
            self.fail('~%s %.300r: %s; %s' % (service, fields, fault, 'the node has ended with %s: %s' % (
                code, self.node.output()[-2000:]) if code is not None else 'the node lives'))
        took = time.monotonic() - began
        self.longest = max(self.longest, (took, service, stolen() - before))
        self.over_a_second += took > 1.0
        count, total = self.times.get(service, (0, 0.0))
        self.times[service] = (count + 1, total + took)
        if not took < HANG:
            self.fail('~%s %.300r took %.1f s' % (service, fields, took))
        return answer

    def slowest(self):
        return '%d calls over a second, the longest %.2f s (~%s, while others took %.2f s of the processors)' % (
            (self.over_a_second,) + self.longest)

    def memory(self):
        with open('/proc/%d/status' % self.node.process.pid, encoding='utf-8') as status:
            for line in status:
                if line.startswith('VmHWM:'):
                    return 1024 * int(line.split()[1])
        raise AssertionError('no VmHWM')


class ServicesTest(FuzzCase):

    def test_refused_calls_change_nothing(self):
        rng = random.Random(SEED)
        fuzzer = Fuzzer(rng, self.files, ['guest', 'other'])
        services = sorted(set(TYPES) - {'hash'})
        # What begins anew or lets go comes seldom, or the state would hardly leave the start.
        seldom = {'reset', 'load', 'clear_picks', 'lift_scissors', 'open_scissors', 'undo_cut', 'remove'}
        weights = [0.1 if service in seldom else 1.0 for service in services]
        states = Recorder(self.node.name + '/state', State)
        refused = accepted = 0
        done = dict.fromkeys(services, 0)
        self.call('save', file='state')
        before = self.call('hash').hash
        for number in range(CALLS):
            if number % 250 == 249:
                self.finite(states)
                before = self.call('hash').hash
            service = rng.choices(services, weights)[0] if number % 250 else 'reset'
            fields = fuzzer.request(service)
            answer = self.call(service, **fields)
            after = self.call('hash').hash
            faults = []
            if answer.message == '':
                faults.append('it says nothing')
            if len(answer.message) > 5000:
                faults.append('it says %d characters' % len(answer.message))
            if '\ufffd' in answer.message:  # what rospy makes of bytes that are no UTF-8
                faults.append('it says what is no text')
            if after != before and (not answer.success or service in ('get_body', 'get_load', 'observe', 'probe', 'pause', 'save')):
                faults.append('the state has changed')
            if faults:  # only then put into words: there are 100 MB in some requests
                self.fail('call %d: ~%s %.300r: %r: %s' % (number, service, fields, answer.message[:300], faults))
            if answer.success:
                accepted += 1
                done[service] += 1
                if service == 'pick':
                    fuzzer.picks.append(answer.pick_id)
            else:
                refused += 1
            before = after
        print('fuzz: %d calls, %d refused, %s, memory %d MB; calls and seconds by service: %s' % (
            CALLS, refused, self.slowest(), self.memory() >> 20,
            ', '.join('%s %d %.1f' % (name, *self.times[name]) for name in sorted(self.times))))
        self.assertLess(self.memory(), MOST_MEMORY)
        self.assertGreater(refused, CALLS // 10)
        self.assertGreater(accepted, CALLS // 10)
        for service in () if CALLS < 1000 else ('cut', 'incise', 'pick', 'move_pick', 'lock', 'push', 'probe', 'spawn', 'set_material', 'step'):
            self.assertGreater(done[service], CALLS // 500, '%s: %s' % (service, done))
        states.close()

    def finite(self, states):
        """All that is there now, with whatever was done to it."""
        asked = rospy.Time.now()
        state = states.next(lambda message: message.header.stamp >= asked)
        self.assertGreater(len(state.bodies), 0)
        for body in state.bodies:
            self.assertTrue(math.isfinite(body.kinetic_energy), body)
            shape = self.call('get_body', name=body.name)
            self.assertTrue(shape.success, shape.message)
            self.assertTrue(math.isfinite(shape.volume) and math.isfinite(shape.area), body)


class FilesTest(FuzzCase):

    def test_files_that_lie_are_refused(self):
        before = self.call('hash').hash
        for file in self.files:
            answer = self.call('spawn', name='', file=file, scale=1.0, pose=pose_stamped())
            self.assertFalse(answer.success, file)
            self.assertNotEqual('', answer.message, file)
            self.assertEqual(before, self.call('hash').hash, file)
        self.assertLess(self.memory(), MOST_MEMORY)

    def test_yaml_bombs_are_refused(self):
        before = self.call('hash').hash
        for bomb in yaml_bombs():
            answer = self.call('set_material', body='left', yaml=bomb)
            self.assertFalse(answer.success, bomb[:100])
            self.assertNotEqual('', answer.message)
            self.assertEqual(before, self.call('hash').hash, bomb[:100])
        self.assertLess(self.memory(), MOST_MEMORY)

    def test_scene_files_that_lie_are_refused(self):
        meshes = os.path.join(self.folder, 'meshes')
        scenes = ['bodies: [{primitive: {box: [1, 1, 1]}, copies: {count: 4000000000, grid: [65536, 65536, 1]}}]',
                  'bodies: [{primitive: {box: [0.1, 0.1, 0.1], edge: 1e-9}}]',
                  'bodies: [{primitive: {box: [0.1, 0.1, 0.1]}, spacing: 1e-9}]',
                  'bodies: [{primitive: {box: [0.1, 0.1, 0.1]}, clusters: {grid: [2000000000, 2000000000, 2]}}]',
                  'bodies: [{file: vertices.ply}]', 'bodies: [{file: link.obj}]', 'bodies: [{file: /etc/passwd}]',
                  'bodies: [{file: pipe.obj}]'] + [bomb for bomb in yaml_bombs() if len(bomb) < 100000]
        for text in scenes:
            path = os.path.join(meshes, 'hostile.yaml')
            with open(path, 'w', encoding='utf-8') as file:
                file.write(text)
            node = OwnNode(scene=path)
            try:
                code = node.process.wait(LONG)
                self.assertEqual(1, code, text[:100] + ': ' + node.output()[-500:])
                self.assertIn('hostile.yaml', node.output(), text[:100])
            finally:
                node.__exit__()


class TopicsTest(FuzzCase):

    def test_streams(self):
        rng = random.Random(SEED)
        fuzzer = Fuzzer(rng, self.files, [])
        topics = ['pick/servo_cp', 'push/servo_cp', 'scissors/servo_cp', 'scissors/jaw/servo_js']
        publishers = [rospy.Publisher(self.node.name + '/' + topic, JointState if topic.endswith('js') else PoseStamped,
                                      queue_size=10) for topic in topics]
        end = time.monotonic() + LONG
        while any(p.get_num_connections() == 0 for p in publishers) and time.monotonic() < end:
            time.sleep(0.01)
        for topic, publisher in zip(topics, publishers):
            self.assertGreater(publisher.get_num_connections(), 0, topic)
        recorder = Recorder(self.node.name + '/state', State)
        for number in range(CALLS):
            publisher = rng.choice(publishers)
            if publisher is publishers[3]:
                message = JointState(header=fuzzer.header())
                message.name = [fuzzer.string()[:1000] for _ in range(rng.randint(0, 3))]
                message.position = [fuzzer.number() for _ in range(rng.choice([0, 1, 1, 1, 3, 10000]))]
                message.effort = [fuzzer.number() for _ in range(rng.randint(0, 3))]
            else:
                message = fuzzer.pose()
            if len(message.header.frame_id) > 1000 and number % 10:
                message.header.frame_id = ''
            publisher.publish(message)
            if number % 20 == 0:
                self.call('pick', point=Point(-0.2, 0, 0.1), max_distance=10.0)
                self.assertTrue(self.call('step', steps=3).success)
            if number % 200 == 199:
                self.call('reset')
        self.assertTrue(self.call('hash').success)
        print('fuzz: %d messages, %s, memory %d MB' % (CALLS, self.slowest(), self.memory() >> 20))
        for topic, publisher in zip(topics, publishers):
            publisher.unregister()
        recorder.close()
        self.assertGreater(recorder.count(), CALLS // 200)
        for state in recorder.messages:
            for body in state.bodies:
                at = body.centre_of_mass
                self.assertTrue(all(math.isfinite(v) for v in (body.kinetic_energy, at.x, at.y, at.z)),
                                '%s in step %d' % (body.name, state.step))
        # They have moved tools, not only been refused.
        self.assertGreater(len({(p.target.x, p.target.y) for state in recorder.messages for p in state.picks}), 10)
        self.assertLess(self.memory(), MOST_MEMORY)


if __name__ == '__main__':
    run('fuzz', ServicesTest, FilesTest, TopicsTest)
