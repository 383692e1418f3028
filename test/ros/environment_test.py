#!/usr/bin/env python3
"""A task as an environment: in lock step, the same to the bit for the same seed and actions, its reward that of the task."""
import multiprocessing
import os
import re
import subprocess
import sys
import tempfile
import time
import unittest

import numpy
import rosnode
import rospkg

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import vector_worker  # noqa: E402
from deformer_support import LONG, OwnNode, run  # noqa: E402
from meshless_surgery import Environment, Refused, Surgeon, Unreachable  # noqa: E402
from meshless_surgery.environment import PlainBox, potential  # noqa: E402

HANDS = [('pick', (-0.05, -0.06, 0.07)), ('push', (0.06, -0.05, 0.12))]
POINTS = [('liver', (-0.05, -0.06, 0.07)), ('liver', (0.05, 0.0, 0.06))]


class EnvironmentTest(unittest.TestCase):

    def play(self, environment, seed, actions):
        """Observations, rewards and the last info."""
        observation, info = environment.reset(seed=seed)
        told = [observation]
        rewards = []
        for action in actions:
            observation, reward, terminated, truncated, info = environment.step(action)
            told.append(observation)
            rewards.append(reward)
            if terminated or truncated:
                break
        return numpy.array(told), numpy.array(rewards), info

    def test_the_same_seed_and_actions_give_the_same_observations_to_the_bit(self):
        environment = Environment('retract', hands=HANDS, points=POINTS, spread=0.003, reach=0.03)
        try:
            environment.action_space.seed(7)
            actions = [environment.action_space.sample() for _ in range(70)]
            first = self.play(environment, 5, actions)
            again = self.play(environment, 5, actions)
            other = self.play(environment, 6, actions)
            self.assertEqual(first[0].tobytes(), again[0].tobytes())
            self.assertEqual(first[1].tobytes(), again[1].tobytes())
            self.assertNotEqual(first[0][0].tobytes(), other[0][0].tobytes())  # hands start elsewhere
            self.assertEqual((71,) + environment.observation_space.shape, first[0].shape)
            self.assertTrue(numpy.isfinite(first[0]).all())
            # Each action is so many steps: not one more or less.
            self.assertEqual(1 + 4 * 70, first[2]['step'])
            self.assertTrue(numpy.allclose(first[0][:, -3], (1 + 4 * numpy.arange(71)) / 120.0))
            way = 0.002 * numpy.cumsum(actions, axis=0)
            self.assertTrue(numpy.allclose(first[0][1:, 0:3] - first[0][0, 0:3], way[:, 0:3]))
            self.assertTrue(numpy.allclose(first[0][1:, 10:13] - first[0][0, 10:13], way[:, 4:7]))  # the sphere has arrived
            held, forces = first[0][:, 9] > 0, numpy.abs(first[0][:, 6:9]).sum(axis=1)
            self.assertTrue(held.any() and not held.all())  # it takes hold and lets go
            self.assertTrue((forces[held] > 0).all() and (forces[~held] == 0).all())
            self.assertGreater(numpy.abs(first[0][-1, 20:28] - first[0][0, 20:28]).max(), 1e-5)  # the liver sags
        finally:
            environment.close()
        # A node of its own each: the same.
        environment = Environment('retract', hands=HANDS, points=POINTS, spread=0.003, reach=0.03)
        try:
            self.assertEqual(first[0].tobytes(), self.play(environment, 5, actions)[0].tobytes())
        finally:
            environment.close()

    def test_what_it_says_is_equal_for_the_same_seed_and_action(self):
        """As check_env of Gymnasium compares: by ==, which NaN is not to itself."""
        with OwnNode(scene='liver', paused=True).wait() as node:
            environment = Environment('retract', node=node.name, hands=HANDS, points=POINTS)
            told = []
            for _ in range(2):
                reset = environment.reset(seed=123)
                environment.action_space.seed(123)
                told.append((reset, environment.step(environment.action_space.sample())))
            for first, again in zip(*told):
                self.assertTrue(numpy.array_equal(first[0], again[0]))
                self.assertEqual(first[1:], again[1:])
                self.assertIn('time', first[-1]['metrics'])
            environment.close()

    def test_two_side_by_side_for_each_start_method(self):
        """As Gymnasium's AsyncVectorEnv does it: one to ask for its spaces, closed again, then one a process. This process has a
        rospy node too."""
        probe = vector_worker.make()
        probe.reset(seed=1)
        probe.close()
        told = {}
        for method in ('fork', 'spawn', 'forkserver'):
            context = multiprocessing.get_context(method)
            pipes, processes = [], []
            for _ in range(2):
                pipe, theirs = context.Pipe()
                process = context.Process(target=vector_worker.work, args=(theirs,), daemon=True)
                process.start()
                self.addCleanup(process.kill)
                theirs.close()
                pipes.append(pipe)
                processes.append(process)

            def answers():
                for number, pipe in enumerate(pipes):
                    self.assertTrue(pipe.poll(LONG), '%s: process %d does not answer' % (method, number))
                said = [pipe.recv() for pipe in pipes]
                self.assertFalse([text for text in said if isinstance(text, str) and text != 'closed'], method)
                return said

            def ask(name, *each):
                for pipe, arguments in zip(pipes, each):
                    pipe.send((name, arguments))
                return answers()

            self.assertEqual([(probe.action_space.shape, probe.observation_space.shape)] * 2, answers())
            history = [[said[0]] for said in ask('reset', dict(seed=4), dict(seed=5))]
            for number in range(12):
                action = numpy.cos(number + numpy.arange(7.0))
                for kept, said in zip(history, ask('step', dict(action=action), dict(action=action))):
                    kept.append(said[0])
            for pipe in pipes:
                pipe.send(None)
            self.assertEqual(['closed'] * 2, answers())
            for process in processes:
                process.join(LONG)
                self.assertEqual(0, process.exitcode, method)
            told[method] = [numpy.array(kept).tobytes() for kept in history]
            self.assertNotEqual(told[method][0], told[method][1])
        self.assertEqual(1, len(set(map(tuple, told.values()))))  # no method gives another result

    def test_a_forked_process_hears_no_topics_and_says_so(self):
        context = multiprocessing.get_context('fork')
        pipe, theirs = context.Pipe()
        with OwnNode(scene='liver', paused=True).wait() as node:
            def ask():
                surgeon = Surgeon(node.name)
                theirs.send(surgeon.hash())
                try:
                    surgeon.state()
                except Unreachable as unreachable:
                    theirs.send(str(unreachable))
            process = context.Process(target=ask)
            process.start()
            self.addCleanup(process.kill)
            for wanted in (node.hash(), 'spawn'):
                self.assertTrue(pipe.poll(LONG))
                said = pipe.recv()
                self.assertTrue(said == wanted or wanted in str(said), said)

    def test_a_node_does_not_outlive_a_process_that_was_killed(self):
        said = subprocess.run([sys.executable, vector_worker.__file__], stdout=subprocess.PIPE, text=True, check=False)
        self.assertEqual(-9, said.returncode)
        name = said.stdout.strip()
        self.assertIn('/scene_', name)
        end = time.monotonic() + LONG
        while name in rosnode.get_node_names():  # it takes itself off in good order
            self.assertLess(time.monotonic(), end, name + ' lives on')
            time.sleep(0.1)

    def test_a_policy_that_retracts_is_rewarded_and_ends_the_task(self):
        with OwnNode(scene='liver', paused=True).wait() as node:
            environment = Environment('retract', node=node.name, hands=HANDS[:1], points=POINTS, reach=0.03, steps=12, move=0.005)
            with self.assertRaises(RuntimeError):
                environment.step(numpy.zeros(4))
            environment.reset(seed=1)
            begin = potential(environment._seen)
            rewards, terminated = [], False
            for number in range(140):
                lift = 0.4 if 5 <= number < 19 else 0.0
                action = (0, 0.3 * lift, lift, 1.0 if number < 130 else -1.0)
                observation, reward, terminated, truncated, info = environment.step(action)
                rewards.append(reward)
                if number == 125:  # at rest: the force of the spring
                    spring = 500.0 * (observation[0:3] - observation[3:6])
                    self.assertGreater(numpy.linalg.norm(spring), 1.0)
                    self.assertTrue(numpy.allclose(spring, observation[6:9], rtol=0.02, atol=0.02), observation[:10])
                self.assertFalse(truncated)
                if terminated:
                    break
            self.assertTrue(terminated, info)
            self.assertTrue(info['passed'], info)
            self.assertEqual(2, info['stage'])
            self.assertAlmostEqual(sum(rewards), 1.0 + info['score'] / 100.0 - begin)  # all stages, and the score
            self.assertEqual(info['time'], info['metrics']['time'])
            with self.assertRaises(RuntimeError):
                environment.step(numpy.zeros(4))
            environment.reset()
            for wrong in (numpy.zeros(3), (0, 0, float('nan'), 0), (0, 1.01, 0, 0), (0, 0, 0, -float('inf'))):
                with self.assertRaisesRegex(ValueError, 'accepted: 4 numbers from -1 to 1'):
                    environment.step(wrong)
            environment.close()
            self.assertTrue(node.good('observe').success)  # another's node lives on

    def test_an_episode_is_truncated_and_wrong_arguments_are_refused(self):
        with OwnNode(scene='liver', paused=True).wait() as node:
            environment = Environment('retract', node=node.name, horizon=3, reward=lambda before, after: after.step - before.step)
            environment.reset(seed=1)
            told = [environment.step(numpy.zeros(4)) for _ in range(3)]
            self.assertEqual([(4.0, False, False), (4.0, False, False), (4.0, False, True)], [step[1:4] for step in told])
            for wrong in (dict(hands=[]), dict(hands=[('foot', (0, 0, 0))]), dict(hands=[('pick', (0, 0))]), dict(steps=0),
                          dict(move=float('nan')), dict(spread=-1.0), dict(hands=[HANDS[1], HANDS[1]])):
                with self.assertRaises(ValueError):
                    Environment('retract', node=node.name, **wrong)
            environment.reset(options={})
            with self.assertRaises(ValueError):
                environment.reset(options={'place': 1})
            environment.reset()
            for _ in range(2):
                environment.close()  # twice is no harm
            for call in (environment.reset, lambda: environment.step(numpy.zeros(4))):
                with self.assertRaisesRegex(RuntimeError, 'closed'):
                    call()
            with self.assertRaises(Refused):
                Environment('palpate', node=node.name).reset()  # of another scene
            with self.assertRaises(Refused):
                Environment('retract', node=node.name, points=[('spleen', (0, 0, 0))]).reset()

    def test_plan_and_target_are_where_their_tissue_is(self):
        with OwnNode(scene='blocks', paused=True).wait() as node:
            environment = Environment('hand_over', node=node.name, hands=[('pick', (-0.08, 0.0, 0.03))], reach=0.03, move=0.005, steps=12)
            _, before = environment.reset(seed=1)
            for _ in range(10):
                seen, _, _, _, info = environment.step((0, 0, 1.0, 1.0))
            self.assertAlmostEqual(0.0105, before['target'][2], delta=0.001)
            self.assertGreater(info['target'][2], 0.03)  # it hangs from the pick
            self.assertNotIn('plan', info)
        with OwnNode(scene='incision', paused=True).wait() as node:
            environment = Environment('incise', node=node.name)
            environment.reset(seed=1)
            for _ in range(30):
                _, _, _, _, info = environment.step(numpy.zeros(4))
            self.assertNotIn('target', info)
            self.assertEqual((2, 3), info['plan'].shape[1:])
            highest = info['plan'][..., 2].max()
            self.assertTrue(0.05 < highest < 0.058, highest)  # the skin sags from 0.06

    def test_a_point_whose_body_was_cut_is_told(self):
        with OwnNode(scene='liver', paused=True).wait() as node:
            environment = Environment('retract', node=node.name, points=POINTS)
            observation, _ = environment.reset(seed=1)
            self.assertTrue(numpy.allclose((-0.05, -0.06, 0.07), observation[10:13], atol=0.02))
            self.assertEqual((1.0, 1.0), (observation[13], observation[17]))
            environment.surgeon.cut(pivot=(0, -1, 0), reach=(0, 1, 0), normal=(1, 0, 0))
            observation = environment.step(numpy.zeros(4))[0]
            self.assertEqual([0.0] * 8, list(observation[10:18]))
            self.assertTrue(environment.observation_space.contains(observation))
            environment.close()

    def test_it_is_gymnasiums_where_that_is_installed(self):
        with tempfile.TemporaryDirectory() as folder:
            os.mkdir(os.path.join(folder, 'gymnasium'))
            with open(os.path.join(folder, 'gymnasium', '__init__.py'), 'w', encoding='utf-8') as file:
                file.write('class Env: pass\nclass spaces:\n    class Box: pass\n')
            said = subprocess.run(
                [sys.executable, '-c', 'import gymnasium\nfrom meshless_surgery import environment as e\n'
                 'print(issubclass(e.Environment, gymnasium.Env), e.Box is gymnasium.spaces.Box)'],
                env=dict(os.environ, PYTHONPATH=folder + ':' + os.environ['PYTHONPATH']), stdout=subprocess.PIPE, text=True, check=True)
        self.assertEqual('True True', said.stdout.strip())

    def test_spaces_without_gymnasium(self):
        box = PlainBox(-1.0, 1.0, (5,))
        box.seed(3)
        first = [box.sample() for _ in range(20)]
        box.seed(3)
        self.assertEqual([v.tobytes() for v in first], [box.sample().tobytes() for _ in range(20)])
        self.assertTrue(all(box.contains(value) for value in first))
        self.assertFalse(box.contains(numpy.full(5, 1.1)) or box.contains(numpy.zeros(4)))

    def test_the_example_of_the_docs_runs(self):
        with open(os.path.join(rospkg.RosPack().get_path('meshless_surgery'), 'docs', 'reference', 'python.md'), encoding='utf-8') as file:
            page = file.read()
        example = re.search(r'```python\n(#!/usr/bin/python3\nfrom meshless_surgery import Environment\n.*?)```', page, re.DOTALL).group(1)
        said = []
        exec(compile(example, 'example', 'exec'), {'print': lambda *words: said.append(words), '__name__': 'example'})
        self.assertEqual(1, len(said))
        printed = re.search(r'It prints `(.*?)`', page).group(1)
        self.assertEqual(re.sub(r'[\d.]+', '', printed), re.sub(r'[\d.]+', '', said[0][0]))
        self.assertIn('stage 2 of 2', said[0][0])


if __name__ == '__main__':
    run('environment', EnvironmentTest)
