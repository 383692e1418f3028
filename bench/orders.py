#!/usr/bin/env python3
"""Order of convergence in space of each truth: the slope of log(error) over log(spacing), of the rows that `accuracy` wrote. Prints the
table of docs/accuracy.md, which test/docs_test.py compares. Of the push sphere there is none: its errors go by the cells in its contact."""
import math
import os
import re

RESULTS = os.path.join(os.path.dirname(os.path.abspath(__file__)), 'results')
FARTHEST = 1 / 3  # of an error from the fitted line, where the order is called clean
OF = {'fem': 'shape', 'fem_force': 'force', 'settled': 'surface', 'settled_slope': 'slope', 'pull_tip': 'displacement'}


def errorsBySpacing():
    """(benchmark, case) -> {spacing [mm]: error}, of elastic cells at rest."""
    known = {}
    for name in ('accuracy.csv', 'accuracy_resolutions.csv'):
        with open(os.path.join(RESULTS, name), encoding='utf-8') as file:
            for line in file:
                benchmark, case, mode, setting, _, error = line.rstrip().split(',')
                spacing = re.match(r'(?:cells )?([\d.]+) mm \d+$', setting)
                if spacing and benchmark in OF and mode in ('elastic', 'filled'):
                    known.setdefault((benchmark, case), {}).setdefault(float(spacing.group(1)), abs(float(error)))
    return known


def order(errors):
    """The fitted exponent; whether each finer spacing has a smaller error, and none lies far from the line."""
    spacings = sorted(errors, reverse=True)
    x, y = [math.log(h) for h in spacings], [math.log(errors[h]) for h in spacings]
    middle, height = sum(x) / len(x), sum(y) / len(y)
    slope = sum((a - middle) * (b - height) for a, b in zip(x, y)) / sum((a - middle) ** 2 for a in x)
    near = all(abs(math.expm1(b - height - slope * (a - middle))) < FARTHEST for a, b in zip(x, y))
    return slope, near and all(coarse > fine for coarse, fine in zip(y, y[1:]))


def table():
    """A row for each truth: those of both Poisson's ratios, and of a surface and its slope, share one."""
    rows = {}
    for (benchmark, case), errors in errorsBySpacing().items():
        truth = re.sub(r'(?<!^bar)_nu(?:30|45)$', '', case)  # bar_nu45 is by itself
        rows.setdefault((benchmark.replace('_slope', ''), truth), []).append((OF[benchmark], errors))
    lines = []
    for (_, truth), series in rows.items():
        sizes = sorted({h for _, errors in series for h in errors}, reverse=True)
        what = list(dict.fromkeys(of for of, _ in series))
        names = ' / '.join(what) + (', nu 0.3 / 0.45' if len(what) < len(series) else '')
        lines.append('| `%s` | %s | %d, %.3g to %.3g mm | %s %% | %s |' % (
            truth, names, len(series[0][1]), sizes[0], sizes[-1],
            ' / '.join(', '.join('%.2g' % (100 * errors[h]) for h in sorted(errors, reverse=True)) for _, errors in series),
            ' / '.join('%.1f' % slope if clean else 'not clean' for slope, clean in (order(errors) for _, errors in series))))
    return lines


if __name__ == '__main__':
    print('\n'.join(table()))
