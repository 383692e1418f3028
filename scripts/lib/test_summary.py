#!/usr/bin/env python3
"""Counts what a run of ctest did: the cases in the JUnit files that its tests wrote, or ctest's own entries.

test_summary.py --build FOLDER --log FILE --out FILE --count cases|entries [-- CTEST_ARGUMENTS]

The log is ctest's output. Every test that ctest lists under the same arguments counts: one that did not run has failed.
Prints what failed, and writes "passed failed skipped" to --out.
"""
import argparse
import collections
import json
import os
import re
import subprocess
import sys
import xml.etree.ElementTree

Counts = collections.namedtuple('Counts', 'passed failed skipped')
# One test of ctest: its name, its result ('Passed', 'Failed', 'Timeout', ...) or None, and its JUnit file or None.
Entry = collections.namedtuple('Entry', 'name result junit')
# One case of a JUnit file; text is the failure's.
Case = collections.namedtuple('Case', 'name outcome text')

RESULT_LINE = re.compile(r'^\s*\d+/\d+ Test\s+#\d+: (\S+) \.*\s*(?:\*\*\*)?([A-Z][A-Za-z ]*?)(?::.*|\s+[\d.]+ sec.*)?$')
SHOWN_LINES = 12


def parseResults(log_text):
    """ctest's results by test name."""
    results = {}
    for line in log_text.splitlines():
        match = RESULT_LINE.match(line)
        if match:
            results[match.group(1)] = match.group(2).strip()
    return results


def listEntries(tests, results):
    """tests: the list in ctest's --show-only=json-v1. catkin's command names the JUnit file after run_tests.py."""
    entries = []
    for test in tests:
        command = test.get('command', [])
        junit = None
        for before, argument in zip(command, command[1:]):
            if os.path.basename(before) == 'run_tests.py' and argument.endswith('.xml'):
                junit = argument
        entries.append(Entry(test['name'], results.get(test['name']), junit))
    return entries


def readCases(path):
    """The cases of a JUnit file; None where it is missing or broken."""
    try:
        root = xml.etree.ElementTree.parse(path).getroot()
    except (OSError, xml.etree.ElementTree.ParseError):
        return None
    cases = []
    for case in root.iter('testcase'):
        name = '.'.join(part for part in (case.get('classname'), case.get('name')) if part)
        wrong = case.find('failure')
        if wrong is None:
            wrong = case.find('error')
        if wrong is not None:
            cases.append(Case(name, 'failed', wrong.text or wrong.get('message') or ''))
        elif case.find('skipped') is not None or case.get('result') == 'skipped' or case.get('status') == 'notrun':
            cases.append(Case(name, 'skipped', ''))
        else:
            cases.append(Case(name, 'passed', ''))
    return cases


def allCases(entry):
    """The cases of one entry. rostest writes a file with one case for each <test>, which says no more than that it ran,
    and beside it a file rosunit-NAME.xml with the cases themselves: these stand in for the former."""
    cases = readCases(entry.junit)
    if cases is None or not os.path.basename(entry.junit).startswith('rostest-'):
        return cases
    detailed = []
    for case in cases:
        name = re.sub(r'^test', '', case.name.split('.')[-1])
        inner = readCases(os.path.join(os.path.dirname(entry.junit), 'rosunit-%s.xml' % name))
        if inner:
            detailed += inner
            if case.outcome == 'failed' and all(c.outcome != 'failed' for c in inner):
                detailed.append(case)
        else:
            detailed.append(case)
    return detailed


def summarize(entries, count_cases):
    """The counts, and a text for each failure."""
    passed = failed = skipped = 0
    failures = []
    for entry in entries:
        went_well = entry.result in ('Passed', 'Skipped')
        cases = allCases(entry) if count_cases and entry.junit and entry.result not in (None, 'Not Run') else None
        if cases:
            passed += sum(case.outcome == 'passed' for case in cases)
            skipped += sum(case.outcome == 'skipped' for case in cases)
            wrong = [case for case in cases if case.outcome == 'failed']
            failed += len(wrong)
            failures += ['%s: %s\n%s' % (entry.name, case.name, shorten(case.text)) for case in wrong]
            if went_well or wrong:
                continue
        elif went_well:
            passed += entry.result == 'Passed'
            skipped += entry.result == 'Skipped'
            continue
        # Cases alone do not tell of a crash at the end, a time limit or a test that was never started.
        failed += 1
        failures.append('%s: %s' % (entry.name, entry.result or 'did not run'))
    if not entries:
        failed += 1
        failures.append('no test was found')
    return Counts(passed, failed, skipped), failures


def shorten(text):
    lines = text.strip().splitlines()
    if len(lines) > SHOWN_LINES:
        lines = lines[:SHOWN_LINES] + ['...']
    return '\n'.join('    ' + line for line in lines)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--build', required=True, help='the folder in which ctest ran')
    parser.add_argument('--log', required=True, help="ctest's output")
    parser.add_argument('--out', required=True, help='where to write "passed failed skipped"')
    parser.add_argument('--count', choices=('cases', 'entries'), required=True)
    parser.add_argument('ctest_arguments', nargs='*')
    options = parser.parse_args()

    listed = subprocess.run(['ctest', '--show-only=json-v1'] + options.ctest_arguments, cwd=options.build,
                            stdout=subprocess.PIPE, check=True)
    with open(options.log, encoding='utf-8', errors='replace') as log:
        results = parseResults(log.read())
    entries = listEntries(json.loads(listed.stdout)['tests'], results)
    counts, failures = summarize(entries, options.count == 'cases')
    for failure in failures:
        print('FAILED ' + failure)
    if failures:
        print('The whole log: ' + options.log)
    with open(options.out, 'w', encoding='utf-8') as out:
        print(*counts, file=out)


if __name__ == '__main__':
    sys.exit(main())
