#!/usr/bin/env python3
"""The pages against the checkout: links, paths, and of docs/architecture.md names, rooms and threads."""
import glob
import os
import re
import sys
import unittest

import include_direction_test

CHECKOUT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
sys.path.append(os.path.join(CHECKOUT, 'bench'))
import orders  # noqa: E402


def read(path):
    with open(os.path.join(CHECKOUT, path), encoding='utf-8') as file:
        return file.read()


def pages():
    patterns = ('*.md', 'docs/**/*.md', 'bench/**/*.md')
    return sorted(os.path.relpath(path, CHECKOUT) for pattern in patterns
                  for path in glob.glob(os.path.join(CHECKOUT, pattern), recursive=True))


def withoutCode(text):
    return re.sub(r'^```.*?^```', '', text, flags=re.MULTILINE | re.DOTALL)


def anchors(text):
    """Those that GitHub makes of the headings."""
    found = set()
    for heading in re.findall(r'^#+ +(.*?)\s*$', withoutCode(text), re.MULTILINE):
        slug = re.sub(r'[^\w\- ]', '', heading.lower()).replace(' ', '-')
        number = 0
        while slug + ('-%d' % number if number else '') in found:
            number += 1
        found.add(slug + ('-%d' % number if number else ''))
    return found


def brokenLinks(page, text):
    """Of a page, relative to the checkout: links to files and headings that are not there."""
    broken = []
    for target in re.findall(r'\]\(([^)\s]+)\)', withoutCode(text)):
        if re.match(r'[a-z]+:', target):
            continue
        path, _, anchor = target.partition('#')
        file = os.path.normpath(os.path.join(os.path.dirname(page), path)) if path else page
        if not os.path.exists(os.path.join(CHECKOUT, file)):
            broken.append('%s: there is no %s' % (page, file))
        elif anchor and anchor not in anchors(text if file == page else read(file)):
            broken.append('%s: %s has no heading #%s' % (page, file, anchor))
    return broken


def missingPaths(text):
    """Of the paths of sources and tests that a page names: those that are not there."""
    ends = r'\.(?:cpp|h|py|yaml|txt|md|cmake|frag)'
    named = set(re.findall(r'(?<![\w./{-])((?:[\w.-]+/)+[\w-]+%s)(?!\w)' % ends, text))
    roots = ('', 'include/meshless_surgery', 'src')
    named = {path for path in named if not re.search(r'^\.\.|NAME|ROOM|SUBJECT', path)}  # links, and what stands for many
    return sorted(path for path in named if not any(os.path.exists(os.path.join(CHECKOUT, root, path)) for root in roots))


def sources():
    """The code without its comments: what a name is worth that stands in one alone."""
    text = ''
    for top in ('src', 'include', 'cmake', 'python', 'CMakeLists.txt'):
        found = glob.glob(os.path.join(CHECKOUT, top, '**', '*'), recursive=True) + [os.path.join(CHECKOUT, top)]
        for path in found:
            if path.endswith(('.cpp', '.h', '.cmake', '.txt', '.py')):
                text += re.sub(r'//.*', '', read(path))
    return text


def namesOf(text):
    """Names of code: in backticks, and in blocks what is spelt as code is."""
    named = set(re.findall(r'`([A-Za-z]\w{2,})`', text))
    for name in re.findall(r'`([A-Za-z]\w+(?:::\w+)+)`', text):
        named.update(name.split('::'))
    for block in re.findall(r'^```.*?^```', text, re.MULTILINE | re.DOTALL):
        named.update(re.findall(r'(?<![\w/])(?:[a-z]+[A-Z]\w*|(?:[A-Z][a-z]+){2,}\w*)(?![\w/.])', block))
    return named


def unknownNames(text, code):
    words = set(re.findall(r'\w+', code))
    return sorted(name for name in namesOf(text) if name not in words)


def tableRows(text, section):
    """The cells of the table's rows in a section, without its head."""
    part = re.search(r'^## %s$(.*?)(?=^## |\Z)' % re.escape(section), text, re.MULTILINE | re.DOTALL).group(1)
    rows = [re.split(r'(?<!\\)\|', line)[1:-1] for line in part.splitlines() if line.startswith('|')]
    return [[cell.strip() for cell in row] for row in rows[2:]]


def constant(name, text):
    """The integer that a constant of the code is."""
    value = re.search(r'\bconstexpr int %s = ([^;]+);' % name, text).group(1)
    value = re.sub(r'(?:\w+::)?(k\w+)', lambda match: str(constant(match.group(1), text)), value)
    return eval(value, {'__builtins__': {}})  # of numbers and signs


def spreads(page):
    """Of the table of docs/accuracy.md, and of the file that it is made of: cells, least, mean and most of each row."""
    with open(os.path.join(CHECKOUT, 'bench', 'results', 'accuracy_places.csv')) as file:
        rows = [line.rstrip().split(',') for line in file]
    measured = {}
    for benchmark, case, _, setting, _, error in rows:
        if benchmark.startswith('press_places_') and benchmark != 'press_places_rms':
            measured.setdefault((case, float(setting.split()[0])), []).append('%+.0f %%' % (100 * float(error)))
    return ([row[1:] for row in tableRows('## Where\n' + page.split('### Where the sphere presses')[1].split('\n- ')[0], 'Where')],
            [['%.2g' % cells] + errors for (_, cells), errors in measured.items()])


GREEK = 'alpha|beta|eps|gain|kappa|lambda|mu|omega|phi|sigma|tau|xi'


