#!/usr/bin/python3
"""Frames a second of rviz, and its processor time for each, by triangles and settings of the Tissue display. A ball that
waves takes the place of a node; in the last rows it is a soft body of deformer_node at its defaults, led round by a pick.
rviz draws it on a display that nobody sees. Prints CSV. Needs a running roscore:

    bench/pictures.py --seconds 20 --pictures /tmp
"""
import argparse
import io
import os
import signal
import statistics
import struct
import subprocess
import sys
import tempfile
import time

import numpy
import rospkg
import rospy
import yaml
from meshless_surgery import Surgeon
from meshless_surgery.msg import BodyTopology, Look, Surface, Surfaces, TissueImage, TissueImages, Topology
from std_msgs.msg import ColorRGBA

PACKAGE = rospkg.RosPack().get_path('meshless_surgery')
sys.path.insert(0, os.path.join(PACKAGE, 'test', 'rviz'))
from virtual_display import VirtualDisplay  # noqa: E402

RADIUS, WAVES = 0.1, 60  # [m]; messages until it is where it was
# Counts what is shown, as rviz says it only in its window: frames a second, a line every two seconds.
COUNTER = r'''
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
void glXSwapBuffers(void *display, unsigned long window) {
  static void (*shown)(void *, unsigned long);
  static double since;
  static long count;
  struct timespec now;
  if (!shown) shown = (void (*)(void *, unsigned long))dlsym(RTLD_NEXT, "glXSwapBuffers");
  shown(display, window);
  clock_gettime(CLOCK_MONOTONIC, &now);
  double seconds = now.tv_sec + 1e-9 * now.tv_nsec;
  if (since == 0) since = seconds;
  ++count;
  if (seconds - since < 2) return;
  FILE *file = fopen(getenv("FRAMES"), "a");
  if (file) { fprintf(file, "%.3f\n", count / (seconds - since)); fclose(file); }
  since = seconds;
  count = 0;
}
'''


def ball(triangles):
    """Vertices and triangles of a cube of squares, blown up."""
    n = max(1, round((triangles / 12.0) ** 0.5))
    numbers, corners = {}, []
    for axis in range(3):
        for side in (0, n):
            for i in range(n):
                for j in range(n):
                    square = []
                    for di, dj in ((0, 0), (1, 0), (1, 1), (0, 1)) if side else ((0, 0), (0, 1), (1, 1), (1, 0)):
                        place = [side] * 3
                        place[(axis + 1) % 3], place[(axis + 2) % 3] = i + di, j + dj
                        square.append(numbers.setdefault(tuple(place), len(numbers)))
                    corners += [square[:3], [square[0], square[2], square[3]]]
    cube = numpy.array(list(numbers), float) / n * 2.0 - 1.0
    return RADIUS * cube / numpy.linalg.norm(cube, axis=1)[:, None], numpy.array(corners)


class Prepared(Surfaces):
    """A message whose bytes are ready but for its stamp."""
    prepared = b''

    def serialize(self, buff):
        now = rospy.Time.now()
        buff.write(self.prepared[:4] + struct.pack('<II', now.secs, now.nsecs) + self.prepared[12:])


