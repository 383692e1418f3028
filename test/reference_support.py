"""For the tests of docs/reference: tables of pages, calls and constants of C++. What a pattern does not find is a failure."""
import glob
import os
import re

from docs_test import CHECKOUT, read

NUMBER = r'-?\d[\d,]*(?:\.\d+)?(?:e[+-]?\d+)?'


def files(pattern):
    found = sorted(os.path.relpath(path, CHECKOUT) for path in glob.glob(os.path.join(CHECKOUT, pattern)))
    assert found, 'there is no ' + pattern
    return found


def stems(pattern):
    return {os.path.splitext(os.path.basename(path))[0] for path in files(pattern)}


def found(pattern, text, flags=0):
    """All matches: at least one."""
    matches = re.findall(pattern, text, flags)
    assert matches, 'nothing in the source is like ' + pattern
    return matches


def only(pattern, text, flags=re.DOTALL):
    return found(pattern, text, flags)[0]


def named(cell):
    return re.findall(r'`([^`]+)`', cell)


def rows(text, section, first):
    """The cells of the rows of the table in a section (of any level) whose head begins with `first`."""
    part = only(r'^#+ %s$(.*?)(?=^#|\Z)' % re.escape(section), re.sub(r'^```.*?^```', '', text, flags=re.M | re.DOTALL), re.M | re.DOTALL)
    for table in re.findall(r'(?:^\|.*\n?)+', part, re.M):
        cells = [[cell.strip() for cell in re.split(r'(?<!\\)\|', line)[1:-1]] for line in table.splitlines()]
        if cells[0][0] == first:
            return cells[2:]
    raise AssertionError('%s has no table that begins with %s' % (section, first))


def number(text):
    return float(text.replace(',', ''))


def rangeOf(cell):
    """(from, to, whether `from` is left out, unit), or None."""
    match = re.search(r'(above )?(%s) to (%s)(?: (1/s|(?:m|s|rad|Hz|Pa|N|ml|kg|J)(?:/(?:m|s|Pa)[²³]?)?)(?!\w))?' % (NUMBER, NUMBER), cell)
    if not match:
        return None
    return number(match.group(2)), number(match.group(3)), bool(match.group(1)), match.group(4) or ''


def valueOf(cell):
    """What a default is: a number, a list of them, a word; None where it is said in words."""
    cell = re.sub(r':.*', '', cell).strip('`')
    if re.match(r'%s( [A-Za-z/]+)?$' % NUMBER, cell):
        return number(cell.split()[0])
    if re.match(r'\[[-\d., ]+\]$', cell):
        return [number(word) for word in cell[1:-1].split(',')]
    return '' if cell == 'empty' else cell.split(',')[0] if re.match(r'[\w/.]+$|required', cell) and cell != 'none' else None


def split(text):
    """Arguments, at the commas outside of brackets and strings."""
    parts, depth, quoted = [''], 0, False
    for at, c in enumerate(text):
        quoted ^= c == '"' and text[at - 1] != '\\'
        depth += 0 if quoted else (c in '({[') - (c in ')}]')
        parts.append('') if c == ',' and not depth and not quoted else parts.append(parts.pop() + c)
    return [part.strip() for part in parts]


def inside(text, start, pair='()'):
    """What stands between the bracket at `start` and its partner."""
    depth = 0
    for at in range(start, len(text)):
        depth += (text[at] == pair[0]) - (text[at] == pair[1])
        if not depth:
            return text[start + 1:at]
    raise AssertionError('a bracket is not closed')


def calls(pattern, text):
    """(match, arguments) of each call whose name is like that."""
    return [(match, split(inside(text, match.end() - 1))) for match in re.finditer(pattern + r'\(', text)]


def constant(expression, text):
    """The number that it is, with the constants of the text."""
    def resolved(match):
        return '(%s)' % constant(only(r'\b%s(?:\{| = )([^;,}]+(?:\} << \d+)?)' % match.group(0), text), text)
    plain = re.sub(r'\bk[A-Z]\w*', resolved, re.sub(r'\w+::(?=k)', '', expression))
    plain = re.sub(r'std::\w+\{(\d+)\}', r'\1', plain)
    plain = re.sub(r'\b(\d+)u?l*\b', r'\1', plain)
    return eval(plain, {'__builtins__': {}})  # of numbers and signs


class Compared:
    """code() and said(text of the page) are compared: what only one of them has, and where the two differ."""
    page = ''
    least = 1       # so many there are
    planted = ()    # (what the page has, what would be wrong)

    def agree(self, code, said):
        return code == said

    def text(self):
        return read('docs/reference/%s.md' % self.page)

    def differences(self, text):
        code, said = self.code(), self.said(text)
        self.assertGreaterEqual(len(code), self.least)
        return ['%s: %s in the code, %s on the page' % (name, code.get(name, 'not there'), said.get(name, 'not there'))
                for name in sorted(set(code) | set(said), key=str)
                if name not in code or name not in said or not self.agree(code[name], said[name])]

    def testThePageSaysWhatTheSourcesSay(self):
        self.assertEqual([], self.differences(self.text()))

    def testWhatDoesNotIsFound(self):
        self.assertTrue(self.planted)
        for right, wrong in self.planted:
            self.assertIn(right, self.text())
            self.assertNotEqual([], self.differences(self.text().replace(right, wrong)), wrong)


def members(struct, text):
    """name -> what a member of a struct begins as: a number, a list, a word."""
    body = inside(text, re.search(r'struct %s\b[^{]*' % struct, text).end(), '{}')
    known = {}
    for name, value, braces in re.findall(r'\b(\w+)(?: = ([^;]+)|\{([^;]*)\})?;', body):
        value = value or braces
        enumerator = re.match(r'(?:\w+::)+k(\w+)$', value)
        known[name] = (enumerator.group(1).lower() if enumerator else value.strip('"') if value[:1] == '"' else
                       [float(v) for v in split(value)] if re.match(r'[-\d., ]+,[-\d., ]+$', value) else
                       float(value) if re.match(r'%s$' % NUMBER, value) else value if value in ('true', 'false') else '')
    return known
