#!/usr/bin/env python3
"""Includes go one way between the rooms: what a room may include, and which library stays where. docs/architecture.md
explains why."""
import os
import re
import tempfile
import unittest

CHECKOUT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))

# Room -> the other rooms whose headers it may include. The last two are the folders of the executables' main files.
MAY_INCLUDE = {
    'base': set(),
    'geometry': {'base'},
    'appearance': {'base'},
    'dynamics': {'base', 'geometry', 'appearance'},
    'contact': {'base', 'geometry'},
    'body': {'base', 'geometry', 'dynamics'},
    'tools': {'base', 'geometry', 'body', 'contact'},
    'world': {'base', 'geometry', 'appearance', 'dynamics', 'contact', 'body', 'tools'},
    'training': {'base', 'geometry', 'dynamics', 'body', 'tools', 'world'},
    'io': {'base', 'geometry', 'appearance', 'body', 'world', 'training'},
    'ros': {'base', 'appearance', 'world', 'tools', 'training', 'io'},
    'rviz': set(),
    'tools_main': {'base', 'geometry', 'io', 'world', 'training'},
    'node_main': {'base', 'ros'},
}

# Library -> how its includes begin, and where they may stand: a function of room and path.
LIBRARIES = {
    'ROS': (re.compile(r'(ros|tf2|tf2_ros|rviz|rosbag|pluginlib|class_loader|nodelet|diagnostic_updater|actionlib|'
                       r'message_filters|dynamic_reconfigure|interactive_markers|image_transport|pcl_conversions|'
                       r'pcl_ros|std_srvs|tf2_\w+|\w+_msgs|XmlRpc\w*|xmlrpcpp)([/.]|$)|meshless_surgery/[A-Z]\w*\.h$'),
            lambda room, path: room in ('ros', 'rviz', 'node_main')),
    'PCL': (re.compile(r'pcl(_conversions|_ros)?/'), lambda room, path: room == 'io'),
    'CGAL': (re.compile(r'CGAL/'),
             lambda room, path: room == 'geometry' and path.startswith('src/') and path.endswith('.cpp')),
    'Qt and Ogre': (re.compile(r'Q[A-Z]\w*$|Qt\w*/|OGRE/|Ogre\w*\.h$'), lambda room, path: room == 'rviz'),
}

INCLUDE = re.compile(r'^\s*#\s*include\s*[<"]([^>"]+)[>"]', re.MULTILINE)
SOURCE_ENDINGS = ('.h', '.hpp', '.cpp', '.cc', '.inl', '.in')


def roomOf(path):
    """The room of include/meshless_surgery/ROOM/... or src/ROOM/...; None elsewhere."""
    match = re.match(r'(?:include/meshless_surgery|src)/([^/]+)/', path)
    return match.group(1) if match else None


def violations(path, text):
    """What is wrong with the includes of one file; path is relative to the checkout."""
    room = roomOf(path)
    if room not in MAY_INCLUDE:
        return ['%s: is in no room that this test knows' % path]
    found = []
    for include in INCLUDE.findall(text):
        other = re.match(r'meshless_surgery/([^/]+)/', include)
        if other and other.group(1) not in MAY_INCLUDE:
            found.append('%s: "%s" is in no room that this test knows' % (path, include))
        elif other and other.group(1) != room and other.group(1) not in MAY_INCLUDE[room]:
            found.append('%s: %s may not include %s ("%s")' % (path, room, other.group(1), include))
        if '..' in include.split('/'):
            found.append('%s: "%s" leaves its folder; write meshless_surgery/ROOM/FILE' % (path, include))
        for library, (pattern, is_allowed) in LIBRARIES.items():
            if pattern.match(include) and not is_allowed(room, path):
                found.append('%s: %s does not belong here ("%s")' % (path, library, include))
    return found


def sourceFiles(checkout):
    """The sources below include/ and src/, relative to the checkout, in order."""
    for top in ('include', 'src'):
        for folder, folders, files in os.walk(os.path.join(checkout, top)):
            folders.sort()
            for name in sorted(files):
                if name.endswith(SOURCE_ENDINGS):
                    yield os.path.relpath(os.path.join(folder, name), checkout)


def violationsBelow(checkout):
    found = []
    for path in sourceFiles(checkout):
        with open(os.path.join(checkout, path), encoding='utf-8') as source:
            found += violations(path, source.read())
    return found


