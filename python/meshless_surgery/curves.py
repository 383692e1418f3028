"""Learning curves: a folder of reports of tasks, by task and trainee, and pass marks from experts' runs.

    from meshless_surgery import curves
    runs, faults = curves.read(folder)          # reports that could be read, oldest first, and what is wrong with others
    curves.table(runs)                          # a row a trainee and task
    curves.marks([r for r in runs if r.trainee in experts])

Needs neither ROS nor a network. `rosrun meshless_surgery learning_curves.py` is the program.
"""
import html
import json
import math
import os
import statistics
import unicodedata
from datetime import datetime, timezone

FORMAT = 1       # of report.json
LAST = 3         # runs that say how good one is now
COLOURS = ('#1b6ca8', '#c0392b', '#2d8a4e', '#8e44ad', '#d68910', '#16807a', '#7f4f24', '#5d6d7e')


# Of the rating scales that surgeons use, what a metric can stand for. What is empty is not measured.
# GEARS: Goh et al. 2012, J. Urol. 187(1). GOALS: Vassiliou et al. 2005, Am. J. Surg. 190(1).
DOMAINS = {
    'depth perception': (),
    'bimanual dexterity': ('hands_share', 'hands_overlap', 'path_length.pick_2', 'path_length.instrument_2'),
    'efficiency': ('time', 'idle_time', 'economy', 'path_length', 'movements', 'cuts', 'strokes', 'grasps'),
    'force sensitivity, tissue handling': ('force_peak', 'force_mean', 'force_together_peak', 'force_together_mean', 'force_time_above', 'strain_peak',
                                           'torn', 'leaks', 'bleeding_time', 'drop_height', 'drops', 'out_of_view'),
    'robotic control': ('sparc', 'ldlj', 'tremor', 'instrument_crossings', 'top_speed'),
    'autonomy': (),
}


class Run:
    """One report. `metrics` has what was measured, `goals` (good, bad) of those that count. `date` is None where the report has none."""

    def __init__(self, folder, report):
        self.folder = folder
        self.task, self.trainee = report['task'], unicodedata.normalize('NFC', report['trainee']) or '(no name)'
        self.date = report.get('date')
        if not isinstance(self.date, (str, type(None))):
            raise ValueError('date is %s; accepted: a text as 2026-03-01T14:05:09Z' % self.date)
        self.score, self.passed, self.pass_mark = report['score'], report['passed'], report['pass_mark']
        for name, value in (('score', self.score), ('pass_mark', self.pass_mark)):
            if isinstance(value, bool) or not isinstance(value, (int, float)):
                raise ValueError('%s is %s; accepted: a number' % (name, value))
        self.outcome, self.counted = report['outcome'], report.get('counted', True)
        self.metrics = {m['name']: m['value'] for m in report['metrics'] if m['value'] is not None}
        self.goals = {m['name']: (m['good'], m['bad']) for m in report['metrics'] if 'good' in m}
        self.units = {m['name']: m['unit'] for m in report['metrics']}


def read(folder):
    """The reports in the folders of `folder`, the oldest first, and a list of (folder, why) of those that are none. Their dates say
    which is older; of a report without date that is when its file was written."""
    runs, faults = [], []
    for name in sorted(os.listdir(folder)):
        path = os.path.join(folder, name, 'report.json')
        if not os.path.isfile(path):
            continue
        try:
            with open(path, encoding='utf-8') as file:
                report = json.load(file)
            if report['format'] != FORMAT:
                raise ValueError('format is %s; accepted: %d' % (report['format'], FORMAT))
            run = Run(name, report)
            seconds, rest = divmod(os.stat(path).st_mtime_ns, 10 ** 9)
            written = datetime.fromtimestamp(seconds, timezone.utc).strftime('%Y-%m-%dT%H:%M:%S') + '.%09dZ' % rest
            runs.append((run.date or written, name, run))
        except (OSError, ValueError, KeyError, TypeError) as fault:
            faults.append((name, 'has no %s' % fault if isinstance(fault, KeyError) else str(fault)))
    return [run for _, _, run in sorted(runs, key=lambda entry: entry[:2])], faults


def domains(run):
    """{domain: mean of the marks, 0 to 100, of those of its metrics that count in the run's task; None: none does}."""
    found = {}
    for domain, metrics in DOMAINS.items():
        gained = []
        for name, (good, bad) in run.goals.items():
            if (name in metrics or name.split('.')[0] in metrics) and name in run.metrics:
                gained.append(100.0 * min(1.0, max(0.0, (run.metrics[name] - bad) / (good - bad))))
        found[domain] = statistics.fmean(gained) if gained else None
    return found


