#!/usr/bin/env python3
"""package.xml, CMake, scripts/packages.txt and debian/control declare what the sources use, and nothing else; all say one version."""
import glob
import os
import re
import sys
import unittest
import xml.etree.ElementTree

CHECKOUT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))

# How includes begin -> the key of package.xml. '': the compiler's, the system's and our own.
INCLUDES = (
    (r'ros/package\.h', 'roslib'), (r'ros/|XmlRpcValue\.h', 'roscpp'), (r'(pluginlib|rviz|diagnostic_updater|tf2|tf2_eigen|tf2_ros|actionlib)/', None),
    (r'\w+_(msgs|srvs)/', None), (r'(Eigen|unsupported/Eigen)/', 'eigen'), (r'CGAL/', 'libcgal-dev'), (r'pcl/', 'libpcl-all-dev'),
    (r'yaml-cpp/', 'yaml-cpp'), (r'tbb/', 'tbb'), (r'zlib\.h', 'zlib'), (r'jpeglib\.h', 'libjpeg'), (r'png\.h', 'libpng-dev'), (r'nanoflann\.hpp', 'libnanoflann-dev'),
    (r'cereal/', 'libcereal-dev'), (r'utf8\.h$', 'libpcl-all-dev'), (r'CLI/', 'cli11'), (r'(Q[A-Z]\w*|Qt\w*/.*)$', 'qtbase5-dev'), (r'Ogre\w*\.h', 'rviz'),
    (r'gtest/', 'gtest'), (r'benchmark/', 'libbenchmark-dev'), (r'(BulletSoftBody/|bt\w+\.h)', 'bullet'),
    (r'(sys/\w+|unistd|immintrin|xmmintrin|fcntl|malloc|time|limits|dirent|execinfo|stdio|signal|poll|sched)(\.h)?$', ''),
    (r'meshless_surgery/', ''), (r'[a-z_]+$', ''),
)
# What runs when a library of that header runs; the others are templates, or their run time has a name of its own.
LINKED = {'roscpp', 'roslib', 'actionlib', 'diagnostic_updater', 'tf2', 'tf2_ros', 'libcgal-dev', 'libpcl-all-dev', 'yaml-cpp', 'tbb', 'zlib',
          'libjpeg', 'libpng-dev', 'pluginlib', 'rviz'}
MODULES = {'numpy': 'python3-numpy', 'yaml': 'python3-yaml', 'rospkg': 'python3-rospkg-modules', 'tf2_ros': 'tf2_ros'}
ROS_MODULES = {'rospy', 'roslib', 'rosgraph', 'rosunit', 'rostest', 'tf2_ros', 'genpy', 'actionlib', 'rosbag', 'roslaunch', 'rosnode', 'dynamic_reconfigure'}
# Programs that tests and scripts start by name.
PROGRAMS = {'rosrun': 'rosbash', 'roslaunch': 'roslaunch', 'rosmaster': 'rosmaster', 'rostest': 'rostest', 'rviz': 'rviz',
            'rosbag': 'rosbag', 'rosnode': 'rosnode', 'ip': '', 'Xvfb': 'xvfb', 'xdotool': 'xdotool', 'import': 'imagemagick'}