class IncludeDirectionTest(unittest.TestCase):
    def testEveryIncludeGoesTheRightWay(self):
        self.assertEqual([], violationsBelow(CHECKOUT))

    def testEverySourceIsRead(self):
        rooms = {roomOf(path) for path in sourceFiles(CHECKOUT)}
        for room in ('base', 'geometry', 'appearance', 'dynamics', 'contact', 'body', 'tools', 'world', 'training', 'io'):
            self.assertIn(room, rooms)

    def testTheTableHasNoCircle(self):
        reached = {}

        def reach(room, above):
            self.assertNotIn(room, above)
            if room not in reached:
                reached[room] = True
                for other in MAY_INCLUDE[room]:
                    reach(other, above | {room})

        for room in MAY_INCLUDE:
            reach(room, frozenset())


class WrongIncludeTest(unittest.TestCase):
    """The test above is worth something only if it finds what is wrong."""

    def assertWrong(self, path, include):
        self.assertEqual(1, len(violations(path, '#include <vector>\n#include %s\n' % include)), (path, include))

    def assertRight(self, path, include):
        self.assertEqual([], violations(path, '#include <vector>\n#include %s\n' % include))

    def testRooms(self):
        self.assertWrong('src/geometry/surgery/cut.cpp', '"meshless_surgery/body/body.h"')
        self.assertWrong('src/dynamics/clusters.cpp', '"meshless_surgery/contact/textbook.h"')
        self.assertWrong('include/meshless_surgery/contact/textbook.h', '"meshless_surgery/dynamics/clusters.h"')
        self.assertWrong('include/meshless_surgery/tools/tools.h', '"meshless_surgery/world/world.h"')
        self.assertWrong('src/world/world.cpp', '"meshless_surgery/io/scene.h"')
        self.assertWrong('src/rviz/pick_tool.cpp', '"meshless_surgery/base/types.h"')
        self.assertWrong('src/tools_main/replay.cpp', '"meshless_surgery/ros/runner.h"')
        self.assertWrong('src/geometry/surgery/cut.cpp', '"meshless_surgery/attic/old.h"')
        self.assertWrong('src/attic/old.cpp', '<string>')
        self.assertRight('src/geometry/surgery/cut.cpp', '"meshless_surgery/geometry/query/plane.h"')
        self.assertRight('src/world/world.cpp', '"meshless_surgery/dynamics/rotation.h"')

    def testSpellings(self):
        self.assertWrong('src/base/ids.cpp', '  <meshless_surgery/world/world.h>')
        self.assertEqual(1, len(violations('src/base/ids.cpp', '  #  include\t<ros/ros.h>  // why\n')))
        self.assertEqual([], violations('src/base/ids.cpp', '// not #include <ros/ros.h>\n'))
        self.assertWrong('src/geometry/surgery/cut.cpp', '"../geometry/private.h"')

    def testLibraries(self):
        for include in ('<ros/ros.h>', '<geometry_msgs/Point.h>', '<std_srvs/Trigger.h>', '<tf2_ros/buffer.h>',
                        '"meshless_surgery/Pick.h"', '<pluginlib/class_list_macros.hpp>'):
            self.assertWrong('src/world/world.cpp', include)
            self.assertRight('src/ros/node.cpp', include)
        for include in ('<pcl/io/pcd_io.h>', '<pcl/point_types.h>'):
            self.assertWrong('include/meshless_surgery/geometry/query/nearest.h', include)
            self.assertWrong('src/ros/node.cpp', include)
            self.assertRight('src/io/files.cpp', include)
        self.assertWrong('include/meshless_surgery/geometry/mesh/tetrahedralize.h', '<CGAL/Delaunay_triangulation_3.h>')
        self.assertWrong('src/body/body.cpp', '<CGAL/Delaunay_triangulation_3.h>')
        self.assertRight('src/geometry/mesh/tetrahedralize.cpp', '<CGAL/Delaunay_triangulation_3.h>')
        self.assertWrong('src/ros/node.cpp', '<QWidget>')
        self.assertRight('src/rviz/pick_tool.cpp', '<QWidget>')

    def testAFileInATree(self):
        with tempfile.TemporaryDirectory() as checkout:
            folder = os.path.join(checkout, 'src', 'body')
            os.makedirs(folder)
            with open(os.path.join(folder, 'body.cpp'), 'w', encoding='utf-8') as source:
                source.write('#include "meshless_surgery/world/world.h"\n')
            found = violationsBelow(checkout)
        self.assertEqual(1, len(found))
        self.assertIn('src/body/body.cpp', found[0])
        self.assertIn('body may not include world', found[0])


if __name__ == '__main__':
    unittest.main()
