#include "yaml_map.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <sstream>

#include <yaml-cpp/eventhandler.h>

#include "opened_file.h"

namespace meshless {
namespace {

constexpr std::size_t kMaxBytes = 1 << 20;
constexpr std::size_t kMaxValues = 1000000;
constexpr int kMaxDepth = 50;  // of brackets and of indentation

std::string where(const std::string& name, const YAML::Mark& mark) {
  return mark.is_null() ? name : name + ":" + std::to_string(mark.line + 1);
}

std::string join(std::vector<std::string> words) {
  std::sort(words.begin(), words.end());
  words.erase(std::unique(words.begin(), words.end()), words.end());
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : ", ") + word;
  return text;
}

/// A document nested so deep would use up the parser's stack. Quotes and comments are not told apart: no scene comes
/// near the bound.
bool tooDeep(const std::string& text) {
  int depth = 0, dashes = 0;
  bool line_start = true;
  for (const char c : text) {
    if (c == '[' || c == '{') ++depth;
    if (c == ']' || c == '}') depth = std::max(0, depth - 1);
    if (c == '\n') {
      line_start = true;
      dashes = 0;
    } else if (line_start && (c == '-' || c == '?')) {
      ++dashes;
    } else if (c != ' ') {
      line_start = false;
    }
    if (depth > kMaxDepth || dashes > kMaxDepth) return true;
  }
  return false;
}

/// Counts what the parser says, before anything is made of it: it has texts of which it makes documents without end.
class Counter : public YAML::EventHandler {
 public:
  std::size_t documents = 0;

  void OnDocumentStart(const YAML::Mark&) override { ++documents; }
  void OnDocumentEnd() override {}
  void OnNull(const YAML::Mark& mark, YAML::anchor_t) override { count(mark); }
  void OnAlias(const YAML::Mark& mark, YAML::anchor_t) override { count(mark); }
  void OnScalar(const YAML::Mark& mark, const std::string&, YAML::anchor_t, const std::string&) override {
    count(mark);
  }
  void OnSequenceStart(const YAML::Mark& mark, const std::string&, YAML::anchor_t, YAML::EmitterStyle::value) override {
    count(mark);
  }
  void OnSequenceEnd() override {}
  void OnMapStart(const YAML::Mark& mark, const std::string&, YAML::anchor_t, YAML::EmitterStyle::value) override {
    count(mark);
  }
  void OnMapEnd() override {}

 private:
  void count(const YAML::Mark& mark) {
    if (++values_ > kMaxValues) throw YAML::ParserException(mark, "there are more than 1000000 values");
  }
  std::size_t values_ = 0;
};

/// How many documents there are, up to two.
std::size_t documentsIn(const std::string& text) {
  std::istringstream in(text);
  YAML::Parser parser(in);
  Counter counter;
  while (counter.documents < 2 && parser.HandleNextDocument(counter)) {
  }
  return counter.documents;
}

/// Aliases make a node its own descendant, or a small text a huge tree: the whole tree is walked once, and counted.
bool tooLarge(const YAML::Node& node, int depth, std::size_t& nodes) {
  if (depth > kMaxDepth || ++nodes > kMaxValues) return true;
  if (node.IsSequence())
    for (const auto& child : node)
      if (tooLarge(child, depth + 1, nodes)) return true;
  if (node.IsMap())
    for (const auto& child : node)
      if (tooLarge(child.first, depth + 1, nodes) || tooLarge(child.second, depth + 1, nodes)) return true;
  return false;
}

std::size_t editDistance(const std::string& a, const std::string& b) {
  std::vector<std::vector<std::size_t>> d(a.size() + 1, std::vector<std::size_t>(b.size() + 1));
  for (std::size_t i = 0; i <= a.size(); ++i)
    for (std::size_t j = 0; j <= b.size(); ++j) {
      if (i == 0 || j == 0) {
        d[i][j] = i + j;
        continue;
      }
      d[i][j] = std::min({d[i - 1][j] + 1, d[i][j - 1] + 1, d[i - 1][j - 1] + (a[i - 1] != b[j - 1])});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1])
        d[i][j] = std::min(d[i][j], d[i - 2][j - 2] + 1);
    }
  return d[a.size()][b.size()];
}

}  // namespace