class Waves:
    """A ball that waves, as a node would show it."""

    def __init__(self):
        self.node = rospy.get_name()
        self.topology = rospy.Publisher('~topology', Topology, queue_size=1, latch=True)
        self.images = rospy.Publisher('~images', TissueImages, queue_size=1, latch=True)
        self.surfaces = rospy.Publisher('~surfaces', Prepared, queue_size=1, tcp_nodelay=True)
        self.number = 0

    def show(self, triangles, look, cut, still):
        """Prepares what say() says."""
        rest, corners = ball(triangles)
        is_cut = numpy.zeros(len(corners), bool)
        if cut:  # its top is cut off
            is_cut = (rest[corners][:, :, 2] >= 0.5 * RADIUS).all(1)
            rest[:, 2] = numpy.minimum(rest[:, 2], 0.5 * RADIUS)
        self.number += 1
        red, pink, light = (ColorRGBA(*c, 1.0) for c in ((0.6, 0.2, 0.17), (0.8, 0.45, 0.4), (0.75, 0.4, 0.3)))
        noise = Look.IMAGE if look == 'mapped' else getattr(Look, look.upper())
        looks = [Look(noise=noise, color=color, second=light, scale=0.003, wetness=0.75, bump=0.1)
                 for color in (red, pink)]
        if noise == Look.IMAGE:
            spots = numpy.random.RandomState(1).randint(60, 200, (16, 16, 3)).astype(numpy.uint8).repeat(16, 0).repeat(16, 1)
            self.images.publish(TissueImages(images=[TissueImage(id=1, width=256, height=256, rgb=spots.tobytes())]))
            for one in looks:
                one.image, one.scale = 1, 0.08
        still_ball = dict(id=1, name='ball', color=red, inside_color=pink, triangles=corners.ravel().tolist(),
                          cut=is_cut.astype(numpy.uint8).tobytes())
        topology = Topology(run=1, topology=self.number)
        topology.header.frame_id = 'world'
        topology.bodies = [BodyTopology(vertices=len(rest), looks=looks, rest=rest.ravel().tolist(), **still_ball)]
        if look == 'mapped':  # by texture coordinates, not along the axes
            topology.bodies[0].uv = (0.6 / RADIUS * rest[corners][:, :, :2]).ravel().tolist()
        self.topology.publish(topology)
        self.messages = []
        for k in range(1 if still else WAVES):
            phase = 2.0 * numpy.pi * k / WAVES
            wave = 1.0 + 0.05 * numpy.sin(phase) * numpy.sin(3.0 * rest[:, 2] / RADIUS + phase)
            places = rest * wave[:, None] + (0.0, 0.0, RADIUS)
            message = Surfaces(run=1, topology=self.number, bodies=[Surface(vertices=places.ravel().tolist(), **still_ball)])
            message.header.frame_id = 'world'
            stream = io.BytesIO()
            Surfaces.serialize(message, stream)
            self.messages.append(Prepared())
            self.messages[-1].prepared = stream.getvalue()

    def say(self, rate, seconds):
        pace = rospy.Rate(rate)
        end = time.monotonic() + seconds
        said = 0
        while time.monotonic() < end:
            self.surfaces.publish(self.messages[said % len(self.messages)])
            said += 1
            pace.sleep()

    def real_time(self):
        return ''


