// Binary archives by cereal: values to bytes and back, in the machine's own byte order. What is read is not trusted: a
// size is checked against the bytes that are left before memory is taken, and every fault throws ArchiveFault.
#pragma once

#include <any>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <stdexcept>
#include <string_view>
#include <type_traits>

#include <cereal/cereal.hpp>

#include "meshless_surgery/base/types.h"

namespace meshless {

struct ArchiveFault : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Hands bytes to whoever collects them.
template <class Self>
class ByteOutput : public cereal::OutputArchive<Self, cereal::AllowEmptyClassElision> {
 public:
  explicit ByteOutput(Self* self) : cereal::OutputArchive<Self, cereal::AllowEmptyClassElision>(self) {}
};

class OutArchive : public ByteOutput<OutArchive> {
 public:
  explicit OutArchive(std::string& bytes) : ByteOutput<OutArchive>(this), bytes_(bytes) {}
  void put(const void* data, std::size_t size) { bytes_.append(static_cast<const char*>(data), size); }
  /// Which of the shared values that is, in the order in which they come.
  std::uint32_t placeOf(const void* shared) {
    return places_.emplace(shared, static_cast<std::uint32_t>(places_.size())).first->second;
  }
  std::size_t shared() const { return places_.size(); }

 private:
  std::string& bytes_;
  std::map<const void*, std::uint32_t> places_;
};

/// A hash of what would have been written. Not for security.
class HashArchive : public ByteOutput<HashArchive> {
 public:
  HashArchive() : ByteOutput<HashArchive>(this) {}
  void put(const void* data, std::size_t size) {
    const auto* bytes = static_cast<const unsigned char*>(data);
    for (; size >= 8; bytes += 8, size -= 8) {
      std::uint64_t word;
      std::memcpy(&word, bytes, 8);
      mix(word);
    }
    for (; size > 0; ++bytes, --size) mix(*bytes);
  }
  std::uint64_t hash() const { return hash_; }

 private:
  // FNV-1a on words; turned, so that what differs in the highest bit alone spreads.
  void mix(std::uint64_t word) {
    hash_ ^= word;
    hash_ = ((hash_ << 23) | (hash_ >> 41)) * 1099511628211ull;
  }
  std::uint64_t hash_ = 14695981039346656037ull;
};

class InArchive : public cereal::InputArchive<InArchive, cereal::AllowEmptyClassElision> {
 public:
  /// Keeps a view of the bytes.
  explicit InArchive(std::string_view bytes)
      : cereal::InputArchive<InArchive, cereal::AllowEmptyClassElision>(this), left_(bytes) {}
  void take(void* data, std::size_t size) {
    need(size, 1);
    if (size == 0) return;  // data may be null
    std::memcpy(data, left_.data(), size);
    left_.remove_prefix(size);
  }
  std::size_t left() const { return left_.size(); }
  /// The shared values that have come.
  std::vector<std::any>& shared() { return shared_; }
  /// Throws where `count` elements of at least `bytes` each cannot be there.
  void need(std::uint64_t count, std::size_t bytes) const {
    if (count > left_.size() / bytes)
      throw ArchiveFault("it claims " + std::to_string(count) + " values of " + std::to_string(bytes) +
                         " bytes where " + std::to_string(left_.size()) + " bytes are left");
  }

