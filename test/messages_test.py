#!/usr/bin/env python3
"""What holds of all messages and services together, read from their files."""
import glob
import os
import re
import unittest

CHECKOUT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))


def text(path):
    with open(os.path.join(CHECKOUT, path)) as file:
        return file.read()


def enumerators(path, enum):
    """`kLikeThis` of an enum class, as LIKE_THIS."""
    body = re.search(r'enum class %s \{(.*?)\};' % enum, text(path), re.DOTALL).group(1)
    names = re.findall(r'\bk([A-Z]\w*)', re.sub(r'//.*', '', body))
    return [re.sub(r'(?<=[a-z])(?=[A-Z])', '_', name).upper() for name in names]


def fields(definition):
    """(type, name, constant's value or None), without comments."""
    found = []
    for line in definition.splitlines():
        line = line if line.startswith('string ') and '=' in line else line.split('#')[0]
        if line.strip():
            kind, rest = line.split(None, 1)
            name, _, value = rest.partition('=')
            found.append((kind, name.strip(), value.strip() or None))
    return found


class ErrorCodeTest(unittest.TestCase):

    def test_every_answer_ends_with_the_same_codes_and_those_are_the_cores(self):
        core = ['OK'] + enumerators('include/meshless_surgery/base/result.h', 'ErrorCode')
        self.assertGreater(len(core), 5)
        wanted = [('int32', name, str(number)) for number, name in enumerate(core)]
        services = sorted(glob.glob(os.path.join(CHECKOUT, 'srv', '*.srv')))
        self.assertGreater(len(services), 10)
        for service in services:
            with self.subTest(service=os.path.basename(service)):
                answer = fields(text(service).split('\n---\n')[1])
                self.assertEqual([('bool', 'success', None), ('string', 'message', None)], answer[:2])
                self.assertEqual(('int32', 'error_code', None), answer[-1])
                self.assertEqual(wanted, [field for field in answer if field[2] is not None])

    def test_the_docs_have_each_code_with_its_number(self):
        docs = text('docs/reference/services.md')
        for number, name in enumerate(['OK'] + enumerators('include/meshless_surgery/base/result.h', 'ErrorCode')):
            self.assertRegex(docs, r'\| `%s` \| %d \|' % (name, number))


class ActionTest(unittest.TestCase):

    def test_goals_and_results_have_the_fields_of_the_service(self):
        """So one handler works on both."""
        actions = sorted(glob.glob(os.path.join(CHECKOUT, 'action', '*.action')))
        self.assertEqual(4, len(actions))
        for action in actions:
            name = os.path.splitext(os.path.basename(action))[0]
            with self.subTest(action=name):
                goal, result, feedback = (fields(part) for part in text(action).split('---\n'))
                request, answer = (fields(part) for part in text('srv/%s.srv' % name).split('---\n'))
                self.assertEqual(request, goal)
                more = [('uint32', 'steps_done', None)] if name == 'Step' else []
                self.assertEqual(answer, [field for field in result if field not in more])
                self.assertEqual(len(answer) + len(more), len(result))
                self.assertIn(('string', 'WAITING', 'waiting'), feedback)
                self.assertIn(('string', 'phase', None), feedback)


class EventTest(unittest.TestCase):

    def test_every_type_that_the_core_knows_has_its_constant(self):
        words = dict(re.findall(r'case EventType::k(\w+):\s+return "([^"]+)";', text('src/world/world.cpp')))
        wanted = enumerators('include/meshless_surgery/world/world.h', 'EventType')
        constants = [(kind, name, value) for kind, name, value in fields(text('msg/Event.msg')) if value is not None]
        self.assertEqual(wanted, [name for _, name, _ in constants])
        self.assertEqual([('string', name, word) for name, word in zip(wanted, words.values())], constants)
        last = re.search(r'kLastEvent = EventType::k(\w+);', text('include/meshless_surgery/world/world.h')).group(1)
        self.assertEqual(list(words)[-1], last)  # what is read from files is checked against it


if __name__ == '__main__':
    unittest.main()
