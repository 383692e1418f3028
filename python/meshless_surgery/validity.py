"""Whether scores tell two groups of trainees apart, and how well one run tells a trainee: construct validity, from reports.

    from meshless_surgery import curves, validity
    runs, faults = curves.read(folder)
    validity.compare(runs, novices={'ann', 'bob'}, experts={'eve', 'zoe'})

Runs that do not count are left out. A trainee counts once, by the mean of their runs, however many these are. Needs neither ROS nor a network.
"""
import html
import math
import statistics

from meshless_surgery import curves

def effect(worse, better):
    """Hedges' g of two lists of values, and its 95 % interval: how many standard deviations `better` is above `worse`."""
    a, b = len(worse), len(better)
    pooled = math.sqrt(((a - 1) * statistics.variance(worse) + (b - 1) * statistics.variance(better)) / (a + b - 2))
    way = statistics.fmean(better) - statistics.fmean(worse)
    if pooled == 0.0:
        return (math.copysign(math.inf, way) if way else 0.0,) * 3
    g = way / pooled * (1.0 - 3.0 / (4.0 * (a + b) - 9.0))
    half = 1.96 * math.sqrt((a + b) / (a * b) + g * g / (2.0 * (a + b)))
    return g, g - half, g + half


def reliability(of_trainees):
    """The intraclass correlation ICC(1, 1), one-way random, of lists of values, one a trainee: the share of the variance of one
    run that is the trainee's. None where no trainee has two runs, or all values are the same. Shrout and Fleiss 1979."""
    lists = [values for values in of_trainees if values]
    count, groups = sum(len(values) for values in lists), len(lists)
    if groups < 2 or count == groups:
        return None
    mean = sum(sum(values) for values in lists) / count
    between = sum(len(values) * (statistics.fmean(values) - mean) ** 2 for values in lists) / (groups - 1)
    within = sum(sum((v - statistics.fmean(values)) ** 2 for v in values) for values in lists) / (count - groups)
    size = (count - sum(len(values) ** 2 for values in lists) / count) / (groups - 1)
    if between + (size - 1.0) * within == 0.0:
        return None
    return (between - within) / (between + (size - 1.0) * within)


def contrasting(worse, better):
    """The pass mark by contrasting groups: where the normal curves of the two meet between their means; where they do not meet
    there, the middle. None where `better` is no better."""
    a, b = statistics.fmean(worse), statistics.fmean(better)
    s, t = statistics.stdev(worse), statistics.stdev(better)
    if not b > a:
        return None
    if s == 0.0 or t == 0.0:
        return 0.5 * (a + b)
    low, high = a, b
    above = (lambda x: -0.5 * ((x - a) / s) ** 2 - math.log(s) + 0.5 * ((x - b) / t) ** 2 + math.log(t))
    if not above(low) > 0.0 > above(high):
        return 0.5 * (a + b)
    for _ in range(100):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if above(middle) > 0.0 else (low, middle)
    return low