void YamlSource::fail(const YAML::Node& at, const std::string& what, const std::string& accepted, ErrorCode code) {
  if (fault) return;
  const std::string place = at.IsDefined() ? where(name, at.Mark()) : name;
  fault = Error{code, place + ": " + what + (accepted.empty() ? "" : "; accepted: " + accepted)};
}

void YamlSource::warn(const YAML::Node& at, const std::string& what) {
  warnings.push_back(where(name, at.Mark()) + ": " + what);
}

Result<YAML::Node> parseYaml(const std::string& text, const std::string& name) {
  if (text.size() > kMaxBytes)
    return Error{ErrorCode::kUnreadable,
                 name + ": has " + std::to_string(text.size()) + " bytes; accepted: up to 1048576 (1 MiB)"};
  if (tooDeep(text))
    return Error{ErrorCode::kInvalidArgument, name + ": is nested too deep; accepted: up to 50 levels"};
  try {
    const std::size_t documents = documentsIn(text);
    if (documents > 1) return Error{ErrorCode::kInvalidArgument, name + ": has more than one document; accepted: one"};
    std::size_t nodes = 0;
    if (documents == 0) return YAML::Node();
    const YAML::Node document = YAML::Load(text);
    if (tooLarge(document, 0, nodes))
      return Error{ErrorCode::kInvalidArgument,
                   name + ": is too large with its aliases written out; accepted: up to 50 levels, 1000000 values"};
    return document;
  } catch (const YAML::Exception& e) {
    return Error{ErrorCode::kInvalidArgument, where(name, e.mark) + ": " + e.msg + "; accepted: YAML"};
  } catch (const std::exception& e) {
    return Error{ErrorCode::kInvalidArgument, name + ": " + e.what() + "; accepted: YAML"};
  }
}

Result<YAML::Node> readYamlFile(const std::string& real_path, const std::string& name) {
  const Result<FileBytes> read = readFile(real_path, kMaxBytes);
  if (!read) return Error{read.error().code, name + ": " + read.error().detail};
  return parseYaml(std::string(read->text()), name);
}

std::string shown(const YAML::Node& value) {
  if (!value.IsDefined()) return "absent";
  if (value.IsNull()) return "empty";
  if (value.IsSequence()) return "a list of " + std::to_string(value.size());
  if (value.IsMap()) return "a map";
  std::string text = value.Scalar().substr(0, 60);
  for (char& c : text)
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = '?';
  return "'" + text + "'";
}

std::string nearestWord(const std::string& word, const std::vector<std::string>& known) {
  std::string best;
  std::size_t least = 0;
  for (const std::string& candidate : known) {
    const std::size_t distance = editDistance(word.substr(0, 100), candidate);
    if (best.empty() || distance < least) {
      best = candidate;
      least = distance;
    }
  }
  return best;
}

std::string NumberRange::text() const {
  std::ostringstream out;
  out << (open_from ? "above " : "") << from << " to " << to << (*unit ? " " : "") << unit;
  return out.str();
}

bool readNumber(YamlSource& source, const YAML::Node& node, const std::string& what, NumberRange range, double& value) {
  double number = 0.0;
  if (!node.IsScalar() || !YAML::convert<double>::decode(node, number)) {
    source.fail(node, what + " is " + shown(node), "a number, " + range.text());
    return false;
  }
  if (!std::isfinite(number) || !range.holds(number)) {
    source.fail(node, what + " is " + node.Scalar().substr(0, 60), range.text());
    return false;
  }
  value = number;
  return true;
}

bool readWhole(YamlSource& source, const YAML::Node& node, const std::string& what, int from, int to, int& value) {
  const std::string accepted = "a whole number, " + std::to_string(from) + " to " + std::to_string(to);
  int number = 0;
  if (!node.IsScalar() || !YAML::convert<int>::decode(node, number) || number < from || number > to) {
    source.fail(node, what + " is " + shown(node), accepted);
    return false;
  }
  value = number;
  return true;
}

