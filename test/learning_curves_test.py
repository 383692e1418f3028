#!/usr/bin/env python3
"""Learning curves of reports whose numbers are known, and the program on them."""
import json
import math
import os
import shutil
import subprocess
import sys
import tempfile
import unittest

CHECKOUT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
sys.path.insert(0, os.path.join(CHECKOUT, 'python'))
from meshless_surgery import curves, validity  # noqa: E402


def report(trainee, score, time, force, task='retract', outcome='done', passed=None, **more):
    return {**more, 'format': 1, 'task': task, 'scene': 'liver', 'trainee': trainee, 'log': 'x', 'hashes_met': True, 'first_step': 0,
            'last_step': 10, 'outcome': outcome, 'failed': '', 'score': score, 'pass_mark': 60.0,
            'passed': score >= 60.0 if passed is None else passed, 'stages': [], 'events': [],
            'metrics': [{'name': 'time', 'unit': 's', 'value': time, 'weight': 1.0, 'good': 15.0, 'bad': 60.0, 'score': 50.0},
                        {'name': 'sparc.pick', 'unit': '1', 'value': force, 'weight': 1.0, 'good': -1.6, 'bad': -4.0, 'score': 1.0},
                        {'name': 'idle_time', 'unit': 's', 'value': None}]}


class CurvesTest(unittest.TestCase):

    def setUp(self):
        self.folder = tempfile.mkdtemp()
        self.addCleanup(shutil.rmtree, self.folder)
        self.count = 0

    def put(self, *arguments, **fields):
        self.count += 1
        # Names that sort otherwise than by age.
        folder = os.path.join(self.folder, '%02d' % (99 - self.count))
        os.mkdir(folder)
        path = os.path.join(folder, 'report.json')
        with open(path, 'w', encoding='utf-8') as file:
            json.dump(report(*arguments, **fields), file)
        os.utime(path, ns=(10 ** 18 + self.count, 10 ** 18 + self.count))

    def fill(self):
        for score, time in ((40.0, 50.0), (55.0, 40.0), (70.0, 30.0), (80.0, 25.0)):
            self.put('ada', score, time, -2.0)
        for score, time, smooth in ((90.0, 14.0, -1.5), (94.0, 16.0, -1.7), (98.0, 18.0, -1.9)):
            self.put('<expert>', score, time, smooth)
        self.put('ada', 10.0, None, None, task='incise', outcome='unfinished', passed=False)

    def program(self, *arguments):
        return subprocess.run([sys.executable, os.path.join(CHECKOUT, 'scripts', 'learning_curves.py'), self.folder,
                               '--out', os.path.join(self.folder, 'out.html')] + list(arguments), text=True,
                              stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                              env=dict(os.environ, PYTHONPATH=os.path.join(CHECKOUT, 'python')))

    def test_a_row_for_each_task_and_trainee_in_the_order_of_the_runs(self):
        self.fill()
        runs, faults = curves.read(self.folder)
        self.assertEqual([], faults)
        rows = {(row['task'], row['trainee']): row for row in curves.table(runs)}
        self.assertEqual(3, len(rows))
        ada = rows['retract', 'ada']
        self.assertEqual((4, 2, 3, 40.0, 80.0), (ada['runs'], ada['passed'], ada['first_pass'], ada['first_score'], ada['best']))
        self.assertAlmostEqual((55.0 + 70.0 + 80.0) / 3.0, ada['lately'])
        self.assertIsNone(rows['incise', 'ada']['first_pass'])

    def test_dates_say_what_came_first_and_a_copy_keeps_that(self):
        for score, date in ((10.0, '2026-03-01T09:00:00.000Z'), (30.0, '2026-03-01T10:00:00Z'), (20.0, '2026-03-01T09:00:00.001Z')):
            self.put('ada', score, 1.0, -2.0, date=date)
        copy = os.path.join(tempfile.mkdtemp(), 'copy')
        self.addCleanup(shutil.rmtree, os.path.dirname(copy))
        shutil.copytree(self.folder, copy)
        for age, name in enumerate(sorted(os.listdir(copy))):
            os.utime(os.path.join(copy, name, 'report.json'), (1e9 + age, 1e9 + age))
        for folder in (self.folder, copy):
            self.assertEqual([10.0, 20.0, 30.0], [run.score for run in curves.read(folder)[0]])
        self.assertEqual('', self.program().stderr)

    def test_a_report_without_a_date_is_named(self):
        self.put('ada', 10.0, 1.0, -2.0, date='2026-03-01T09:00:00.000Z')
        self.put('ada', 20.0, 1.0, -2.0, date=None)
        done = self.program()
        self.assertEqual(0, done.returncode)
        self.assertIn('97: no date', done.stderr)
        self.put('ada', 30.0, 1.0, -2.0, date=20260301)
        self.assertEqual(1, len(curves.read(self.folder)[1]))

    def test_names_of_any_alphabet_are_told_apart(self):
        for trainee in ('李雷', '韩梅', 'Zoe\u0308', 'Zo\u00eb'):  # the last two are one, typed on two machines
            self.put(trainee, 50.0, 1.0, -2.0)
        self.assertEqual({'李雷': 1, '韩梅': 1, 'Zo\u00eb': 2}, {row['trainee']: row['runs'] for row in curves.table(curves.read(self.folder)[0])})
        self.assertEqual(0, self.program('--experts', 'Zoe\u0308').returncode)

    def test_pass_marks_are_the_experts_mean_and_deviation_towards_the_worse(self):
        self.fill()
        runs = [run for run in curves.read(self.folder)[0] if run.trainee == '<expert>']
        found = curves.marks(runs)['retract']
        self.assertAlmostEqual(94.0 - 4.0, found['pass_mark'])
        time, smooth = found['metrics']['time'], found['metrics']['sparc.pick']
        for key, value in (('mean', 16.0), ('sd', 2.0), ('good', 16.0), ('pass', 18.0), ('bad', 22.0)):
            self.assertAlmostEqual(value, time[key])
        for key, value in (('mean', -1.7), ('sd', 0.2), ('pass', -1.9), ('bad', -2.3)):
            self.assertAlmostEqual(value, smooth[key])
        self.assertNotIn('idle_time', found['metrics'])
        with self.assertRaisesRegex(ValueError, 'has 1 runs of experts'):
            curves.marks(runs[:1])
        self.assertTrue(all(math.isfinite(number) for number in time.values()))

    def test_the_program_prints_and_draws_them(self):
        self.fill()
        done = self.program('--experts', '<expert>', '--task', 'retract', '--csv', os.path.join(self.folder, 'table.csv'))
        self.assertEqual(0, done.returncode, done.stderr)
        self.assertIn('time: {good: 16, bad: 22, pass: 18}', done.stdout)
        self.assertIn('pass_mark: 90.0', done.stdout)
        with open(os.path.join(self.folder, 'out.html'), encoding='utf-8') as file:
            page = file.read()
        self.assertIn('&lt;expert&gt;', page)
        self.assertNotIn('<expert>', page)
        self.assertNotIn('http', page.replace('http://www.w3.org', ''))
        self.assertEqual(3, page.count('<svg'))  # score, time, sparc.pick
        self.assertEqual(3 * 7, page.count('<circle'))
        self.assertEqual(2, page.count('class="band"/>'))
        with open(os.path.join(self.folder, 'table.csv'), encoding='utf-8') as file:
            self.assertEqual(3, len(file.read().splitlines()))

    def test_domains_have_the_marks_of_their_metrics_and_say_what_is_not_measured(self):
        self.put('ada', 50.0, 37.5, -2.8)
        of = curves.domains(curves.read(self.folder)[0][0])
        self.assertAlmostEqual(50.0, of['efficiency'])       # time from 15 to 60
        self.assertAlmostEqual(50.0, of['robotic control'])  # sparc.pick from -1.6 to -4
        for domain in ('depth perception', 'autonomy', 'bimanual dexterity'):
            self.assertIsNone(of[domain])
        self.assertEqual(0, self.program('--csv', os.path.join(self.folder, 'table.csv')).returncode)
        with open(os.path.join(self.folder, 'table.csv'), encoding='utf-8') as file:
            self.assertIn('robotic control', file.readline())

    def test_two_groups_are_told_apart_by_what_is_known_of_them(self):
        # Scores of three trainees each, in two runs: means 30, 40, 50 and 60, 70, 80.
        for n, mean in enumerate((30.0, 40.0, 50.0)):
            for way in (-2.0, 2.0):
                self.put('novice %d' % n, mean + way, 60.0 - n, -2.0)
                self.put('expert %d' % n, mean + 30.0 + way, 20.0 - n, -2.0)
        runs = curves.read(self.folder)[0]
        groups = [{'%s %d' % (kind, n) for n in range(3)} for kind in ('novice', 'expert')]
        found = validity.compare(runs, *groups)['retract']
        self.assertAlmostEqual(3.0 * (1.0 - 3.0 / 15.0), found['g'])  # 30 over a standard deviation of 10, for few
        self.assertLess(found['interval'][0], found['g'])
        self.assertAlmostEqual(55.0, found['pass_mark'])
        self.assertEqual((0, 0), (found['novices_pass'], found['experts_fail']))
        # Between trainees 2 * 1750 / 5 = 700, within 8.
        self.assertAlmostEqual((700.0 - 8.0) / (700.0 + 8.0), found['icc'])
        self.assertGreater(found['metrics']['time'][2], 3.0)
        self.assertEqual(0.0, found['metrics']['sparc.pick'][2])
        # Who is asked the other way round is told that experts are not better.
        self.assertIsNone(validity.compare(runs, groups[1], groups[0])['retract']['pass_mark'])
        with self.assertRaisesRegex(ValueError, 'has 1 of the experts'):
            validity.compare(runs, groups[0], {'expert 1'})

    def test_the_mark_lies_where_the_two_curves_meet(self):
        worse, better = [10.0, 20.0, 30.0, 40.0], [80.0, 81.0, 82.0, 83.0]
        mark = validity.contrasting(worse, better)
        density = [math.exp(-0.5 * ((mark - m) / s) ** 2) / s for m, s in ((25.0, math.sqrt(500.0 / 3.0)), (81.5, math.sqrt(5.0 / 3.0)))]
        self.assertAlmostEqual(density[0] / density[1], 1.0, places=6)
        self.assertEqual(45.0, validity.contrasting([40.0, 40.0], [50.0, 50.0]))

    def test_the_program_of_validity_prints_and_draws(self):
        self.fill()
        for n in range(2):
            self.put('new %d' % n, 20.0 + n, 60.0, -3.0)
        def run(*arguments):
            return subprocess.run([sys.executable, os.path.join(CHECKOUT, 'scripts', 'validity.py'), self.folder, '--task', 'retract',
                                   '--out', os.path.join(self.folder, 'v.html')] + list(arguments), text=True, stdout=subprocess.PIPE,
                                  stderr=subprocess.PIPE, env=dict(os.environ, PYTHONPATH=os.path.join(CHECKOUT, 'python')))
        done = run('--novices', 'new 0', 'new 1', '--experts', 'ada', '<expert>')
        self.assertEqual(0, done.returncode, done.stderr)
        self.assertIn("Hedges' g", done.stdout)
        with open(os.path.join(self.folder, 'v.html'), encoding='utf-8') as file:
            page = file.read()
        self.assertEqual(4, page.count('<circle'))
        self.assertNotIn('<expert>', page)
        for arguments, words in ((('--novices', 'ada', 'new 1', '--experts', 'ada', '<expert>'), 'in both groups'),
                                 (('--novices', 'bob', 'new 1', '--experts', 'ada', '<expert>'), "no run of 'bob'"),
                                 (('--novices', 'new 1', '--experts', 'ada', '<expert>'), 'has 1 of the novices')):
            refused = run(*arguments)
            self.assertEqual(2, refused.returncode)
            self.assertIn(words, refused.stderr)

    def test_runs_that_do_not_count_are_left_out(self):
        self.fill()
        before = curves.marks([run for run in curves.read(self.folder)[0] if run.trainee == '<expert>'])
        self.put('<expert>', 0.0, 90.0, -3.0, counted=False, passed=False)
        runs = curves.read(self.folder)[0]
        self.assertEqual(before, curves.marks([run for run in runs if run.trainee == '<expert>']))
        row = next(row for row in curves.table(runs) if row['trainee'] == '<expert>')
        self.assertEqual((4, 1, 90.0), (row['runs'], row['not_counted'], row['first_score']))
        self.put('ada', None, 1.0, 1.0, passed=False)
        self.assertIn('score is None', curves.read(self.folder)[1][0][1])

    def test_a_run_alone_is_drawn_too(self):
        self.put('ada', 50.0, 20.0, -2.0)
        self.assertEqual(0, self.program().returncode)

    def test_what_is_no_report_is_said_and_passed_over(self):
        self.put('ada', 50.0, 20.0, -2.0)
        for name, text in (('broken', '{'), ('newer', json.dumps(dict(report('ada', 1.0, 1.0, 1.0), format=2))), ('other', '[]'),
                           ('lacks', '{"format": 1}')):
            os.mkdir(os.path.join(self.folder, name))
            with open(os.path.join(self.folder, name, 'report.json'), 'w', encoding='utf-8') as file:
                file.write(text)
        done = self.program()
        self.assertEqual(0, done.returncode, done.stderr)
        for name in ('broken', 'newer', 'other', 'lacks'):
            self.assertIn(name + ' is passed over', done.stderr)
        self.assertIn('format is 2; accepted: 1', done.stderr)

    def test_wrong_wishes_name_what_there_is(self):
        self.fill()
        for arguments, words in ((('--task', 'sew'), 'tasks there: incise, retract'),
                                 (('--experts', 'bob'), "no run of 'bob'; trainees: <expert>, ada"),
                                 (('--experts', 'ada'), 'task incise has 0 runs of experts')):
            done = self.program(*arguments)
            self.assertEqual(2, done.returncode, arguments)
            self.assertIn(words, done.stderr)


if __name__ == '__main__':
    unittest.main(verbosity=2)