def compare(runs, novices, experts):
    """{task: {'novices', 'experts': {trainee: mean score}, 'g', 'interval', 'icc', 'pass_mark', 'novices_pass', 'experts_fail',
    'metrics': {name: (mean of novices, of experts, g)}}}. ValueError where a group of a task has fewer than two trainees."""
    found = {}
    for task, trainees in curves.grouped([run for run in runs if run.counted]).items():
        groups = {'novices': [t for t in trainees if t in novices], 'experts': [t for t in trainees if t in experts]}
        for group, names in groups.items():
            if len(names) < 2:
                raise ValueError('task %s has %d of the %s (%s); accepted: at least 2' % (task, len(names), group, ', '.join(names) or 'nobody'))
        scores = {group: {name: statistics.fmean(run.score for run in trainees[name]) for name in names} for group, names in groups.items()}
        worse, better = list(scores['novices'].values()), list(scores['experts'].values())
        g, low, high = effect(worse, better)
        mark = contrasting(worse, better)
        entry = {**scores, 'g': g, 'interval': (low, high), 'icc': reliability([[run.score for run in own] for own in trainees.values()]),
                 'pass_mark': mark, 'novices_pass': mark is not None and sum(v >= mark for v in worse),
                 'experts_fail': mark is not None and sum(v < mark for v in better), 'metrics': {}}
        latest = [run for own in trainees.values() for run in own][-1]
        for name, (good, bad) in latest.goals.items():
            means = {}
            for group, names in groups.items():
                of = [[run.metrics[name] for run in trainees[one] if name in run.metrics] for one in names]
                means[group] = [statistics.fmean(values) for values in of if values]
            if all(len(values) > 1 for values in means.values()):
                sign = 1.0 if good > bad else -1.0  # above 0: experts are better
                entry['metrics'][name] = (statistics.fmean(means['novices']), statistics.fmean(means['experts']),
                                          sign * effect(means['novices'], means['experts'])[0])
        found[task] = entry
    return found


def page(found):
    """One HTML page: of each task the scores of the two groups, the pass mark between them, and what tells them apart."""
    out = ['<!doctype html><html lang="en"><head><meta charset="utf-8"><title>Construct validity</title><style>',
           'body{font:15px sans-serif;margin:2em;max-width:1000px;color:#222}table{border-collapse:collapse}',
           'td,th{padding:.2em .8em;border-bottom:1px solid #ddd;text-align:right}td:first-child{text-align:left}text{font:12px sans-serif;fill:#444}',
           '</style></head><body><h1>Construct validity</h1>']
    for task, entry in found.items():
        out.append('<h2>%s</h2>' % html.escape(task))
        rows = [('novices', '#c0392b', 40), ('experts', '#2d8a4e', 80)]
        out.append('<svg viewBox="0 0 700 120" width="700" height="120" role="img"><title>scores of the two groups</title>')
        for group, colour, y in rows:
            out.append('<text x="4" y="%d">%s</text>' % (y + 4, group))
            for name, score in entry[group].items():
                out.append('<circle cx="%.1f" cy="%d" r="5" fill="%s" fill-opacity="0.7"><title>%s: %.1f</title></circle>'
                           % (80 + 6 * score, y, colour, html.escape(name), score))
        if entry['pass_mark'] is not None:
            out.append('<line x1="%.1f" x2="%.1f" y1="20" y2="95" stroke="#333" stroke-dasharray="5 4"/>' % ((80 + 6 * entry['pass_mark'],) * 2))
        for score in (0, 25, 50, 75, 100):
            out.append('<text x="%d" y="114" text-anchor="middle">%d</text>' % (80 + 6 * score, score))
        out.append('</svg><p>%s</p>' % html.escape(sentence(entry)))
        out.append('<table><tr><th>metric</th><th>novices</th><th>experts</th><th>g</th></tr>')
        for name, (worse, better, g) in sorted(entry['metrics'].items(), key=lambda item: -item[1][2]):
            out.append('<tr><td>%s</td><td>%.4g</td><td>%.4g</td><td>%.2f</td></tr>' % (html.escape(name), worse, better, g))
        out.append('</table>')
    return '\n'.join(out + ['</body></html>\n'])


def sentence(entry):
    """What compare() found of a task, in words."""
    said = "Hedges' g of the scores is %.2f (%.2f to %.2f)" % (entry['g'], *entry['interval'])
    said += '; ICC(1, 1) of a run is %.2f' % entry['icc'] if entry['icc'] is not None else '; no trainee has two runs, so there is no ICC'
    if entry['pass_mark'] is None:
        return said + '; experts are not better, so there is no pass mark.'
    return said + '; the pass mark is %.1f: %d of %d novices pass, %d of %d experts fail.' % (
        entry['pass_mark'], entry['novices_pass'], len(entry['novices']), entry['experts_fail'], len(entry['experts']))