# Key of package.xml -> Debian's packages, where they have other names than the key of ROS.
DEBIAN = {
    'catkin': ['catkin'], 'eigen': ['libeigen3-dev'], 'libcgal-dev': ['libcgal-dev'], 'libpcl-all-dev': ['libpcl-dev', 'libutfcpp-dev'],
    'yaml-cpp': ['libyaml-cpp-dev'], 'tbb': ['libtbb-dev'], 'zlib': ['zlib1g-dev'], 'libjpeg': ['libjpeg-dev'], 'libpng-dev': ['libpng-dev'], 'libnanoflann-dev': ['libnanoflann-dev'],
    'libcereal-dev': ['libcereal-dev'], 'cli11': ['libcli11-dev'], 'qtbase5-dev': ['qtbase5-dev'], 'libqt5-widgets': [],
    'gtest': ['libgtest-dev'], 'libbenchmark-dev': ['libbenchmark-dev'], 'bullet': ['libbullet-dev'], 'rviz': ['rviz', 'librviz-dev'],
    'pluginlib': ['pluginlib-dev'], 'python3-numpy': ['python3-numpy'], 'python3-yaml': ['python3-yaml'],
    'python3-rospkg-modules': ['python3-rospkg'], 'xvfb': ['xvfb'], 'xdotool': ['xdotool'], 'imagemagick': ['imagemagick'],
    'rosbash': ['rosbash'], 'message_generation': ['ros-message-generation'], 'message_runtime': ['ros-message-runtime'],
    'roscpp': ['libroscpp-dev'], 'roslib': ['libroslib-dev'], 'rostest': ['librostest-dev', 'python3-rostest'],
    'tf2': ['libtf2-dev'], 'tf2_eigen': ['libtf2-eigen-dev'], 'tf2_ros': ['libtf2-ros-dev', 'python3-tf2-ros'], 'diagnostic_updater': ['libdiagnostic-updater-dev'],
    'actionlib': ['libactionlib-dev', 'python3-actionlib'],
    'rosgraph_msgs': [], 'genpy': [], 'rosgraph': [], 'rosunit': [], 'tf2_msgs': ['libtf2-msgs-dev', 'ros-tf2-msgs'],  # come with rospy, rostest
}
# Debian's package for running, of keys whose libraries do not bring it along (${shlibs:Depends}); else python3-NAME.
RUNNING = {'libqt5-widgets': None, 'rviz': 'rviz', 'message_runtime': 'ros-message-runtime', 'python3-numpy': 'python3-numpy', 'python3-yaml': 'python3-yaml'}
# CMake's package -> the key. Those of catkin have the key's name.
FOUND = {'Eigen3': 'eigen', 'CGAL': 'libcgal-dev', 'nanoflann': 'libnanoflann-dev', 'yaml-cpp': 'yaml-cpp', 'cereal': 'libcereal-dev',
         'ZLIB': 'zlib', 'JPEG': 'libjpeg', 'PNG': 'libpng-dev', 'PCL': 'libpcl-all-dev', 'TBB': 'tbb', 'CLI11': 'cli11', 'Qt5': 'qtbase5-dev', 'GTest': 'gtest',
         'benchmark': 'libbenchmark-dev', 'BULLET': 'bullet', 'utf8cpp': 'libpcl-all-dev', 'Threads': '', 'PkgConfig': ''}


def read(path):
    with open(os.path.join(CHECKOUT, path), errors='replace') as file:
        return file.read()


def files(*patterns):
    found = []
    for pattern in patterns:
        found += glob.glob(os.path.join(CHECKOUT, pattern), recursive=True)
    return sorted(found)


def key_of(include):
    for pattern, key in INCLUDES:
        if re.match(pattern, include):
            return include.split('/')[0] if key is None else key
    return 'nobody knows <%s>' % include


def included(*folders):
    """The keys of what C++ in there includes with angles."""
    names = set()
    for path in files(*(folder + '/**/*.' + ending for folder in folders for ending in ('cpp', 'h'))):
        names |= set(re.findall(r'^\s*#\s*include\s*<([^>]+)>', read(path), re.MULTILINE))
    return {key_of(name) for name in names} - {''}


def imported(paths):
    own = {os.path.splitext(os.path.basename(path))[0] for path in files('**/*.py')} | {'meshless_surgery'}
    keys = set()
    for path in paths:
        for module in re.findall(r'^\s*(?:import|from) +(\w+)[^\n]*$', re.sub(r'""".*?"""', '', read(path), flags=re.DOTALL),
                                 re.MULTILINE):
            if module in own or module in sys.stdlib_module_names or module == '__future__':
                continue
            plain = module in ROS_MODULES or re.search(r'_(msgs|srvs)$', module)
            keys.add(MODULES.get(module) or (module if plain else 'nobody knows ' + module))
    return keys


def started(paths):
    words = set()
    for path in paths:
        words |= set(re.findall(r"\['(\w+)'", read(path)))
    return {PROGRAMS[word] for word in words & set(PROGRAMS)} - {''}


def launched(paths):
    optional = {'diagnostic_aggregator'}  # not in Debian
    return {'roslaunch'} | {name for path in paths for name in re.findall(r'pkg="(\w+)"', read(path))} - {'meshless_surgery'} - optional


def declared(*tags):
    root = xml.etree.ElementTree.parse(os.path.join(CHECKOUT, 'package.xml')).getroot()
    return {entry.text for tag in tags for entry in root.findall(tag)}


def debian(key):
    """Debian's packages of a key of package.xml, as scripts/packages.txt lists them."""
    name = key.replace('_', '-')
    messages = re.search(r'_(msgs|srvs)$', key)
    return DEBIAN.get(key, ['ros-' + name, 'lib%s-dev' % name, 'python3-' + name] if messages else ['python3-' + name])


def control(field):
    """The packages of a field of debian/control, without versions."""
    text = re.search(r'^%s:(.*?)(?=^\S)' % field, read('debian/control') + 'End:', re.MULTILINE | re.DOTALL).group(1)
    return {re.sub(r' *\(.*', '', name).strip() for name in text.split(',')} - {''}


def in_messages():
    return {match for path in files('msg/*.msg', 'srv/*.srv', 'action/*.action')
            for match in re.findall(r'^(\w+)/\w+', read(path), re.MULTILINE)} | {'std_msgs', 'actionlib_msgs'}  # Header; each action