def grouped(runs):
    """{task: {trainee: runs}}, in the order in which they came."""
    tasks = {}
    for run in runs:
        tasks.setdefault(run.task, {}).setdefault(run.trainee, []).append(run)
    return tasks


def table(runs):
    """A row for each task and trainee: task, trainee, runs, passed, first pass (number of the run or None), first score,
    best, mean of the last three, and the mean of each of domains(), None where nothing of it counts or is measured."""
    rows = []
    for task, trainees in grouped(runs).items():
        for trainee, own in trainees.items():
            passes = [number for number, run in enumerate(own, 1) if run.passed]
            scores = [run.score for run in own if run.counted] or [0.0]
            found = [domains(run) for run in own]
            of_domains = {domain: [marks[domain] for marks in found if marks[domain] is not None] for domain in DOMAINS}
            rows.append({'task': task, 'trainee': trainee, 'runs': len(own), 'not_counted': sum(not run.counted for run in own), 'passed': len(passes),
                         'first_pass': passes[0] if passes else None, 'first_score': scores[0], 'best': max(scores),
                         'lately': statistics.fmean(scores[-LAST:]),
                         **{domain: statistics.fmean(values) if values else None for domain, values in of_domains.items()}})
    return rows


def marks(runs):
    """{task: {'runs', 'pass_mark', 'metrics': {name: {'mean', 'sd', 'good', 'pass', 'bad'}}}} of experts' runs: good is
    their mean, pass a standard deviation worse, bad three; the pass mark is their mean score less its standard deviation.
    Of runs that met all stages; ValueError where a task has fewer than two."""
    found = {}
    for task, trainees in grouped(runs).items():
        done = [run for own in trainees.values() for run in own if run.outcome == 'done' and run.counted]
        if len(done) < 2:
            raise ValueError('task %s has %d runs of experts that met all stages; accepted: at least 2' % (task, len(done)))
        scores = [run.score for run in done]
        entry = {'runs': len(done),
                 'pass_mark': max(0.0, statistics.fmean(scores) - statistics.stdev(scores)), 'metrics': {}}
        for name, (good, bad) in done[-1].goals.items():
            values = [run.metrics[name] for run in done if name in run.metrics]
            if len(values) < 2:
                continue
            mean, sd = statistics.fmean(values), statistics.stdev(values)
            worse = math.copysign(sd, bad - good)
            entry['metrics'][name] = {'mean': mean, 'sd': sd, 'good': mean, 'pass': mean + worse, 'bad': mean + 3.0 * worse}
        found[task] = entry
    return found


def marks_yaml(found):
    """What marks() found, as the keys `metrics` and `pass_mark` of a task file. The weights stay the task's."""
    lines = []
    for task, entry in found.items():
        lines += ['# %s: %d runs of experts' % (task, entry['runs']), 'metrics:']
        for name, of in entry['metrics'].items():
            if of['sd'] > 0.0:
                lines.append('  %s: {good: %.4g, bad: %.4g, pass: %.4g}   # mean %.4g, standard deviation %.4g'
                             % (name, of['good'], of['bad'], of['pass'], of['mean'], of['sd']))
            else:
                lines.append('  # %s: %.4g in every run, which gives no scale' % (name, of['mean']))
        lines += ['pass_mark: %.1f' % entry['pass_mark'], '']
    return '\n'.join(lines)


