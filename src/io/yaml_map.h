// Reading YAML maps so that every fault is named with file, line, value and what would be accepted. The first fault is
// kept; what is read after it does not matter.
#pragma once

#include <optional>
#include <set>
#include <string>
#include <vector>

#include <yaml-cpp/yaml.h>

#include "meshless_surgery/base/result.h"
#include "meshless_surgery/base/types.h"

namespace meshless {

/// The file's or text's name for messages, the first fault found in it, and what could be done without.
struct YamlSource {
  std::string name;
  std::optional<Error> fault;
  std::vector<std::string> warnings{};

  void warn(const YAML::Node& at, const std::string& what);
  void fail(const YAML::Node& at, const std::string& what, const std::string& accepted,
            ErrorCode code = ErrorCode::kInvalidArgument);
};

/// One document of at most 1 MiB. `real_path` has no links in it; `name` is for messages. Refuses kUnreadable, or
/// kInvalidArgument with the line where it is no YAML.
Result<YAML::Node> readYamlFile(const std::string& real_path, const std::string& name);
Result<YAML::Node> parseYaml(const std::string& text, const std::string& name);

/// `value` for a message: short, printable.
std::string shown(const YAML::Node& value);
/// The one of `known` that takes the fewest edits to become `word` (letters put in, taken out, changed or swapped);
/// empty where `known` is.
std::string nearestWord(const std::string& word, const std::vector<std::string>& known);

/// Numbers from..to; open ends are left out. NaN and infinity are never accepted.
struct NumberRange {
  double from, to;
  bool open_from = false;
  const char* unit = "";

  bool holds(double x) const { return (open_from ? x > from : x >= from) && x <= to; }
  std::string text() const;
};

/// A map whose keys are asked for one by one; finish() names those that nobody asked for.
class YamlMap {
 public:
  /// `what` is the map's name in messages: "world", "body 'liver'".
  YamlMap(YamlSource& source, const YAML::Node& node, std::string what);

  bool has(const std::string& key);
  /// The key's value; undefined where it is absent.
  YAML::Node get(const std::string& key);
  /// Names a key that is known without reading it.
  void know(const std::string& key) { known_.push_back(key); }

  // Each leaves `value` as it is where the key is absent.
  void number(const std::string& key, NumberRange range, double& value);
  void whole(const std::string& key, int from, int to, int& value);
  void text(const std::string& key, std::string& value);
  void numbers(const std::string& key, std::size_t size, NumberRange range, std::vector<double>& values);
  void vector(const std::string& key, NumberRange range, Vec3& value);
  /// The index of the word in `words`; -1 where the key is absent or wrong.
  int choice(const std::string& key, const std::vector<std::string>& words);

  void finish();
  YamlSource& source() { return source_; }
  const std::string& what() const { return what_; }

 private:
  YamlSource& source_;
  YAML::Node node_;
  std::string what_;
  std::vector<std::string> known_;
};

// The same for a value that is no map's entry.
bool readNumber(YamlSource& source, const YAML::Node& node, const std::string& what, NumberRange range, double& value);
bool readWhole(YamlSource& source, const YAML::Node& node, const std::string& what, int from, int to, int& value);
bool readText(YamlSource& source, const YAML::Node& node, const std::string& what, std::string& value);

}  // namespace meshless