@unittest.skipIf(sys.version_info < (3, 10), 'Python 3.10 knows the names of its own modules')
class PackageTest(unittest.TestCase):

    maxDiff = None

    def setUp(self):
        self.build = included('src', 'include') | in_messages()
        self.exec = {key for key in self.build if key in LINKED or re.search(r'_(msgs|srvs)$', key)}
        self.exec |= imported(files('python/**/*.py', 'scripts/*.py')) | launched(files('launch/*.launch'))
        tests = files('test/**/*.py', 'test/support/*.py', 'bench/*.py')
        self.test = included('test', 'bench') | imported(tests) | started(tests)

    def test_what_building_needs(self):
        self.assertEqual(sorted(self.build | {'catkin', 'message_generation'}),
                         sorted(declared('depend', 'build_depend', 'buildtool_depend')))

    def test_what_running_needs(self):
        self.assertEqual(sorted(self.exec | {'message_runtime', 'libqt5-widgets'}), sorted(declared('depend', 'exec_depend')))

    def test_what_tests_need_beyond_it(self):
        others = declared('depend', 'build_depend', 'exec_depend')
        self.assertEqual(sorted(self.test - others), sorted(declared('test_depend')))

    def test_cmake_finds_what_it_builds_with(self):
        cmake = re.sub(r'#.*', '', '\n'.join(read(path) for path in files('CMakeLists.txt', 'cmake/*.cmake')))
        found = {FOUND.get(name, name) for name in re.findall(r'(?:find_package|pkg_check_modules)\((\w[\w-]*)', cmake)}
        for packages in re.findall(r'\((?:APPEND )?catkin_packages ([^)]*)\)', cmake):
            found |= set(packages.split())
        used = self.build | (included('test', 'bench') & set(FOUND.values())) | {'catkin', 'message_generation', 'rostest'}
        self.assertEqual(sorted(used), sorted(found - {''}))

    def test_the_debian_package_builds_with_the_same(self):
        tools = {'debhelper-compat', 'dh-sequence-python3', 'cmake', 'ninja-build', 'python3', 'python3-setuptools'}
        wanted = set(tools)
        for key in declared('depend', 'build_depend', 'buildtool_depend'):
            wanted |= set(debian(key))
        # What runs only, or comes with another.
        wanted -= {name for name in wanted if name.startswith('python3-') and name not in tools} | {'rviz'}
        self.assertEqual(sorted(wanted), sorted(control('Build-Depends')))

    def test_the_debian_package_brings_what_running_needs(self):
        depends = control('Depends')
        for variable in ('${misc:Depends}', '${python3:Depends}', '${shlibs:Depends}'):
            self.assertIn(variable, depends)
        linked = {key for key in LINKED if key not in ('actionlib', 'tf2_ros', 'roslib', 'rviz')}
        for key in sorted(declared('depend', 'exec_depend') - linked - {'rosgraph_msgs', 'tf2_msgs'}):  # these come with rospy and tf2_ros
            name = RUNNING.get(key, 'python3-' + key.replace('_', '-'))
            if name:
                self.assertIn(name, depends, 'for %s of package.xml' % key)
        # roslaunch starts static_transform_publisher, and rosrun the programs.
        self.assertLessEqual({'tf2-tools', 'rosbash'}, depends)

    def test_one_version(self):
        version = xml.etree.ElementTree.parse(os.path.join(CHECKOUT, 'package.xml')).getroot().find('version').text
        changelog = read('CHANGELOG.rst')
        released = re.findall(r'^(\d+\.\d+\.\d+) \((\d{4}-\d\d-\d\d)\)\n-+$', changelog, re.MULTILINE)
        self.assertRegex(changelog, r'\nForthcoming\n-+\n')
        self.assertEqual(version, released[0][0], 'CHANGELOG.rst')
        self.assertEqual(version, re.match(r'meshless-surgery \(([^)]+)\)', read('debian/changelog')).group(1), 'debian/changelog')
        self.assertEqual(version, re.search(r'\*meshless_surgery\*, version (\S+),', read('README.md')).group(1), 'README.md')
        self.assertEqual(sorted(released, key=lambda one: [int(part) for part in one[0].split('.')], reverse=True), released)

    def test_the_debian_packages_are_listed(self):
        listed = set(line for line in read('scripts/packages.txt').splitlines() if line and not line.startswith('#'))
        for key in sorted(declared('depend', 'build_depend', 'exec_depend', 'test_depend', 'buildtool_depend')):
            for package in debian(key):
                self.assertIn(package, listed, 'for %s of package.xml' % key)


if __name__ == '__main__':
    unittest.main()
