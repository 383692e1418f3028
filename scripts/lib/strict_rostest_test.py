#!/usr/bin/env python3
"""strict_rostest.py is red where rostest by itself is green: real runs, on a package that is thrown away."""
import os
import subprocess
import sys
import tempfile
import unittest

STRICT = os.path.join(os.path.dirname(os.path.abspath(__file__)), 'strict_rostest.py')
SCRIPT = '''#!/usr/bin/python3
import os, sys, unittest, rosunit
class Laws(unittest.TestCase):
    %s
path = [a.split(':', 1)[1] for a in sys.argv if a.startswith('--gtest_output=xml:')][0]
suite = unittest.defaultTestLoader.loadTestsFromTestCase(Laws)
rosunit.create_xml_runner('throwaway', 'laws', path).run(suite)
%s
'''
RIGHT = 'def test_right(self): pass'
NODE = '''#!/usr/bin/python3
import os, signal, time
def end(*unused): os._exit(%d)
signal.signal(signal.SIGINT, end)
time.sleep(60)
'''
LAUNCH = '''<launch>%s<test test-name="laws" pkg="throwaway" type="laws" time-limit="30"/></launch>'''
WITH_NODE = '<node name="node" pkg="throwaway" type="node"/>'
# Name: the script, its node's exit code at shutdown if it has one, and what is complained about.
CASES = {'all is well': (SCRIPT % (RIGHT, ''), 0, None),
         'no test': (SCRIPT % ('pass', ''), None, 'ran no case'),
         'script dies after its results': (SCRIPT % (RIGHT, 'os.kill(os.getpid(), 11)'), None, 'ended with -11'),
         'script fails after its results': (SCRIPT % (RIGHT, 'sys.exit(3)'), None, 'ended with 3'),
         'node fails at shutdown': (SCRIPT % (RIGHT, 'import time; time.sleep(1)'), 7, 'ended with 7')}


class StrictRostestTest(unittest.TestCase):
    def start(self, folder, script, node_code):
        package = os.path.join(folder, 'throwaway')
        os.makedirs(package)
        files = {'package.xml': '<package format="2"><name>throwaway</name><version>0.0.1</version><description>x'
                                '</description><maintainer email="a@b.c">x</maintainer><license>x</license></package>',
                 'laws': script, 'node': NODE % (node_code or 0),
                 'x.test': LAUNCH % ('' if node_code is None else WITH_NODE)}
        for name, text in files.items():
            path = os.path.join(package, name)
            with open(path, 'w', encoding='ascii') as out:
                out.write(text)
            os.chmod(path, 0o755)
        environment = dict(os.environ, ROS_PACKAGE_PATH=folder + ':/usr/share', ROS_HOME=folder, ROS_IP='127.0.0.1',
                           ROS_TEST_RESULTS_DIR=folder)
        return subprocess.Popen([sys.executable, STRICT, '--pkgdir=' + package, '--package=throwaway',
                                 '--results-base-dir', folder, os.path.join(package, 'x.test')], env=environment,
                                stdout=subprocess.PIPE, stderr=subprocess.STDOUT, universal_newlines=True)

    def testEachFaultIsRed(self):
        with tempfile.TemporaryDirectory() as folder:
            runs = {name: self.start(os.path.join(folder, str(number)), script, code)
                    for number, (name, (script, code, _)) in enumerate(CASES.items())}
            for name, run in runs.items():
                output = run.communicate(timeout=120)[0]
                fault = CASES[name][2]
                with self.subTest(name):
                    self.assertEqual(0 if fault is None else 3, run.returncode, output)
                    self.assertIn(fault or '', output)


if __name__ == '__main__':
    unittest.main()
