#!/usr/bin/env python3
"""A terminal that has sourced scripts/setup.bash, and so scripts/train, stays on the loopback unless told otherwise."""
import os
import subprocess
import tempfile
import unittest

CHECKOUT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
NAMES = ('ROS_MASTER_URI', 'ROS_IP', 'ROS_HOSTNAME')
SHOW = 'for n in %s; do printf "%%s=%%s;" "$n" "${!n-unset}"; done' % ' '.join(NAMES)


class LoopbackTest(unittest.TestCase):

    def after(self, command, **given):
        """The three variables after a command in a terminal that has those given alone."""
        environment = {name: value for name, value in os.environ.items() if not name.startswith('ROS_')}
        environment.update(given)
        done = subprocess.run(['bash', '-c', command + '; ' + SHOW], cwd=CHECKOUT, env=environment, check=True,
                              stdout=subprocess.PIPE, universal_newlines=True)
        return dict(part.split('=', 1) for part in done.stdout.strip(';').split(';'))

    def setup(self, **given):
        """Sourced over a build that sets nothing itself."""
        with tempfile.TemporaryDirectory() as output:
            os.mkdir(os.path.join(output, 'devel'))
            with open(os.path.join(output, 'devel', 'setup.bash'), 'w', encoding='ascii'):
                pass
            return self.after('source scripts/setup.bash', MESHLESS_SURGERY_OUTPUT=output, **given)

    def test_without_a_master(self):
        wanted = {'ROS_MASTER_URI': 'http://127.0.0.1:11311', 'ROS_IP': '127.0.0.1', 'ROS_HOSTNAME': 'unset'}
        self.assertEqual(wanted, self.setup())
        self.assertEqual(wanted, self.setup(ROS_MASTER_URI='', ROS_IP=''))

    def test_who_has_set_an_address_keeps_it(self):
        self.assertEqual({'ROS_MASTER_URI': 'http://127.0.0.1:11311', 'ROS_IP': '10.0.0.1', 'ROS_HOSTNAME': 'unset'},
                         self.setup(ROS_IP='10.0.0.1'))
        self.assertEqual({'ROS_MASTER_URI': 'http://127.0.0.1:11311', 'ROS_IP': 'unset', 'ROS_HOSTNAME': 'here'},
                         self.setup(ROS_HOSTNAME='here'))

    def test_who_has_set_a_master_keeps_it(self):
        self.assertEqual({'ROS_MASTER_URI': 'http://10.0.0.2:11311', 'ROS_IP': 'unset', 'ROS_HOSTNAME': 'unset'},
                         self.setup(ROS_MASTER_URI='http://10.0.0.2:11311'))

    def test_train_goes_the_same_way(self):
        """Before it launches anything."""
        with open(os.path.join(CHECKOUT, 'scripts', 'train'), encoding='utf-8') as file:
            lines = [line.strip() for line in file]
        launch = next(number for number, line in enumerate(lines) if line.startswith('exec roslaunch'))
        self.assertIn('useBuild "$output"', lines[:launch])


class OutputTest(unittest.TestCase):

    def ended(self, folder, *command):
        return subprocess.run(command, cwd=CHECKOUT, env=dict(os.environ, MESHLESS_SURGERY_OUTPUT=folder), check=False,
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT, universal_newlines=True, timeout=60)

    def test_a_folder_that_begins_as_the_checkout_does_is_refused_at_once(self):
        real = os.path.realpath(CHECKOUT)
        for folder in (real, real + '_out', real + '/out', real + '/../' + os.path.basename(real) + '.out'):
            for command, status in ((('bash', '-c', 'source scripts/setup.bash'), 1), (('scripts/check', 'base'), 2),
                                    (('scripts/train', '--build-only'), 2)):
                done = self.ended(folder, *command)
                self.assertEqual(status, done.returncode, done.stdout)
                self.assertIn('The build would go to ' + os.path.normpath(folder), done.stdout)
                self.assertIn('MESHLESS_SURGERY_OUTPUT', done.stdout)
        self.assertFalse(os.path.exists(real + '_out') or os.path.exists(real + '/out'))

    def test_any_other_is_not(self):
        real = os.path.realpath(CHECKOUT)
        for folder in (os.path.dirname(real), os.path.dirname(real) + '/out_of_' + os.path.basename(real), '/tmp/other'):
            self.assertEqual(0, self.ended(folder, 'scripts/check', '--help').returncode)


if __name__ == '__main__':
    unittest.main()