def _chart(title, unit, lines, band=None, mark=None, whole=None):
    """An SVG of values over the number of the run. lines: {trainee: [(number, value, passed)]}; band: (mean, sd)."""
    width, height, left, bottom, top = 460, 220, 58, 30, 24
    values = [value for points in lines.values() for _, value, _ in points]
    values += [band[0] - band[1], band[0] + band[1]] if band else []
    values += [mark] if mark is not None else []
    low, high = whole or (min(values), max(values))
    if high - low < 1e-9 * max(abs(high), 1e-12):
        low, high = low - 0.5 * (abs(low) or 1.0), high + 0.5 * (abs(high) or 1.0)
    last = max(number for points in lines.values() for number, _, _ in points)

    def x(number):
        return left + (width - left - 12) * ((number - 1) / (last - 1) if last > 1 else 0.5)

    def y(value):
        return height - bottom - (height - bottom - top) * (value - low) / (high - low)

    out = ['<svg viewBox="0 0 %d %d" width="%d" height="%d" role="img">' % (width, height, width, height),
           '<text x="%d" y="14" class="title">%s%s</text>' % (left, html.escape(title), ' [%s]' % html.escape(unit) if unit not in ('', '1') else '')]
    if band:
        out.append('<rect x="%d" y="%.1f" width="%d" height="%.1f" class="band"/>'
                   % (left, y(band[0] + band[1]), width - left - 12, max(y(band[0] - band[1]) - y(band[0] + band[1]), 0.5)))
    if mark is not None:
        out.append('<line x1="%d" x2="%d" y1="%.1f" y2="%.1f" class="mark"/>' % (left, width - 12, y(mark), y(mark)))
    for share in (0.0, 0.5, 1.0):
        value = low + share * (high - low)
        out.append('<text x="%d" y="%.1f" class="tick" text-anchor="end">%.3g</text>' % (left - 6, y(value) + 4, value))
    for number in sorted({1, (1 + last) // 2, last}):
        out.append('<text x="%.1f" y="%d" class="tick" text-anchor="middle">%d</text>' % (x(number), height - 12, number))
    out.append('<path d="M%d %d V%d H%d" class="axis"/>' % (left, top, height - bottom, width - 12))
    for k, (trainee, points) in enumerate(lines.items()):
        colour = COLOURS[k % len(COLOURS)]
        out.append('<polyline points="%s" fill="none" stroke="%s"/>'
                   % (' '.join('%.1f,%.1f' % (x(n), y(v)) for n, v, _ in points), colour))
        for n, v, passed in points:
            out.append('<circle cx="%.1f" cy="%.1f" r="3.5" stroke="%s" fill="%s"><title>%s, run %d: %.4g</title></circle>'
                       % (x(n), y(v), colour, colour if passed else '#fff', html.escape(trainee), n, v))
    return '\n'.join(out + ['</svg>'])


def page(runs, experts=()):
    """One HTML page: a table, and of each task the score and every metric that counts over the number of the run; filled
    points are runs that passed, the band is the experts' mean and standard deviation."""
    out = ['<!doctype html><html lang="en"><head><meta charset="utf-8"><title>Learning curves</title><style>',
           'body{font:15px sans-serif;margin:2em;max-width:1000px;color:#222}table{border-collapse:collapse}',
           'td,th{padding:.2em .8em;border-bottom:1px solid #ddd;text-align:right}td:first-child,td:nth-child(2){text-align:left}',
           '.title{font-weight:bold;font-size:13px}.tick{font-size:11px;fill:#666}.axis{fill:none;stroke:#999}',
           '.band{fill:#2d8a4e;opacity:.15}.mark{stroke:#c0392b;stroke-dasharray:4 3}polyline{stroke-width:1.5}',
           'svg{margin:4px}</style></head><body><h1>Learning curves</h1>',
           '<table><tr><th>task</th><th>trainee</th><th>runs</th><th>passed</th><th>first pass</th><th>first score</th><th>best</th>'
           '<th>mean of the last %d</th></tr>' % LAST]
    for row in table(runs):
        out.append('<tr><td>%s</td><td>%s</td><td>%d</td><td>%d</td><td>%s</td><td>%.1f</td><td>%.1f</td><td>%.1f</td></tr>' % (
            html.escape(row['task']), html.escape(row['trainee']), row['runs'], row['passed'],
            'run %d' % row['first_pass'] if row['first_pass'] else '-', row['first_score'], row['best'], row['lately']))
    out.append('</table>')
    for task, trainees in grouped(runs).items():
        try:
            of_experts = marks([run for name in experts for run in trainees.get(name, [])]).get(task)
        except ValueError:
            of_experts = None
        out.append('<h2>%s</h2><p>%s</p>' % (html.escape(task), ' &nbsp; '.join(
            '<span style="color:%s">&#9679; %s</span>' % (COLOURS[k % len(COLOURS)], html.escape(name)) for k, name in enumerate(trainees))))
        latest = [run for own in trainees.values() for run in own][-1]
        out.append(_chart('score', '', {name: [(n, run.score, run.passed) for n, run in enumerate(own, 1)]
                                        for name, own in trainees.items()}, mark=latest.pass_mark, whole=(0.0, 100.0)))
        for metric in latest.goals:
            lines = {name: [(n, run.metrics[metric], run.passed) for n, run in enumerate(own, 1) if metric in run.metrics]
                     for name, own in trainees.items()}
            if not any(lines.values()):
                continue
            of = of_experts and of_experts['metrics'].get(metric)
            out.append(_chart(metric, latest.units[metric], lines, (of['mean'], of['sd']) if of else None))
    return '\n'.join(out + ['</body></html>\n'])
