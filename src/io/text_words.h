// Lines and words of a text where they stand: nothing is copied, however long they are.
#pragma once

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "meshless_surgery/base/result.h"

namespace meshless {

constexpr std::size_t kMaxHeader = 1 << 16;  // bytes
constexpr std::size_t kMaxLine = 1 << 16;    // characters
constexpr std::size_t kMaxNumber = 4096;     // characters

inline bool isBlank(char c) { return c == ' ' || (c >= '\t' && c <= '\r'); }

/// Takes the next line off `rest`, without its end: a line feed, a carriage return, or both; false where there is none.
inline bool nextLine(std::string_view& rest, std::string_view& line) {
  if (rest.empty()) return false;
  const std::size_t end = std::min(rest.find_first_of("\r\n"), rest.size());
  line = rest.substr(0, end);
  const bool both = end + 1 < rest.size() && rest[end] == '\r' && rest[end + 1] == '\n';
  rest.remove_prefix(std::min(end + (both ? 2 : 1), rest.size()));
  return true;
}

/// Without a byte-order mark of UTF-8.
inline std::string_view withoutMark(std::string_view text) {
  return text.substr(0, 3) == "\xef\xbb\xbf" ? text.substr(3) : text;
}

/// Takes the next word off `rest`; empty where there is none.
inline std::string_view nextWord(std::string_view& rest) {
  std::size_t from = 0;
  while (from < rest.size() && isBlank(rest[from])) ++from;
  std::size_t to = from;
  while (to < rest.size() && !isBlank(rest[to])) ++to;
  const std::string_view word = rest.substr(from, to - from);
  rest.remove_prefix(to);
  return word;
}

/// For lines of bounded length.
inline std::vector<std::string> wordsOf(std::string_view line) {
  std::vector<std::string> all;
  for (std::string_view word = nextWord(line); !word.empty(); word = nextWord(line)) all.emplace_back(word);
  return all;
}

/// The whole lines at the start, as far as a header may reach.
inline std::string_view headOf(std::string_view text) {
  if (text.size() <= kMaxHeader) return text;
  const std::string_view head = text.substr(0, kMaxHeader);
  const std::size_t end = head.rfind('\n');
  return head.substr(0, end == std::string_view::npos ? 0 : end + 1);
}

/// What is wrong with the bytes of a text from `from` on, for a message; empty where they may be one.
inline std::string notText(std::string_view text, std::size_t from = 0) {
  const std::size_t at = text.find('\0', from);
  return at == std::string_view::npos ? "" : "has the byte 0 at " + std::to_string(at) + "; accepted: text";
}

/// The number that the word is, or nothing. Also with a decimal comma, and with the exponents of Fortran, 1.5D+02.
inline std::optional<double> numberOf(std::string_view word) {
  if (word.empty() || word.size() > kMaxNumber) return std::nullopt;
  std::string text(word);
  if (text.find('.') == std::string::npos && std::count(text.begin(), text.end(), ',') == 1) text[text.find(',')] = '.';
  const bool plain = text.find_first_not_of("+-.0123456789dD") == std::string::npos;
  if (const std::size_t exponent = text.find_first_of("dD"); plain && exponent != std::string::npos && exponent > 0)
    text[exponent] = 'e';
  char* end = nullptr;
  const double x = std::strtod(text.c_str(), &end);
  if (end != text.c_str() + text.size()) return std::nullopt;
  return x;
}

/// A whole number >= 0 as a double, so that no count overflows; NaN where it is none.
inline double countOf(const std::string& word) {
  if (word.empty() || !std::all_of(word.begin(), word.end(), [](unsigned char c) { return std::isdigit(c); }))
    return std::nan("");
  return std::strtod(word.c_str(), nullptr);
}

/// The start of it, for a message.
inline std::string printable(std::string text) {
  text = text.substr(0, 60);
  for (char& c : text)
    if (!std::isprint(static_cast<unsigned char>(c))) c = '?';
  return text;
}

/// Of a file of this name.
inline Error unreadable(const std::string& name, const std::string& what) {
  return {ErrorCode::kUnreadable, "'" + name + "' " + what};
}

inline std::string lowerCase(std::string_view text) {
  std::string low(text);
  for (char& c : low) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return low;
}

}  // namespace meshless
