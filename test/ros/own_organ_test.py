#!/usr/bin/env python3
"""docs/own_organ.md: its files and commands, as they are printed, on an STL in millimetres; and each of its mistakes."""
import os
import re
import struct
import subprocess
import sys

import roslib.packages

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from deformer_support import run  # noqa: E402
from page_support import PageTestCase  # noqa: E402

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


class OwnOrganTest(PageTestCase):

    name = 'own_organ.md'

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        make_meshes = roslib.packages.find_node('meshless_surgery', 'make_meshes')[0]
        subprocess.run([make_meshes, '--out', cls.folder], check=True, stdout=subprocess.DEVNULL)
        # In the patient's coordinates.
        cls.organ = moved(read_obj(os.path.join(cls.folder, 'liver.obj')), 1000, (-20, 130, -900))

    def setUp(self):
        super().setUp()
        self.write('organ.stl', stl(self.organ))

    def test_the_page_from_the_file_to_the_pieces(self):
        self.check_setup()
        with self.running(self.launch()):
            output = self.good([command for command in self.commands if command.startswith('python3')][0])
        self.assertIn('size: 0.217 0.154 0.093 m', output)
        self.assertIn(re.search('pose: .*', output).group(), self.files['organ.yaml'])
        with self.running(self.launch().replace('look.yaml', 'organ.yaml')) as end:
            output = self.good(re.search(r'run `(python3 cut.py)`', self.page).group(1))
            log = end()
        self.assertIn('into 2 pieces', output)
        volumes = [float(v) for v in re.findall(r'organ\.\d: (\d+) ml', output)]
        self.assertEqual(2, len(volumes), output)
        self.assertAlmostEqual(1207, sum(volumes), delta=40)
        self.assertGreater(min(volumes), 200)
        self.assertIn('of it is held', log)

    def test_a_hollow_organ_grows_by_as_much_as_the_page_says(self):
        stiff, grown = re.search(r'With r = 4 cm, t = 4 mm and 1 kPa, E = (\d+) kPa grows by (\d+) %', self.page).groups()
        modulus, soft, formula = re.search(r'of liver \(([\d.]+) kPa\), 100 Pa make (\d+) %, where the formula has (\d+)', self.page).groups()
        self.write('hollow.yaml', 'world: {ground: none, gravity: [0, 0, 0], contact: none}\nbodies:\n' + ''.join(
            '  - {name: %s, primitive: {sphere: 0.04}, thickness: 0.004, cavities: {pressure: %s}, pose: {position: [%s, 0, 0]},\n'
            '     material: {youngs_modulus: %s, poissons_ratio: 0.45, density: 1060, damping: 30}}\n' % body
            for body in (('stiff', 1000, 0, 1e3 * float(stiff)), ('soft', 100, 1, 1e3 * float(modulus)))))
        self.write('hollow.py', "import rospy\nfrom meshless_surgery import Surgeon\nrospy.init_node('hollow')\nsurgeon = Surgeon('/deformer')\n"
                                "surgeon.step(1200)\nfor body in surgeon.state().bodies:\n"
                                "    rest = surgeon.body(body.name, rest=True).cavities[0].volume\n"
                                "    print('%s %.1f' % (body.name, 100 * (body.cavities[0].volume / rest - 1)))\n")
        with self.running(self.node('$PWD/hollow.yaml', paused='true')):
            said = dict(line.split() for line in self.good('python3 hollow.py').splitlines())
        self.assertAlmostEqual(float(grown), float(said['stiff']), delta=0.7)
        self.assertAlmostEqual(float(soft), float(said['soft']), delta=1.0)
        for pressure, of, growth in ((1000, stiff, grown), (100, modulus, formula)):
            self.assertAlmostEqual(float(growth), 100 * 3 * pressure * 0.04 * 0.55 / (2 * 1e3 * float(of) * 0.004), delta=0.5)

    def loaded(self, *clients, **files):
        """What the node says of the changed files, and the clients meanwhile."""
        for name, content in files.items():
            self.write(name.replace('_', '.'), content)
        with self.running(self.node('$PWD/organ.yaml')) as end:
            return ''.join(self.shell('python3 ' + client)[1] for client in clients) + end()

    def test_what_is_said_of_each_mistake_is_what_the_page_says(self):
        scene = self.files['organ.yaml']
        no_units = re.sub(r'    (units|pose|fixed|  - box).*\n', '', scene)
        beside = self.files['cut.py'].replace('(0, -1, 0.1), reach=(0, 1, 0), normal=(1, 0, 0)',
                                              '(0, -1, 0.5), reach=(0, 1, 0), normal=(0, 0, 1)')
        far = self.files['cut.py'].replace('0.03), max_distance=0.1', '0.5), max_distance=0.05')
        lobe = moved(self.organ, 1.0, (0, 0, 15))
        lumen = [t[::-1] for t in moved(self.organ, 0.9, (-2, 13, -84))]
        half = [t for t in self.organ if max(corner[2] for corner in t) < -890]
        self.said_of({
            '`units: mm` forgotten': lambda: self.loaded(organ_yaml=no_units),
            'the same with a `thickness`': lambda: self.loaded(organ_yaml=no_units + '    thickness: 0.004\n'),
            '`pose` forgotten': lambda: self.loaded(organ_yaml=re.sub(r'    pose.*\n', '', scene)),
            'a lobe and its organ in one file': lambda: self.loaded(organ_stl=stl(self.organ + lobe)),
            'the same with `repair: none`':
                lambda: self.loaded(organ_stl=stl(self.organ + lobe), organ_yaml=scene.replace('mend', 'none')),
            'half of the surface is missing': lambda: self.loaded('cut.py', organ_stl=stl(half)),
            'the file was not copied to its end': lambda: self.loaded(organ_stl=stl(self.organ)[:100000]),
            'the file is elsewhere': lambda: self.loaded(organ_yaml=scene.replace('organ.stl', '/etc/hostname')),
            'a kind of file that is not read':
                lambda: self.loaded(organ_yaml=scene.replace('organ.stl', 'organ.glb'), organ_glb='x'),
            'too fine': lambda: self.loaded(organ_yaml=scene.replace('resolution: medium', 'spacing: 0.0015')),
            'the lumen reaches through the wall': lambda: self.loaded(organ_stl=stl(self.organ + lumen), organ_yaml=self.files['look.yaml']),
            'a misspelt material or key': lambda: self.loaded(organ_yaml=scene.replace('elastic_liver', 'elastc_liver')),
            'a cut or a pick beside the tissue': lambda: self.loaded('cut.py', 'far.py', cut_py=beside, far_py=far),
        })


if __name__ == '__main__':
    run('own_organ', OwnOrganTest)