def unknownSymbols(page):
    """Of the equations: what has an index, a star or a prime, and Greek letters. An index is no part of the symbol."""
    def bare(symbol):
        return re.sub(r'_\w+', '', symbol)
    listed = {bare(symbol) for row in tableRows(page, 'Symbols') for symbol in re.findall(r'`(.*?)`', row[0])}
    equations = ''.join(re.findall(r'^```\n(.*?)^```', page, re.DOTALL | re.MULTILINE))
    used = re.findall(r"\b(?:[A-Za-z](?:_\w+|\*|')|(?:%s)\b)" % GREEK, equations)
    return {bare(symbol) for symbol in used} - listed


def order(errors):
    slope, clean = orders.order(errors)
    return round(slope, 9), clean


class AccuracyTest(unittest.TestCase):
    def testTheSpreadOverPlacesIsThatOfTheFile(self):
        said, measured = spreads(read('docs/accuracy.md'))
        self.assertGreater(len(said), 8)
        self.assertEqual(measured, said)

    def testTheOrdersOfConvergenceAreThoseOfTheFiles(self):
        part = read('docs/accuracy.md').split('## Order of convergence\n')[1].split('\n## ')[0]
        self.assertEqual(orders.table(), re.findall(r'^\| `.*', part, re.MULTILINE))

    def testAnOrderIsCleanOnlyWhereErrorsFallAlongALine(self):
        self.assertEqual((2.0, True), order({1.0: 0.04, 2.0: 0.16, 4.0: 0.64}))
        self.assertEqual([False, False], [order(errors)[1] for errors in ({1.0: 0.05, 2.0: 0.04, 4.0: 0.64}, {1.0: 0.04, 2.0: 0.6, 4.0: 0.64})])

    def testWhatIsToBeQuotedBoundsEachRow(self):
        page = read('docs/accuracy.md')
        quoted = re.search(r'sqrt\(R d\): (.*?) \|', page).group(1)
        bounds = [(float(cells), float(most)) for most, cells in re.findall(r'\+?(\d+) % with ([\d.]+)', quoted)]
        self.assertEqual(sorted(bounds, reverse=True), bounds)
        for cells, least, _, most in spreads(page)[0]:
            bound = [most for of, most in bounds if float(cells) >= of][0]
            self.assertLessEqual(max(abs(float(error.split()[0])) for error in (least, most)), bound, cells)


class LinkTest(unittest.TestCase):
    def testEveryLinkLeadsToAHeadingOrAFile(self):
        self.assertIn('docs/method.md', pages())
        self.assertEqual([], [broken for page in pages() for broken in brokenLinks(page, read(page))])

    def testOneThatDoesNotIsFound(self):
        for link in ('[a](no_such_page.md)', '[a](method.md#no-such-heading)', '[a](#nor-this)'):
            self.assertEqual(1, len(brokenLinks('docs/architecture.md', '# Page\n' + link + '\n')), link)
        self.assertEqual([], brokenLinks('docs/architecture.md', '# A page, *so*\n[a](#a-page-so) [b](method.md#symbols)'))


class PathTest(unittest.TestCase):
    def testThePathsOfMethodAndArchitectureAreThere(self):
        for page in ('docs/method.md', 'docs/architecture.md', 'CONTRIBUTING.md'):
            self.assertEqual([], missingPaths(read(page)), page)

    def testOneThatIsNotIsFound(self):
        self.assertEqual(['body/soul.h'], missingPaths('(`body/soul.h`), `body/body.h` and src/body/body.cpp'))


class SymbolTest(unittest.TestCase):
    def testEachOfTheEquationsIsInTheTable(self):
        self.assertEqual(set(), unknownSymbols(read('docs/method.md')))

    def testOneThatIsNotIsFound(self):
        page = '## Symbols\n\n| symbol | unit | meaning |\n|---|---|---|\n| `x_i`, `h` | m, s | |\n\n```\n(1) y_i = alpha x_i + h* c\'\n```\n'
        self.assertEqual({'y', 'alpha', 'h*', "c'"}, unknownSymbols(page))


class ArchitectureTest(unittest.TestCase):
    def setUp(self):
        self.page = read('docs/architecture.md')
        self.code = sources()

    def testItsNamesAreOfTheCode(self):
        self.assertGreater(len(namesOf(self.page)), 60)
        self.assertEqual([], unknownNames(self.page, self.code))

    def testOneThatIsNotIsFound(self):
        self.assertEqual(['World2', 'stepTheWorld'], unknownNames('`World2`, `World::step`\n```\nx  stepTheWorld\n```\n', self.code))

    def testItsRoomsAreThoseOfTheIncludes(self):
        listed = {row[0].strip('`'): set(re.findall(r'`(\w+)`', row[2])) for row in tableRows(self.page, 'Rooms')}
        may = {room: others for room, others in include_direction_test.MAY_INCLUDE.items() if not room.endswith('_main')}
        self.assertEqual(may, listed)

    def testItsThreadsAreThoseOfTheNode(self):
        code = ''.join(read(os.path.relpath(path, CHECKOUT)) for pattern in ('src/ros/*', 'src/node_main/run_node.h',
                                                                            'include/meshless_surgery/ros/*.h')
                       for path in glob.glob(os.path.join(CHECKOUT, pattern)) if 'review_node' not in path)
        rows = tableRows(self.page, 'Threads')
        total = sum(int(row[1]) for row in rows)
        spinners = re.findall(r'ros::AsyncSpinner \w+[{(]([\w]+)', code)
        self.assertEqual(sum(int(n) if n.isdigit() else constant(n, code) for n in spinners) +
                         len(re.findall(r'std::thread \w+_;', code)), total)
        for row in rows:
            for name in re.findall(r'`(k\w+)`', row[0]):
                self.assertEqual(constant(name, code), int(row[1]), row[0])


if __name__ == '__main__':
    unittest.main()
