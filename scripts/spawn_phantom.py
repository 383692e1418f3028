#!/usr/bin/env python3
"""A body from a recorded cloud: makes a bag of what a depth camera sees of an organ phantom, and spawns that.

rosrun meshless_surgery spawn_phantom.py --out phantom.bag                  the bag alone
rosrun meshless_surgery spawn_phantom.py --node /deformer                   makes it, plays it and spawns the phantom
"""
import argparse
import sys

import numpy as np
import rosbag
import rospy
from geometry_msgs.msg import Quaternion, TransformStamped, Vector3
from meshless_surgery import Surgeon, SurgeryError
from meshless_surgery.errors import need_master
from sensor_msgs.msg import PointCloud2, PointField
from tf2_msgs.msg import TFMessage

CLOUD, FRAME = '/camera/points', 'camera'
NOISE = 0.0003  # [m]
STRAY = 30
# The camera is 0.5 m above the table and looks down on it.
CAMERA = TransformStamped(child_frame_id=FRAME)
CAMERA.header.frame_id = 'world'
CAMERA.transform.translation = Vector3(0.0, 0.0, 0.5)
CAMERA.transform.rotation = Quaternion(1.0, 0.0, 0.0, 0.0)


def phantom(points, random):
    """Points of a bean's surface, 0.12 m long, about the world's (0, 0, 0.1)."""
    out = random.normal(size=(points, 3))
    out /= np.linalg.norm(out, axis=1)[:, None]
    bean = out * (0.06, 0.035, 0.025)
    bean[:, 1] += 0.015 * (1.0 - (bean[:, 0] / 0.06) ** 2)  # bent
    return bean + (0.0, 0.0, 0.1)


def cloud_of(points, stamp):
    data = np.ascontiguousarray(points, dtype=np.float32)
    fields = [PointField(name, 4 * k, PointField.FLOAT32, 1) for k, name in enumerate('xyz')]
    cloud = PointCloud2(height=1, width=len(data), fields=fields, point_step=12, row_step=12 * len(data), is_dense=False,
                        data=data.tobytes())
    cloud.header.stamp, cloud.header.frame_id = stamp, FRAME
    return cloud


def make_bag(path, points=30000, clouds=5, seed=1):
    random = np.random.default_rng(seed)
    with rosbag.Bag(path, 'w') as bag:
        begin = rospy.Time(1000)
        CAMERA.header.stamp = begin
        bag.write('/tf_static', TFMessage([CAMERA]), begin)
        for number in range(clouds):
            stamp = begin + rospy.Duration.from_sec(0.2 * number)
            seen = phantom(points, random) + random.normal(scale=NOISE, size=(points, 3))
            stray = random.uniform(-0.15, 0.15, size=(STRAY, 3)) + (0.0, 0.0, 0.1)
            seen = np.vstack((seen, stray, np.full((1, 3), np.nan)))
            # Into the camera's frame, which is turned by half a turn about x.
            bag.write(CLOUD, cloud_of((seen - (0.0, 0.0, 0.5)) * (1.0, -1.0, -1.0), stamp), stamp)


def play(path):
    """As rosbag play does, but with the stamps of now."""
    publishers = {CLOUD: rospy.Publisher(CLOUD, PointCloud2, queue_size=1, latch=True),
                  '/tf_static': rospy.Publisher('/tf_static', TFMessage, queue_size=1, latch=True)}
    with rosbag.Bag(path) as bag:
        for topic, message, _ in bag.read_messages():
            for header in [message.header] if topic == CLOUD else [each.header for each in message.transforms]:
                header.stamp = rospy.Time(0)
            publishers[topic].publish(message)
    return publishers


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--out', default='phantom.bag', help='the bag')
    parser.add_argument('--node', help='spawn it there')
    options = parser.parse_args(rospy.myargv()[1:])
    if options.node:
        try:
            need_master()
        except SurgeryError as error:
            sys.exit(str(error))
    make_bag(options.out)
    print('%s has %s and /tf_static' % (options.out, CLOUD))
    if not options.node:
        return 0
    rospy.init_node('spawn_phantom', anonymous=True)
    publishers = play(options.out)
    try:
        answer = Surgeon(options.node).spawn_cloud(name='phantom', topic=CLOUD, voxel=0.005, material='liver')
    except SurgeryError as error:
        print(error)
        return 1
    print(answer.message)
    del publishers
    return 0


if __name__ == '__main__':
    sys.exit(main())