class Body:
    """The node with a soft ball that is held below and led round by a pick above."""
    node = '/deformer'

    def show(self, triangles, look, cut, still):
        self.folder = tempfile.TemporaryDirectory()
        scene = os.path.join(self.folder.name, 'ball.yaml')
        rest, corners = ball(triangles)
        with open(os.path.join(self.folder.name, 'ball.obj'), 'w') as file:
            file.writelines('v %r %r %r\n' % tuple(v) for v in rest.tolist())
            file.writelines('f %d %d %d\n' % tuple(t) for t in (corners + 1).tolist())
        with open(scene, 'w') as file:
            yaml.safe_dump({'bodies': [{
                'name': 'ball', 'file': 'ball.obj', 'pose': {'position': [0.0, 0.0, RADIUS]}, 'material': 'elastic_liver',
                'fixed': [{'plane': {'normal': [0.0, 0.0, 1.0], 'point': [0.0, 0.0, 0.3 * RADIUS]}}]}]}, file)
        self.process = subprocess.Popen(['rosrun', 'meshless_surgery', 'deformer_node', '__name:=' + self.node[1:], '_scene:=' + scene],
                                        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self.surgeon = Surgeon(self.node)
        self.start = numpy.array([0.0, 0.0, 2.0 * RADIUS])
        self.pick = self.surgeon.pick(self.start + (0.0, 0.0, 0.02), (0.0, 0.0, -1.0), max_distance=0.05).pick_id
        self.turned = 0.0

    def say(self, rate, seconds):
        pace = rospy.Rate(rate)
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self.turned += 3.0 / rate
            self.surgeon.move(self.pick, self.start + 0.03 * numpy.array([numpy.sin(self.turned), 1.0 - numpy.cos(self.turned), 0.0]))
            pace.sleep()

    def real_time(self):
        return '%.2f' % self.surgeon.state().real_time_factor

    def close(self):
        self.process.send_signal(signal.SIGINT)
        self.process.wait()
        self.folder.cleanup()


def processor_time(process):
    with open('/proc/%d/stat' % process.pid) as stat:
        return sum(int(ticks) for ticks in stat.read().rsplit(')', 1)[1].split()[11:13]) / os.sysconf('SC_CLK_TCK')


def configuration(file, node, frame_rate, settings):
    with open(os.path.join(PACKAGE, 'config', 'rviz', 'liver.rviz')) as text:
        config = yaml.safe_load(text)
    manager = config['Visualization Manager']
    manager['Displays'] = [d for d in manager['Displays'] if d['Name'] == 'Tissue']
    manager['Displays'][0].update(settings, Node=node)
    manager['Global Options']['Frame Rate'] = frame_rate
    manager['Views']['Current'].update({'Focal Point': {'X': 0.0, 'Y': 0.0, 'Z': RADIUS}, 'Distance': 0.36, 'Yaw': 0.6, 'Pitch': 0.5})
    yaml.safe_dump(config, file)
    file.flush()


def measure(source, display, counter, options, row):
    triangles, rate, look, cut, still, settings = row
    source.show(triangles, look, cut, still)
    with tempfile.TemporaryDirectory() as folder, open(os.path.join(folder, 'view.rviz'), 'w') as file:
        configuration(file, source.node, options.frame_rate, settings)
        frames = os.path.join(folder, 'frames')
        open(frames, 'w').close()
        rviz = subprocess.Popen(['rviz', '-d', file.name], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                                env=dict(display.environment, LD_PRELOAD=counter, FRAMES=frames))
        try:
            counted = lambda: [float(line) for line in open(frames)]  # noqa: E731
            while len(counted()) < 2:
                source.say(rate, 1.0)
            source.say(rate, 3.0)
            before, since, spent = len(counted()), time.monotonic(), processor_time(rviz)
            source.say(rate, options.seconds)
            seconds, spent = time.monotonic() - since, processor_time(rviz) - spent
            shown = statistics.median(counted()[before:])
            print('%d,%g,%s,%d,%d,%s,%.1f,%.1f,%s' % (triangles, rate, look, cut, still, ' '.join('%s=%s' % s for s in sorted(settings.items())),
                                                   shown, 1e3 * spent / (shown * seconds), source.real_time()), flush=True)
            if options.pictures:
                display.save(os.path.join(options.pictures, '%s%s.png' % (look, '_cut' if cut else '')))
        finally:
            rviz.send_signal(signal.SIGINT)
            rviz.wait()


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--seconds', type=float, default=20.0, help='of each row')
    parser.add_argument('--frame-rate', type=int, default=60, help='the most that rviz is asked for')
    parser.add_argument('--pictures', help='a folder for a picture of each look')
    options = parser.parse_args(rospy.myargv()[1:])
    rospy.init_node('pictures')
    waves, body, display = Waves(), Body(), VirtualDisplay()
    try:
        with tempfile.TemporaryDirectory() as folder:
            source, counter = os.path.join(folder, 'counter.c'), os.path.join(folder, 'counter.so')
            with open(source, 'w') as file:
                file.write(COUNTER)
            subprocess.run(['cc', '-shared', '-fPIC', '-O1', '-o', counter, source, '-ldl'], check=True)
            print('triangles,messages [1/s],look,cut,still,settings,frames [1/s],processor [ms a frame],real time of a node')
            for triangles in (10000, 50000):
                for row in [(60.0, 'lobules', False, False, {'Shine': shine}) for shine in (True, False)] + \
                        [(60.0, look, cut, False, {}) for look, cut in (('plain', False), ('image', False), ('mapped', False), ('lobules', True))] + \
                        [(60.0, 'lobules', False, True, {})] + \
                        [(20.0, 'lobules', False, False, {'Smooth motion': smooth}) for smooth in (False, True)]:
                    measure(waves, display, counter, options, (triangles,) + row)
                for shine in (True, False):
                    try:
                        measure(body, display, counter, options, (triangles, 60.0, 'node', False, False, {'Shine': shine}))
                    finally:
                        body.close()
    finally:
        display.close()


if __name__ == '__main__':
    main()