bool readText(YamlSource& source, const YAML::Node& node, const std::string& what, std::string& value) {
  if (!node.IsScalar() || node.Scalar().empty()) {
    source.fail(node, what + " is " + shown(node), "a text");
    return false;
  }
  value = node.Scalar();
  return true;
}

YamlMap::YamlMap(YamlSource& source, const YAML::Node& node, std::string what)
    : source_(source), node_(node), what_(std::move(what)) {
  if (!node_.IsMap()) {
    source_.fail(node_, what_ + " is " + shown(node_), "a map of keys and values");
    node_ = YAML::Node(YAML::NodeType::Map);
    return;
  }
  std::set<std::string> seen;
  for (const auto& entry : node_) {
    if (!entry.first.IsScalar()) {
      source_.fail(entry.first, "a key of " + what_ + " is " + shown(entry.first), "words");
    } else if (!seen.insert(entry.first.Scalar()).second) {
      source_.fail(entry.first, what_ + " has the key " + shown(entry.first) + " twice", "each key once");
    }
  }
}

YAML::Node YamlMap::get(const std::string& key) {
  known_.push_back(key);
  // Not node_[key]: it would compare as other types and leave undefined entries behind.
  for (const auto& entry : node_)
    if (entry.first.IsScalar() && entry.first.Scalar() == key) return entry.second;
  return YAML::Node(YAML::NodeType::Undefined);
}

bool YamlMap::has(const std::string& key) { return get(key).IsDefined(); }

void YamlMap::number(const std::string& key, NumberRange range, double& value) {
  const YAML::Node node = get(key);
  if (node.IsDefined()) readNumber(source_, node, key, range, value);
}

void YamlMap::whole(const std::string& key, int from, int to, int& value) {
  const YAML::Node node = get(key);
  if (node.IsDefined()) readWhole(source_, node, key, from, to, value);
}

void YamlMap::text(const std::string& key, std::string& value) {
  const YAML::Node node = get(key);
  if (node.IsDefined()) readText(source_, node, key, value);
}

void YamlMap::numbers(const std::string& key, std::size_t size, NumberRange range, std::vector<double>& values) {
  const YAML::Node node = get(key);
  if (!node.IsDefined()) return;
  if (!node.IsSequence() || node.size() != size) {
    source_.fail(node, key + " is " + shown(node), "a list of " + std::to_string(size) + " numbers, " + range.text());
    return;
  }
  std::vector<double> read(size);
  for (std::size_t k = 0; k < size; ++k)
    if (!readNumber(source_, node[k], key + "[" + std::to_string(k) + "]", range, read[k])) return;
  values = read;
}

void YamlMap::vector(const std::string& key, NumberRange range, Vec3& value) {
  std::vector<double> read;
  numbers(key, 3, range, read);
  if (read.size() == 3) value = Vec3(read[0], read[1], read[2]);
}

int YamlMap::choice(const std::string& key, const std::vector<std::string>& words) {
  const YAML::Node node = get(key);
  if (!node.IsDefined()) return -1;
  if (node.IsScalar()) {
    const auto found = std::find(words.begin(), words.end(), node.Scalar());
    if (found != words.end()) return static_cast<int>(found - words.begin());
  }
  std::string accepted;
  for (const std::string& word : words) accepted += (accepted.empty() ? "" : ", ") + word;
  source_.fail(node, key + " is " + shown(node), accepted);
  return -1;
}

void YamlMap::finish() {
  for (const auto& entry : node_) {
    if (!entry.first.IsScalar()) continue;
    const std::string& key = entry.first.Scalar();
    if (std::find(known_.begin(), known_.end(), key) != known_.end()) continue;
    source_.fail(
        entry.first,
        "unknown key " + shown(entry.first) + " in " + what_ + ", did you mean '" + nearestWord(key, known_) + "'?",
        join(known_));
  }
}

}  // namespace meshless