 private:
  std::string_view left_;
  std::vector<std::any> shared_;
};

/// Values that are their bytes: numbers, and fixed arrays and matrices of them.
template <class T>
struct IsPlain : std::bool_constant<std::is_arithmetic_v<T> && !std::is_same_v<T, bool>> {};
template <class T, std::size_t n>
struct IsPlain<std::array<T, n>> : IsPlain<T> {};
template <class T, int rows, int columns>
struct IsPlain<Eigen::Matrix<T, rows, columns>> : std::bool_constant<(rows > 0 && columns > 0 && IsPlain<T>::value)> {};

/// No number of a world is larger: squares and products of a few coordinates stay finite.
constexpr double kMostNumber = 1e100, kMostCoordinate = 1e20;
inline void requireNumbers(const double* values, std::size_t count, double most) {
  for (const double* value = values; value != values + count; ++value)
    if (!(std::abs(*value) <= most)) throw ArchiveFault("a number is " + std::to_string(*value));
}
template <class T>
void requireNumbers(const T*, std::size_t) {}
inline void requireNumbers(const double* values, std::size_t count) { requireNumbers(values, count, kMostNumber); }
template <std::size_t n>
void requireNumbers(const std::array<double, n>* values, std::size_t count) {
  if (count > 0) requireNumbers(values->data(), n * count, kMostNumber);
}
template <class T, std::size_t m, std::size_t n>
void requireNumbers(const std::array<std::array<T, m>, n>* values, std::size_t count) {
  if (count > 0) requireNumbers(values->data(), n * count);
}
template <int rows, int columns>
void requireNumbers(const Eigen::Matrix<double, rows, columns>* values, std::size_t count) {
  if (count > 0)
    requireNumbers(values->data(), rows * columns * count, rows * columns == 3 ? kMostCoordinate : kMostNumber);
}

template <class Out, class T, std::enable_if_t<IsPlain<T>::value, int> = 0>
void save(ByteOutput<Out>& out, const T& value) {
  static_cast<Out&>(out).put(&value, sizeof value);
}
/// Numbers that are none are refused here, once for all that is read.
template <class T, std::enable_if_t<IsPlain<T>::value, int> = 0>
void load(InArchive& in, T& value) {
  in.take(&value, sizeof value);
  requireNumbers(&value, 1);
}

// Another byte than 0 or 1 is no bool.
template <class Out>
void save(ByteOutput<Out>& out, const bool& value) {
  const unsigned char byte = value ? 1 : 0;
  static_cast<Out&>(out).put(&byte, 1);
}
inline void load(InArchive& in, bool& value) {
  unsigned char byte = 0;
  in.take(&byte, 1);
  if (byte > 1) throw ArchiveFault("a yes or no is " + std::to_string(byte));
  value = byte == 1;
}

/// An enum, written as a number and refused beyond its last value: archive(choice(kind, Kind::kLast)).
template <class E>
struct Choice {
  E& value;
  E last;
};
template <class E>
Choice<E> choice(E& value, E last) {
  return {value, last};
}
template <class Archive, class E>
void serialize(Archive& archive, Choice<E>& choice) {
  auto number = static_cast<std::int32_t>(choice.value);
  archive(number);
  if (number < 0 || number > static_cast<std::int32_t>(choice.last))
    throw ArchiveFault("a choice is " + std::to_string(number) + " of 0.." +
                       std::to_string(static_cast<std::int32_t>(choice.last)));
  choice.value = static_cast<E>(number);
}

template <class Out>
void save(ByteOutput<Out>& out, const Quat& value) {
  static_cast<Out&>(out).put(value.coeffs().data(), 4 * sizeof(double));
}
inline void load(InArchive& in, Quat& value) {
  in.take(value.coeffs().data(), 4 * sizeof(double));
  requireNumbers(value.coeffs().data(), 4, 2.0);
}

template <class Out>
void save(ByteOutput<Out>& out, const std::string& value) {
  const std::uint64_t size = value.size();
  static_cast<Out&>(out).put(&size, sizeof size);
  static_cast<Out&>(out).put(value.data(), value.size());
}
inline void load(InArchive& in, std::string& value) {
  std::uint64_t size = 0;
  in.take(&size, sizeof size);
  in.need(size, 1);
  value.resize(size);
  in.take(value.data(), size);
}

template <class Out, class T>
void save(ByteOutput<Out>& out, const std::vector<T>& values) {
  const std::uint64_t size = values.size();
  static_cast<Out&>(out).put(&size, sizeof size);
  if constexpr (IsPlain<T>::value) {
    static_cast<Out&>(out).put(values.data(), values.size() * sizeof(T));
  } else {
    for (const T& value : values) static_cast<Out&>(out)(value);
  }
}
template <class T>
void load(InArchive& in, std::vector<T>& values) {
  std::uint64_t size = 0;
  in.take(&size, sizeof size);
  values.clear();
  if constexpr (IsPlain<T>::value) {
    in.need(size, sizeof(T));
    values.resize(size);
    in.take(values.data(), size * sizeof(T));
    requireNumbers(values.data(), values.size());
  } else {
    in.need(size, 1);
    // One after another: a size that lies runs out of bytes before it takes much memory.
    for (std::uint64_t i = 0; i < size; ++i) {
      T value{};
      in(value);
      values.push_back(std::move(value));
    }
  }
}

/// Numbers that may be infinite: archive(endless(vector)).
struct Endless {
  std::vector<double>& values;
};
inline Endless endless(std::vector<double>& values) { return {values}; }
template <class Out>
void save(ByteOutput<Out>& out, const Endless& endless) {
  save(out, endless.values);
}
inline void load(InArchive& in, Endless& endless) {
  std::uint64_t size = 0;
  in.take(&size, sizeof size);
  in.need(size, sizeof(double));
  endless.values.resize(size);
  in.take(endless.values.data(), size * sizeof(double));
  for (const double value : endless.values)
    if (value != std::numeric_limits<double>::infinity()) requireNumbers(&value, 1);
}
/// One of them.
struct EndlessNumber {
  double& value;
};
inline EndlessNumber endless(double& value) { return {value}; }
template <class Out>
void save(ByteOutput<Out>& out, const EndlessNumber& endless) {
  save(out, endless.value);
}
inline void load(InArchive& in, EndlessNumber& endless) {
  in.take(&endless.value, sizeof endless.value);
  if (endless.value != std::numeric_limits<double>::infinity()) requireNumbers(&endless.value, 1);
}

template <class Out, class T>
void save(ByteOutput<Out>& out, const std::optional<T>& value) {
  static_cast<Out&>(out)(value.has_value());
  if (value) static_cast<Out&>(out)(*value);
}
template <class T>
void load(InArchive& in, std::optional<T>& value) {
  bool there = false;
  in(there);
  value.reset();
  if (!there) return;
  value.emplace();
  in(*value);
}

template <class Out>
void save(ByteOutput<Out>& out, const std::set<std::string>& values) {
  save(out, std::vector<std::string>(values.begin(), values.end()));
}
inline void load(InArchive& in, std::set<std::string>& values) {
  std::vector<std::string> read;
  load(in, read);
  values = std::set<std::string>(read.begin(), read.end());
}

}  // namespace meshless

/// Writes and reads a struct by its fields, all of them in their order: one that is added and not named does not
/// compile.
#define MESHLESS_ARCHIVE(Type, ...)         \
  template <class A>                        \
  void serialize(A& archive, Type& value) { \
    auto& [__VA_ARGS__] = value;            \
    archive(__VA_ARGS__);                   \
  }

CEREAL_SETUP_ARCHIVE_TRAITS(meshless::InArchive, meshless::OutArchive)
