#!/usr/bin/env python3
"""Bodies from clouds: the recorded phantom, layouts of messages, frames, units, and what is refused."""
import os
import subprocess
import sys
import tempfile
import unittest

import numpy as np
import roslib.packages
from meshless_surgery.srv import SpawnCloudResponse
from sensor_msgs.msg import PointCloud2, PointField

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from deformer_support import LONG, OwnNode, run  # noqa: E402

SCENE = os.path.join(os.path.dirname(os.path.abspath(__file__)), 'scenes', 'falling.yaml')
BALL = 4.0 / 3.0 * np.pi * 0.05 ** 3


def ball(points=20000):
    """Of 0.05 m about (0.2, 0, 0.1)."""
    out = np.random.default_rng(1).normal(size=(points, 3))
    return 0.05 * out / np.linalg.norm(out, axis=1)[:, None] + (0.2, 0.0, 0.1)


def cloud_of(points, kind=np.float32, before=0, frame='', rows=1, pad=0):
    """`before`: bytes before x in each point; `pad`: bytes after each row."""
    size = np.dtype(kind).itemsize
    datatype = PointField.FLOAT32 if size == 4 else PointField.FLOAT64
    step = before + 3 * size
    data = np.zeros((rows, len(points) // rows * step + pad), dtype=np.uint8)
    values = np.ascontiguousarray(points, dtype=kind).view(np.uint8).reshape(rows, -1, 3 * size)
    data[:, :data.shape[1] - pad].reshape(rows, -1, step)[:, :, before:] = values
    fields = [PointField(name, before + size * k, datatype, 1) for k, name in enumerate('xyz')]
    cloud = PointCloud2(height=rows, width=len(points) // rows, fields=fields, point_step=step, row_step=data.shape[1],
                        data=data.tobytes())
    cloud.header.frame_id = frame
    return cloud


class SpawnCloudTest(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        cls.node = OwnNode(scene=SCENE, paused=True)
        cls.node.wait()

    @classmethod
    def tearDownClass(cls):
        cls.node.end()
        cls.node.__exit__()

    def setUp(self):
        self.node.good('reset')

    def refused(self, code, words, **fields):
        before = self.node.hash()
        answer = self.node.call('spawn_cloud', **fields)
        self.assertFalse(answer.success, answer.message)
        for word in words:
            self.assertIn(word, answer.message)
        self.assertEqual(code, answer.error_code, answer.message)
        self.assertEqual(before, self.node.hash())

    def test_the_recorded_phantom(self):
        script = roslib.packages.find_node('meshless_surgery', 'spawn_phantom.py')[0]
        with tempfile.TemporaryDirectory() as folder:
            done = subprocess.run([script, '--out', os.path.join(folder, 'phantom.bag'), '--node', self.node.name],
                                  stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=LONG, text=True)
        self.assertEqual(0, done.returncode, done.stdout)
        self.assertIn('added phantom', done.stdout)
        self.assertIn('1 were not finite', done.stdout)
        body = self.node.good('get_body', name='phantom')
        volume = 4.0 / 3.0 * np.pi * 0.06 * 0.035 * 0.025
        self.assertAlmostEqual(volume, body.volume, delta=0.05 * volume, msg=done.stdout)
        corners = np.array([(p.x, p.y, p.z) for p in body.surface.vertices])
        # Where the camera's frame puts it.
        self.assertLess(np.abs(corners.min(axis=0) - (-0.06, -0.02, 0.075)).max(), 0.005)
        self.assertLess(np.abs(corners.max(axis=0) - (0.06, 0.05, 0.125)).max(), 0.005)

    def test_layouts_of_clouds(self):
        for number, cloud in enumerate((cloud_of(ball()), cloud_of(ball(), np.float64), cloud_of(ball(), before=8),
                                        cloud_of(ball(), rows=100, pad=20))):
            answer = self.node.good('spawn_cloud', cloud=cloud)
            self.assertEqual('cloud' if number == 0 else 'cloud_%d' % (number + 1), answer.name)
            self.assertGreater(answer.points, 500)
            body = self.node.good('get_body', name=answer.name)
            self.assertAlmostEqual(BALL, body.volume, delta=0.05 * BALL)
            self.assertEqual(answer.triangles, len(body.surface.triangles))
            middle = np.mean([(p.x, p.y, p.z) for p in body.surface.vertices], axis=0)
            self.assertLess(np.abs(middle - (0.2, 0.0, 0.1)).max(), 0.002)

    def test_refusals(self):
        code, cloud = SpawnCloudResponse, cloud_of(ball(2000))
        argument = code.INVALID_ARGUMENT
        self.refused(argument, ['topic is empty', 'one of them'])
        self.refused(argument, ['cloud and topic', 'one of them'], cloud=cloud, topic='/a')
        self.refused(argument, ["topic is '/a b'"], topic='/a b')
        self.refused(code.MISSED, ["'/nobody'", 'within 0.1 s'], topic='/nobody', timeout=0.1)
        for field, bad in (('timeout', -1.0), ('scale', -1.0), ('voxel', -0.1), ('outliers', -1.0), ('scale', float('nan')),
                           ('timeout', 61.0), ('outliers', float('inf'))):
            self.refused(argument, [field + ' is', 'accepted'], cloud=cloud, **{field: bad})
        self.refused(argument, ['voxel is 1 m', 'accepted for this cloud'], cloud=cloud, voxel=1.0)
        self.refused(argument, ["name is 'a/b'"], cloud=cloud, name='a/b')
        self.refused(code.UNKNOWN_NAME, ["'nowhere'", 'tf2'], cloud=cloud_of(ball(2000), frame='nowhere'))
        self.refused(code.UNKNOWN_NAME, ["material is 'none'"], cloud=cloud, material='none')
        self.refused(code.DUPLICATE_NAME, ['box'], cloud=cloud, name='box')
        self.refused(code.UNSUITABLE_SHAPE, ['3 finite points'], cloud=cloud_of(ball(3)))
        for change, words in ((dict(is_bigendian=True), ['big-endian']), (dict(fields=cloud.fields[:2]), ['x, y and z']),
                              (dict(data=cloud.data[:-1]), ['bytes', 'row_step']), (dict(row_step=5), ['row_step of 5']),
                              (dict(height=4000000000), ['4000000000']), (dict(point_step=8), ['.z', 'byte 8 of 8'])):
            self.refused(argument, words, cloud=PointCloud2(**{**{name: getattr(cloud, name) for name in cloud.__slots__}, **change}))
        fields = [PointField(f.name, f.offset, PointField.UINT32, 1) for f in cloud.fields]
        self.refused(argument, ['.x', 'datatype 6', '7 (FLOAT32)'], cloud=cloud_with(cloud, fields))


def cloud_with(cloud, fields):
    return PointCloud2(**{**{name: getattr(cloud, name) for name in cloud.__slots__}, 'fields': fields})


if __name__ == '__main__':
    run('spawn_cloud', SpawnCloudTest)
